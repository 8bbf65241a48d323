#include "server/http/file_response.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"

namespace voxeld::http {
namespace {

struct Range {
  int64_t first = 0, last = 0;  // inclusive
};

// nullopt: no usable range, send the whole file. An error: a range that lies outside.
Result<std::optional<Range>> parse_range(std::string_view text, int64_t size) {
  if (!text.starts_with("bytes=") || text.find(',') != std::string_view::npos) {
    return std::optional<Range>();
  }
  text.remove_prefix(6);
  const size_t dash = text.find('-');
  if (dash == std::string_view::npos) return std::optional<Range>();
  const auto first = parse_digits<int64_t>(text.substr(0, dash)),
             last = parse_digits<int64_t>(text.substr(dash + 1));
  if (!last && dash + 1 < text.size()) return std::optional<Range>();
  const Error outside{ErrorCode::kRangeNotSatisfiable, "the range lies outside",
                      "a first byte below " + std::to_string(size), echoed(text)};
  if (!first) {  // the last N bytes
    if (!last || dash != 0) return std::optional<Range>();
    if (*last == 0 || size == 0) return outside;
    return std::optional(Range{std::max<int64_t>(0, size - *last), size - 1});
  }
  if (last && *last < *first) return std::optional<Range>();
  if (*first >= size) return outside;
  return std::optional(Range{*first, std::min(last.value_or(size - 1), size - 1)});
}

}  // namespace

bool etag_matches(std::string_view list, std::string_view etag) {
  while (!list.empty()) {
    std::string_view one = list.substr(0, list.find(','));
    list.remove_prefix(std::min(list.size(), one.size() + 1));
    while (one.starts_with(' ')) one.remove_prefix(1);
    while (one.ends_with(' ')) one.remove_suffix(1);
    if (one.starts_with("W/")) one.remove_prefix(2);
    if (one == "*" || one == etag) return true;
  }
  return false;
}

Result<Response> file_response(const Head& head, const FileBody& file, std::string_view etag) {
  Response response;
  response.headers["ETag"] = etag;
  response.headers["Accept-Ranges"] = "bytes";
  response.headers["Cache-Control"] = "private, max-age=31536000, immutable";
  response.body = file;
  // RFC 9110, 13.2.1 and 14.2: conditions and ranges of other methods are not about this file.
  if (head.method != "GET" && head.method != "HEAD") return response;
  const std::string_view if_none_match = head.header("If-None-Match");
  if (!if_none_match.empty() && etag_matches(if_none_match, etag)) {
    response.status = 304;
    response.body = std::string();
    return response;
  }
  const std::string_view range_text = head.header("Range"), if_range = head.header("If-Range");
  if (range_text.empty() || (!if_range.empty() && if_range != etag)) return response;
  if (head.method == "HEAD") return response;  // RFC 9110 section 14.2
  auto range = parse_range(range_text, file.bytes);
  if (!range) {
    Response refused = Response::problem(range.error(), head.path);
    refused.headers["Content-Range"] = "bytes */" + std::to_string(file.bytes);
    return refused;
  }
  if (!*range) return response;
  const auto [first, last] = **range;
  response.status = 206;
  response.headers["Content-Range"] = "bytes " + std::to_string(first) + "-" +
                                      std::to_string(last) + "/" + std::to_string(file.bytes);
  response.body = FileBody{file.path, file.offset + first, last - first + 1};
  return response;
}

}  // namespace voxeld::http
