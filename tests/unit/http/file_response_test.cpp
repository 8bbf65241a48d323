// Conditional and partial responses (RFC 9110, sections 13 and 14).

#include "server/http/file_response.h"

#include <gtest/gtest.h>

#include <string>
#include <variant>

#include "server/http/message/head_parser.h"
#include "server/http/output.h"

namespace voxeld::http {
namespace {

// The response for 100 bytes that begin at byte 1000 of a file, with the entity tag "abc".
Response respond(const std::string& lines) {
  const auto head = parse_head("GET /x HTTP/1.1\r\nHost: h\r\n" + lines + "\r\n");
  EXPECT_TRUE(head) << lines;
  auto response = file_response(*head, {"/file", 1000, 100}, "\"abc\"");
  EXPECT_TRUE(response) << lines;
  return *std::move(response);
}

// "status: first+bytes of the file", with Content-Range where there is one.
std::string summary(const Response& response) {
  std::string text = std::to_string(response.status);
  if (const auto* file = std::get_if<FileBody>(&response.body)) {
    text += ": " + std::to_string(file->offset) + "+" + std::to_string(file->bytes);
  }
  const auto range = response.headers.find("Content-Range");
  return range == response.headers.end() ? text : text + " " + range->second;
}
std::string range(const std::string& value) {
  return summary(respond("Range: " + value + "\r\n"));
}

const char* const kWhole = "200: 1000+100";

TEST(FileResponse, the_whole_names_its_tag_and_that_it_takes_ranges) {
  const Response response = respond("");
  EXPECT_EQ(summary(response), kWhole);
  EXPECT_EQ(response.headers.at("ETag"), "\"abc\"");
  EXPECT_EQ(response.headers.at("Accept-Ranges"), "bytes");
  EXPECT_EQ(response.headers.at("Cache-Control"), "private, max-age=31536000, immutable");
}

TEST(FileResponse, one_range_is_a_part_of_the_file) {
  EXPECT_EQ(range("bytes=0-0"), "206: 1000+1 bytes 0-0/100");
  EXPECT_EQ(range("bytes=10-19"), "206: 1010+10 bytes 10-19/100");
  EXPECT_EQ(range("bytes=99-"), "206: 1099+1 bytes 99-99/100");
  EXPECT_EQ(range("bytes=0-"), "206: 1000+100 bytes 0-99/100");
  EXPECT_EQ(range("bytes=90-9223372036854775807"), "206: 1090+10 bytes 90-99/100");
}

TEST(FileResponse, a_suffix_is_counted_from_the_end) {
  EXPECT_EQ(range("bytes=-1"), "206: 1099+1 bytes 99-99/100");
  EXPECT_EQ(range("bytes=-100"), "206: 1000+100 bytes 0-99/100");
  EXPECT_EQ(range("bytes=-101"), "206: 1000+100 bytes 0-99/100");
  EXPECT_EQ(range("bytes=-9223372036854775807"), "206: 1000+100 bytes 0-99/100");
}

TEST(FileResponse, a_range_outside_is_not_satisfiable) {
  for (const char* value : {"bytes=100-", "bytes=100-200", "bytes=-0",
                            "bytes=9223372036854775807-9223372036854775807"}) {
    const Response response = respond("Range: " + std::string(value) + "\r\n");
    EXPECT_EQ(summary(response), "416 bytes */100") << value;
    EXPECT_EQ(response.headers.at("Content-Type"), "application/problem+json");
    const auto& body = std::get<std::string>(response.body);
    EXPECT_NE(body.find("\"range-not-satisfiable\""), std::string::npos) << body;
    EXPECT_NE(body.find("a first byte below 100"), std::string::npos) << body;
  }
}

TEST(FileResponse, a_header_that_is_not_a_single_byte_range_gets_the_whole_file) {
  for (const char* value : {"bytes=", "bytes=-", "bytes=5", "bytes=5-4", "bytes=a-5", "bytes=5-a",
                            "bytes=0--0", "bytes=--5", "bytes=+1-5", "bytes= 1-5", "bytes=0-1,5-6",
                            "lines=0-1", "0-1", "bytes=18446744073709551616-", "bytes=0x1-5"}) {
    EXPECT_EQ(range(value), kWhole) << value;
  }
}

TEST(FileResponse, nothing_of_an_empty_file_can_be_asked_for) {
  const auto head = parse_head("GET /x HTTP/1.1\r\nHost: h\r\nRange: bytes=-5\r\n\r\n");
  EXPECT_EQ(summary(*file_response(*head, {"/file", 0, 0}, "\"a\"")), "416 bytes */0");
}

TEST(FileResponse, a_head_request_is_told_of_the_whole_file) {
  for (const char* value : {"bytes=0-0", "bytes=100-"}) {
    const auto head =
        parse_head("HEAD /x HTTP/1.1\r\nHost: h\r\nRange: " + std::string(value) + "\r\n\r\n");
    EXPECT_EQ(summary(*file_response(*head, {"/file", 1000, 100}, "\"abc\"")), kWhole) << value;
  }
}

TEST(FileResponse, the_response_to_a_post_is_whole_whatever_its_conditions) {
  for (const char* line :
       {"Range: bytes=0-0", "Range: bytes=100-", "If-None-Match: \"abc\"", "If-None-Match: *"}) {
    const auto head = parse_head("POST /x HTTP/1.1\r\nHost: h\r\n" + std::string(line) +
                                 "\r\nContent-Length: 1\r\n\r\n");
    ASSERT_TRUE(head) << line;
    EXPECT_EQ(summary(*file_response(*head, {"/file", 1000, 100}, "\"abc\"")), kWhole) << line;
  }
}

TEST(FileResponse, if_range_asks_for_the_part_of_this_very_content) {
  const auto summary_with = [](const std::string& tag) {
    return summary(respond("Range: bytes=0-0\r\nIf-Range: " + tag + "\r\n"));
  };
  EXPECT_EQ(summary_with("\"abc\""), "206: 1000+1 bytes 0-0/100");
  EXPECT_EQ(summary_with("\"other\""), kWhole);
  EXPECT_EQ(summary_with("W/\"abc\""), kWhole);  // the comparison is the strong one
  EXPECT_EQ(summary_with("Sun, 06 Nov 1994 08:49:37 GMT"), kWhole);
}

TEST(FileResponse, an_etag_that_matches_is_not_modified) {
  for (const char* tags : {"\"abc\"", "W/\"abc\"", "*", "\"x\", \"abc\"", "\"x\" ,W/\"abc\" "}) {
    const Response response = respond("If-None-Match: " + std::string(tags) + "\r\n");
    EXPECT_EQ(summary(response), "304") << tags;
    EXPECT_EQ(std::get<std::string>(response.body), "");
    EXPECT_EQ(response.headers.at("ETag"), "\"abc\"");
  }
  for (const char* tags : {"\"x\"", "abc", "\"abc", "\"ab\", \"c\""}) {
    EXPECT_EQ(summary(respond("If-None-Match: " + std::string(tags) + "\r\n")), kWhole) << tags;
  }
}

TEST(FileResponse, a_matching_etag_takes_precedence_over_a_range) {
  EXPECT_EQ(summary(respond("If-None-Match: \"abc\"\r\nRange: bytes=500-\r\n")), "304");
}

TEST(ReasonPhrase, every_status_of_an_error_code_has_one) {
  for (const ErrorCodeInfo& info : all_error_codes()) {
    EXPECT_NE(reason_phrase(info.http_status), "Status") << info.http_status;
  }
}

TEST(HttpDate, matches_the_example_of_the_standard) {
  EXPECT_EQ(http_date(784111777), "Sun, 06 Nov 1994 08:49:37 GMT");
  EXPECT_EQ(http_date(0), "Thu, 01 Jan 1970 00:00:00 GMT");
  EXPECT_EQ(http_date(1709210096), "Thu, 29 Feb 2024 12:34:56 GMT");
}

TEST(ContentDisposition, a_name_is_a_quoted_string_and_where_that_cannot_hold_it_encoded_too) {
  EXPECT_EQ(content_disposition("bunny.vox"), "inline; filename=\"bunny.vox\"");
  EXPECT_EQ(content_disposition("a b;c.vox"), "inline; filename=\"a b;c.vox\"");
  EXPECT_EQ(content_disposition("a\"; filename=\"b.exe"),
            "inline; filename=\"a\\\"; filename=\\\"b.exe\"");
  EXPECT_EQ(content_disposition("a\\"), "inline; filename=\"a\\\\\"");
  EXPECT_EQ(content_disposition("h\xc3\xa4 %.vox"),
            "inline; filename=\"h__ %.vox\"; filename*=UTF-8''h%C3%A4%20%25.vox");
  EXPECT_EQ(content_disposition("a\r\nb\x7f"), "inline; filename=\"a__b_\"");
  // No UTF-8: latin-1, an overlong slash, a surrogate, one that is cut off.
  for (const char* name : {"\xe4.vox", "\xc0\xaf", "\xed\xa0\x80", "a\xe2\x82"}) {
    EXPECT_EQ(content_disposition(name).find("filename*"), std::string::npos) << name;
  }
}

TEST(AddVary, names_each_header_once) {
  Response response;
  add_vary(response, "Accept");
  add_vary(response, "Origin");
  add_vary(response, "Accept");
  EXPECT_EQ(response.headers["Vary"], "Accept, Origin");
}

}  // namespace
}  // namespace voxeld::http
