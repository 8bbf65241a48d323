// Request heads: what is understood, and the exact words for what is refused.
#include "server/http/message/head_parser.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace voxeld::http {
namespace {

const std::string kGoodHead =
    "POST /v1/voxelize?size=128&mode=solid HTTP/1.1\r\n"
    "Host: localhost\r\n"
    "Content-Length: 17\r\n"
    "Accept: a/b\r\n"
    "accept: c/d\r\n"
    "X-Empty:\r\n"
    "\r\n";

// A request with `lines` (each with its CRLF) after the Host.
std::string with_lines(const std::string& lines, const std::string& line = "GET / HTTP/1.1") {
  return line + "\r\nHost: h\r\n" + lines + "\r\n";
}

std::string target_of(const std::string& target) {
  return "GET " + target + " HTTP/1.1\r\nHost: h\r\n\r\n";
}

// The whole message of the refusal, or "accepted".
std::string refusal(const std::string& text) {
  const auto head = parse_head(text);
  return head ? "accepted" : head.error().message();
}

TEST(HeadParser, a_request_is_taken_apart) {
  const auto head = parse_head(kGoodHead);
  ASSERT_TRUE(head) << head.error().message();
  EXPECT_EQ(head->method, "POST");
  EXPECT_EQ(head->target, "/v1/voxelize?size=128&mode=solid");
  EXPECT_EQ(head->path, "/v1/voxelize");
  EXPECT_EQ(head->query, (OptionPairs{{"size", "128"}, {"mode", "solid"}}));
  EXPECT_EQ(head->minor, 1);
  EXPECT_EQ(head->content_length, 17);
  EXPECT_FALSE(head->chunked);
  EXPECT_TRUE(head->has_body());
  EXPECT_EQ(head->header("HOST"), "localhost");
  EXPECT_EQ(head->header("absent"), "");
}

TEST(HeadParser, a_header_that_stands_twice_is_joined_by_a_comma) {
  EXPECT_EQ(parse_head(kGoodHead)->header("Accept"), "a/b, c/d");
}

TEST(HeadParser, an_empty_header_value_adds_nothing_to_a_list) {
  EXPECT_EQ(parse_head(with_lines("A: b\r\nA:\r\n"))->header("A"), "b");
  EXPECT_EQ(parse_head(with_lines("A:\r\nA: b\r\nA: c\r\n"))->header("A"), "b, c");
}

TEST(HeadParser, an_empty_header_value_is_preserved) {
  EXPECT_EQ(parse_head(kGoodHead)->headers.count("x-empty"), 1u);
}

TEST(HeadParser, spaces_and_tabs_around_a_value_are_dropped) {
  EXPECT_EQ(parse_head(with_lines("A: \t b c \t\r\n"))->header("A"), "b c");
}

TEST(HeadParser, every_truncation_is_cut_off) {
  for (size_t bytes = 0; bytes < kGoodHead.size(); ++bytes) {
    EXPECT_EQ(refusal(kGoodHead.substr(0, bytes)), "the head of the request is cut off") << bytes;
  }
}

TEST(HeadParser, every_control_byte_in_place_of_any_other_is_refused) {
  for (size_t at = 0; at < kGoodHead.size() - 2; ++at) {
    for (const char c : {'\0', '\x01', '\n', '\r', '\x7f'}) {
      std::string text = kGoodHead;
      if (text[at] == c) continue;
      text[at] = c;
      EXPECT_FALSE(parse_head(text).ok()) << "byte " << at << " = " << static_cast<int>(c);
    }
  }
}

struct Refusal {
  const char* what;
  std::string text;
  const char* message;
};

void expect_refusals(const std::vector<Refusal>& cases) {
  for (const Refusal& c : cases) {
    const auto head = parse_head(c.text);
    ASSERT_FALSE(head) << c.what;
    EXPECT_EQ(head.error().message(), c.message) << c.what;
    EXPECT_EQ(head.error().code, ErrorCode::kBadRequest) << c.what;
  }
}

TEST(HeadParser, broken_request_lines_are_refused) {
  const auto line = [](const std::string& text) { return with_lines("", text); };
  const char* form = "request line: expected METHOD TARGET HTTP/1.1, got something else";
  const char* version = "protocol version: expected HTTP/1.1 or HTTP/1.0, got another";
  expect_refusals({
      {"empty", "\r\n\r\n", "the request line is missing"},
      {"an empty line first", "\r\nGET / HTTP/1.1\r\nHost: h\r\n\r\n",
       "the request line is missing"},
      {"one word", line("GET"), form},
      {"HTTP/0.9", line("GET /"), form},
      {"two spaces after the method", line("GET  / HTTP/1.1"), "request target has a space in it"},
      {"a space in the target", line("GET /a b HTTP/1.1"), "request target has a space in it"},
      {"no target", line("GET  HTTP/1.1"), "request target has a space in it"},
      {"no method", line(" / HTTP/1.1"), "request method is no token"},
      {"a method with a colon", line("G:T / HTTP/1.1"), "request method is no token"},
      {"a method of 21 letters", line(std::string(21, 'A') + " / HTTP/1.1"),
       "request method is no token"},
      {"HTTP/2", line("GET / HTTP/2.0"), version},
      {"small letters", line("GET / http/1.1"), version},
      {"HTTP/1.10", line("GET / HTTP/1.10"), version},
      {"a space at the end", line("GET / HTTP/1.1 "), "request target has a space in it"},
  });
}

TEST(HeadParser, broken_header_lines_are_refused) {
  const char* form = "header line: expected Name: value, got no valid name before a colon";
  const char* control = "control character or bare line feed in the head";
  expect_refusals({
      {"folded", with_lines("A: b\r\n c\r\n"), "folded header line"},
      {"folded by a tab", with_lines("A: b\r\n\tc\r\n"), "folded header line"},
      {"folded first line", "GET / HTTP/1.1\r\n Host: h\r\n\r\n", "folded header line"},
      {"no colon", with_lines("A b\r\n"), form},
      {"no name", with_lines(": b\r\n"), form},
      {"a space before the colon", with_lines("A : b\r\n"), form},
      {"a space in the name", with_lines("A B: c\r\n"), form},
      {"letters outside ASCII in a name", with_lines("\xc3\x84: c\r\n"), form},
      {"bare line feed", with_lines("A: b\nC: d\r\n"), control},
      {"bare carriage return", with_lines("A: b\rC: d\r\n"), control},
      {"NUL", with_lines(std::string("A: b\0c\r\n", 8)), control},
      {"DEL", with_lines("A: \x7f\r\n"), control},
      {"line feeds alone", "GET / HTTP/1.1\nHost: h\n\n", "the head of the request is cut off"},
  });
}

TEST(HeadParser, the_framing_of_a_body_must_be_unambiguous) {
  const auto length = [](const std::string& value) {
    return with_lines("Content-Length: " + value + "\r\n");
  };
  const auto coding = [](const std::string& value, const std::string& line = "GET / HTTP/1.1") {
    return with_lines("Transfer-Encoding: " + value + "\r\n", line);
  };
  expect_refusals({
      {"no Host", "GET / HTTP/1.1\r\n\r\n", "header Host is missing"},
      {"two Hosts", with_lines("host: other\r\n"), "header host stands twice"},
      {"both", with_lines("Content-Length: 3\r\nTransfer-Encoding: chunked\r\n"),
       "both Content-Length and Transfer-Encoding"},
      {"two equal lengths", with_lines("Content-Length: 3\r\nContent-length: 3\r\n"),
       "header Content-length stands twice"},
      {"two codings", with_lines("Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n"),
       "header Transfer-Encoding stands twice"},
      {"two ranges", with_lines("Range: bytes=0-1\r\nRange: bytes=2-3\r\n"),
       "header Range stands twice"},
      {"empty length", length(""), "Content-Length: expected a number of bytes, got \"\""},
      {"a list", length("3, 3"), "Content-Length: expected a number of bytes, got \"3, 3\""},
      {"negative", length("-1"), "Content-Length: expected a number of bytes, got \"-1\""},
      {"minus zero", length("-0"), "Content-Length: expected a number of bytes, got \"-0\""},
      {"plus", length("+1"), "Content-Length: expected a number of bytes, got \"+1\""},
      {"hexadecimal", length("0x10"), "Content-Length: expected a number of bytes, got \"0x10\""},
      {"a fraction", length("1.5"), "Content-Length: expected a number of bytes, got \"1.5\""},
      {"over 63 bits", length("9223372036854775808"),
       "Content-Length: expected a number of bytes, got \"9223372036854775808\""},
      {"gzip", coding("gzip, chunked"),
       "Transfer-Encoding: expected chunked, got \"gzip, chunked\""},
      {"identity", coding("identity"), "Transfer-Encoding: expected chunked, got \"identity\""},
      {"chunked twice", coding("chunked, chunked"),
       "Transfer-Encoding: expected chunked, got \"chunked, chunked\""},
      {"HTTP/1.0", coding("chunked", "GET / HTTP/1.0"),
       "Transfer-Encoding: expected chunked, got \"chunked\""},
  });
}

TEST(HeadParser, the_largest_length_is_a_number_and_chunked_is_known_in_any_case) {
  EXPECT_EQ(parse_head(with_lines("Content-Length: 9223372036854775807\r\n"))->content_length,
            INT64_MAX);
  const auto head = parse_head(with_lines("Transfer-Encoding: Chunked\r\n"));
  ASSERT_TRUE(head);
  EXPECT_TRUE(head->chunked);
  EXPECT_TRUE(head->has_body());
  EXPECT_FALSE(parse_head(with_lines("Content-Length: 0\r\n"))->has_body());
}

TEST(HeadParser, a_content_encoding_is_one_that_is_decoded_or_an_unsupported_media_type) {
  const auto head = parse_head(with_lines("Content-Encoding: br\r\n"));
  ASSERT_FALSE(head);
  EXPECT_EQ(head.error().code, ErrorCode::kUnsupportedMedia);
  EXPECT_EQ(
      head.error().message(),
      "Content-Encoding of the request: expected gzip or zstd, once, or identity, got \"br\"");
  EXPECT_EQ(parse_head(with_lines(""))->coding, ContentCoding::kNone);
  EXPECT_EQ(parse_head(with_lines("Content-Encoding: identity\r\n"))->coding, ContentCoding::kNone);
  EXPECT_EQ(parse_head(with_lines("Content-Encoding: gzip\r\n"))->coding, ContentCoding::kGzip);
  EXPECT_EQ(parse_head(with_lines("Content-Encoding: zstd\r\n"))->coding, ContentCoding::kZstd);
}

TEST(HeadParser, a_hundred_header_lines_are_taken_and_one_more_is_refused) {
  std::string lines;  // Host is one of them
  for (size_t i = 1; i < kHeaderCountMax; ++i) lines += "X-" + std::to_string(i) + ": 1\r\n";
  EXPECT_EQ(refusal(with_lines(lines)), "accepted");
  EXPECT_EQ(refusal(with_lines(lines + "Y: 1\r\n")),
            "too many header lines: expected at most 100, got more");
}

TEST(HeadParser, a_target_of_8192_bytes_is_taken_and_one_more_is_refused) {
  const std::string target = "/" + std::string(kTargetBytesMax - 1, 'a');
  EXPECT_EQ(refusal(target_of(target)), "accepted");
  EXPECT_EQ(refusal(target_of(target + "a")),
            "request target is too long: expected at most 8192 bytes, got 8193");
}

TEST(HeadParser, the_absolute_form_loses_its_authority) {
  EXPECT_EQ(parse_head(target_of("http://h:80/a/b?c=d"))->path, "/a/b");
  EXPECT_EQ(parse_head(target_of("http://h:80"))->path, "/");
}

TEST(HeadParser, the_host_is_that_of_the_target_or_else_of_the_header) {
  const auto of = [](const std::string& text) { return parse_head(text)->authority; };
  EXPECT_EQ(of("GET / HTTP/1.1\r\nHost: Voxels.example:8080\r\n\r\n"),
            (Authority{"voxels.example", 8080}));
  EXPECT_EQ(of("GET / HTTP/1.1\r\nHost: [::1]\r\n\r\n"), (Authority{"[::1]", 0}));
  EXPECT_EQ(of("GET / HTTP/1.1\r\nHost:\r\n\r\n"), (Authority{"", 0}));
  EXPECT_EQ(of("GET / HTTP/1.0\r\n\r\n"), (Authority{"", 0}));
  EXPECT_EQ(of("GET http://evil.example:81/ HTTP/1.1\r\nHost: localhost\r\n\r\n"),
            (Authority{"evil.example", 81}));
}

TEST(HeadParser, a_host_that_is_none_is_refused) {
  for (const char* host :
       {"a b", "a,b", "a/b", "user@h", "h:x", "h:65536", "[::1", "::1", "h%2e"}) {
    EXPECT_EQ(refusal("GET / HTTP/1.1\r\nHost: " + std::string(host) + "\r\n\r\n"),
              "header Host: expected HOST or HOST:PORT, got \"" + std::string(host) + "\"");
    EXPECT_EQ(refusal("GET / HTTP/1.0\r\nHost: " + std::string(host) + "\r\n\r\n"),
              "header Host: expected HOST or HOST:PORT, got \"" + std::string(host) + "\"");
  }
  const char* target = "host of the request target: expected HOST or HOST:PORT, got something else";
  expect_refusals({
      {"user information", target_of("http://user@h/"), target},
      {"no host", target_of("http:///a"), target},
      {"a port alone", target_of("http://:80/a"), target},
  });
}

TEST(HeadParser, other_forms_of_targets_are_refused) {
  const char* form = "request target: expected a path that begins with /, got another form";
  expect_refusals({
      {"relative", target_of("a"), form},
      {"a question alone", target_of("?a"), form},
      {"authority form", target_of("h:80"), form},
      {"asterisk with GET", target_of("*"), form},
      {"https", target_of("https://h/"), form},
      // The first slash is one of the query: "/x" would be another resource than a proxy sees.
      {"a query straight after the authority", target_of("http://h?a=/x"), form},
  });
  EXPECT_EQ(parse_head("OPTIONS * HTTP/1.1\r\nHost: h\r\n\r\n")->path, "*");
}

TEST(HeadParser, paths_and_queries_are_percent_decoded) {
  EXPECT_EQ(parse_head(target_of("/a%20b%C3%A4+c"))->path, "/a b\xc3\xa4+c");
  EXPECT_EQ(parse_head(target_of("/a%2Fb%2fc"))->path, "/a%2fb%2fc");
  EXPECT_EQ(
      parse_head(target_of("/?a+b=c%2Bd&e=%2f&&f&g=&h=i=j&a=2"))->query,
      (OptionPairs{{"a b", "c+d"}, {"e", "/"}, {"f", ""}, {"g", ""}, {"h", "i=j"}, {"a", "2"}}));
}

TEST(HeadParser, header_values_are_not_decoded) {
  const auto head = parse_head(with_lines("X-Note: a%0d%0aInjected: 1\r\n"));
  ASSERT_TRUE(head);
  EXPECT_EQ(head->header("X-Note"), "a%0d%0aInjected: 1");
  EXPECT_EQ(head->header("Injected"), "");
}

TEST(HeadParser, broken_percent_encoding_is_refused) {
  const char* broken = "broken percent-encoding in the request target";
  const char* control = "control character in the request target";
  for (const char* target : {"/%", "/%4", "/%4g", "/%g4", "/%%41", "/a%", "/?a=%", "/?%2=a"}) {
    EXPECT_EQ(refusal(target_of(target)), broken) << target;
  }
  for (const char* target : {"/%00", "/%0a", "/%1F", "/%7f", "/?a=%0d", "/?%00=a"}) {
    EXPECT_EQ(refusal(target_of(target)), control) << target;
  }
}

TEST(PercentDecode, does_as_its_switches_say) {
  EXPECT_EQ(percent_decode("a+b", true, false).value(), "a b");
  EXPECT_EQ(percent_decode("a+b", false, false).value(), "a+b");
  EXPECT_EQ(percent_decode("%2F", false, false).value(), "/");
  EXPECT_EQ(percent_decode("%2F", false, true).value(), "%2f");
  EXPECT_EQ(percent_decode("%41", false, true).value(), "A");
  EXPECT_EQ(percent_decode("", true, true).value(), "");
}

TEST(Head, connections_persist_by_default_in_1_1_and_on_request_in_1_0) {
  EXPECT_TRUE(parse_head(with_lines(""))->keep_alive());
  EXPECT_FALSE(parse_head(with_lines("Connection: Close\r\n"))->keep_alive());
  EXPECT_FALSE(parse_head(with_lines("Connection: a\r\nConnection: close\r\n"))->keep_alive());
  EXPECT_FALSE(parse_head("GET / HTTP/1.0\r\n\r\n")->keep_alive());
  EXPECT_TRUE(parse_head("GET / HTTP/1.0\r\nConnection: Keep-Alive\r\n\r\n")->keep_alive());
}

}  // namespace
}  // namespace voxeld::http
