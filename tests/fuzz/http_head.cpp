// The input is the head of a request. An accepted head must read the same when it is written again
// from its parts, as a proxy would do it; otherwise two readers could see two requests.
#include <string>
#include <string_view>

#include "server/base/check.h"
#include "server/http/file_response.h"
#include "server/http/message/head_parser.h"

namespace {

using namespace voxeld::http;

bool is_plain(std::string_view text) {
  for (const char c : text) {
    if ((static_cast<unsigned char>(c) < 0x20 && c != '\t') || c == 0x7f) return false;
  }
  return true;
}

std::string written(const Head& head) {
  std::string text =
      head.method + " " + head.target + " HTTP/1." + std::to_string(head.minor) + "\r\n";
  for (const auto& [name, value] : head.headers) text += name + ": " + value + "\r\n";
  return text + "\r\n";
}

void check_head(const Head& head) {
  VOXELD_CHECK(head.path.starts_with('/') || head.path == "*", "a path");
  VOXELD_CHECK(head.path.find_first_of(std::string_view("\0\t\r\n", 4)) == head.path.npos,
               "no controls in the path");
  for (const auto& [name, value] : head.query) {
    VOXELD_CHECK(is_plain(name) && is_plain(value), "no controls in the query");
  }
  for (const auto& [name, value] : head.headers) {
    VOXELD_CHECK(!name.empty() && name.find_first_of(" \t:") == name.npos, "a token");
    VOXELD_CHECK(is_plain(value), "no controls in a value");
  }
  VOXELD_CHECK(!(head.chunked && head.content_length), "one way of framing");
  VOXELD_CHECK(head.content_length.value_or(0) >= 0, "a length");
  VOXELD_CHECK(head.headers.size() <= kHeaderCountMax, "header limit");
  VOXELD_CHECK(head.target.size() <= kTargetBytesMax, "target limit");
  (void)head.keep_alive();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto head = parse_head(text);
  if (!head) {
    VOXELD_CHECK(!head.error().detail.empty(), "an error says what");
    VOXELD_CHECK(head.error().code == voxeld::ErrorCode::kBadRequest ||
                     head.error().code == voxeld::ErrorCode::kUnsupportedMedia,
                 "a broken head is the client's fault");
    return 0;
  }
  check_head(*head);
  const auto again = parse_head(written(*head));
  VOXELD_CHECK(again.ok(), "what was accepted is accepted again");
  VOXELD_CHECK(again->method == head->method && again->path == head->path &&
                   again->query == head->query && again->headers == head->headers &&
                   again->content_length == head->content_length &&
                   again->chunked == head->chunked && again->minor == head->minor,
               "it reads the same");

  // Conditions and ranges, which read header values: the response stays within the file.
  const auto response = file_response(*head, {"/f", 1000, 100}, "\"e\"");
  VOXELD_CHECK(response.ok(), "a response");
  if (const auto* file = std::get_if<FileBody>(&response->body)) {
    VOXELD_CHECK(file->offset >= 1000 && file->bytes > 0 && file->offset + file->bytes <= 1100,
                 "within the file");
    VOXELD_CHECK((response->status == 206) == (response->headers.count("Content-Range") == 1),
                 "a part says which");
  } else {
    VOXELD_CHECK(response->status == 304 || response->status == 416, "no bytes");
  }
  return 0;
}
