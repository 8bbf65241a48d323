#include "server/http/message/head_parser.h"

#include <algorithm>
#include <string>

#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"

namespace voxeld::http {
namespace {

Error bad(std::string detail, std::string expected = "", std::string got = "") {
  return {ErrorCode::kBadRequest, std::move(detail), std::move(expected), std::move(got)};
}

bool is_token_char(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
         std::string_view("!#$%&'*+-.^_`|~").find(c) != std::string_view::npos;
}

bool is_token(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, is_token_char);
}

bool has_control(std::string_view text) {
  return std::ranges::any_of(text, [](char c) {
    return (static_cast<unsigned char>(c) < 0x20 && c != '\t') || c == 0x7f;
  });
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

Status parse_query(std::string_view text, OptionPairs& query) {
  while (!text.empty()) {
    const std::string_view pair = text.substr(0, text.find('&'));
    text.remove_prefix(std::min(text.size(), pair.size() + 1));
    if (pair.empty()) continue;
    const size_t equals = pair.find('=');
    VOXELD_ASSIGN(std::string name, percent_decode(pair.substr(0, equals), true, false));
    std::string value;
    if (equals != std::string_view::npos) {
      VOXELD_ASSIGN(value, percent_decode(pair.substr(equals + 1), true, false));
    }
    query.emplace_back(std::move(name), std::move(value));
  }
  return {};
}

Status parse_target(Head& head) {
  std::string_view target = head.target;
  if (target.size() > kTargetBytesMax) {
    return bad("request target is too long",
               "at most " + std::to_string(kTargetBytesMax) + " bytes",
               std::to_string(target.size()));
  }
  if (target.starts_with("http://")) {  // absolute form, as proxies send it
    const size_t slash = target.find_first_of("/?", 7);
    const auto authority = parse_authority(target.substr(7, slash - 7));
    if (!authority || authority->host.empty()) {
      return bad("host of the request target", "HOST or HOST:PORT", "something else");
    }
    head.authority = *authority;
    target = slash == std::string_view::npos ? "/" : target.substr(slash);
  }
  if (!target.starts_with('/') && !(target == "*" && head.method == "OPTIONS")) {
    return bad("request target", "a path that begins with /", "another form");
  }
  const size_t question = target.find('?');
  VOXELD_ASSIGN(head.path, percent_decode(target.substr(0, question), false, true));
  if (question == std::string_view::npos) return {};
  return parse_query(target.substr(question + 1), head.query);
}

Status parse_request_line(std::string_view line, Head& head) {
  const size_t first = line.find(' '), last = line.rfind(' ');
  if (first == std::string_view::npos || last == first) {
    return bad("request line", "METHOD TARGET HTTP/1.1", "something else");
  }
  head.method = line.substr(0, first);
  head.target = line.substr(first + 1, last - first - 1);
  const std::string_view version = line.substr(last + 1);
  if (!is_token(head.method) || head.method.size() > 20) return bad("request method is no token");
  if (head.target.empty() || head.target.find(' ') != std::string::npos) {
    return bad("request target has a space in it");
  }
  if (version != "HTTP/1.1" && version != "HTTP/1.0") {
    return bad("protocol version", "HTTP/1.1 or HTTP/1.0", "another");
  }
  head.minor = version.back() - '0';
  return parse_target(head);
}

Status add_header(std::string_view line, Head& head) {
  if (line.front() == ' ' || line.front() == '\t') return bad("folded header line");
  const size_t colon = line.find(':');
  if (colon == std::string_view::npos || !is_token(line.substr(0, colon))) {
    return bad("header line", "Name: value", "no valid name before a colon");
  }
  const std::string name(line.substr(0, colon));
  const std::string_view value = trimmed(line.substr(colon + 1));
  const auto [it, added] = head.headers.try_emplace(name, value);
  if (added) return {};
  static const LessNoCase less;
  for (const std::string_view once : {"Host", "Content-Length", "Transfer-Encoding", "Content-Type",
                                      "Range", "Content-Encoding"}) {
    if (!less(name, once) && !less(once, name)) return bad("header " + name + " stands twice");
  }
  // An empty line adds no element to the list (RFC 9110 section 5.6.1).
  if (!it->second.empty() && !value.empty()) it->second += ", ";
  it->second += value;
  return {};
}

// A target in absolute form has said which host is meant (RFC 9112 section 3.2.2).
Status check_host(Head& head) {
  const auto host = head.headers.find("Host");
  if (host == head.headers.end()) {
    if (head.minor == 1) return bad("header Host is missing");
    return {};
  }
  const auto authority = parse_authority(host->second);
  if (!authority) {
    return bad("header Host", "HOST or HOST:PORT", echoed(host->second));
  }
  if (head.authority.host.empty()) head.authority = *authority;
  return {};
}

Status check_framing(Head& head) {
  const bool has_length = head.headers.count("Content-Length") != 0;
  const bool has_coding = head.headers.count("Transfer-Encoding") != 0;
  if (has_length && has_coding) return bad("both Content-Length and Transfer-Encoding");
  if (has_length) {
    const std::string_view text = head.header("Content-Length");
    head.content_length = parse_digits<int64_t>(text);
    if (!head.content_length) {
      return bad("Content-Length", "a number of bytes", echoed(text));
    }
  }
  if (has_coding) {
    std::string coding(head.header("Transfer-Encoding"));
    std::ranges::transform(coding, coding.begin(), [](char c) {
      return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
    });
    if (coding != "chunked" || head.minor == 0) {
      return bad("Transfer-Encoding", "chunked", echoed(coding));
    }
    head.chunked = true;
  }
  VOXELD_ASSIGN(head.coding, parse_content_coding(head.header("Content-Encoding")));
  return {};
}

}  // namespace

Result<std::string> percent_decode(std::string_view text, bool plus_is_space, bool keep_slash) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '+' && plus_is_space) {
      c = ' ';
    } else if (c == '%') {
      const int high = i + 2 < text.size() ? hex_digit(text[i + 1]) : -1;
      const int low = i + 2 < text.size() ? hex_digit(text[i + 2]) : -1;
      if (high < 0 || low < 0) return bad("broken percent-encoding in the request target");
      c = static_cast<char>(high * 16 + low);
      if (c == '/' && keep_slash) {
        out += "%2f";
        i += 2;
        continue;
      }
      i += 2;
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      return bad("control character in the request target");
    }
    out += c;
  }
  return out;
}

Result<Head> parse_head(std::string_view text) {
  Head head;
  bool is_first = true;
  size_t count = 0;
  while (true) {
    const size_t end = text.find("\r\n");
    if (end == std::string_view::npos) return bad("the head of the request is cut off");
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 2);
    if (line.empty()) break;
    if (has_control(line)) return bad("control character or bare line feed in the head");
    if (is_first) {
      VOXELD_TRY(parse_request_line(line, head));
      is_first = false;
      continue;
    }
    if (++count > kHeaderCountMax) {
      return bad("too many header lines", "at most " + std::to_string(kHeaderCountMax), "more");
    }
    VOXELD_TRY(add_header(line, head));
  }
  if (is_first) return bad("the request line is missing");
  VOXELD_TRY(check_host(head));
  VOXELD_TRY(check_framing(head));
  return head;
}

std::optional<Result<Head>> take_head(std::string& buffer, size_t& scanned) {
  const size_t end = buffer.find("\r\n\r\n", scanned);
  if (end != std::string::npos && end + 4 <= kHeadBytesMax) {
    auto head = parse_head(std::string_view(buffer).substr(0, end + 4));
    buffer.erase(0, end + 4);
    scanned = 0;
    return head;
  }
  if (buffer.size() > kHeadBytesMax) {
    return Error{ErrorCode::kBadRequest, "the head of the request is too long",
                 "at most " + std::to_string(kHeadBytesMax) + " bytes", ""};
  }
  if (buffer.find("\n\n", scanned) != std::string::npos) {
    return Error{ErrorCode::kBadRequest, "bare line feed in the head of the request",
                 "lines that end in CRLF", ""};
  }
  scanned = buffer.size() < 3 ? 0 : buffer.size() - 3;
  return std::nullopt;
}

}  // namespace voxeld::http
