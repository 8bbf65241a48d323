// The page for browsers: its document at "/" and "/admin", and the files that the document names
// under /web/.
#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>
#include <string>
#include <utility>

#include "proto/text/client_texts.h"
#include "server/api/accept.h"
#include "server/api/resources/resources.h"
#include "server/api/web_files.h"
#include "server/base/disk/file.h"
#include "server/base/sha256.h"
#include "server/http/file_response.h"
#include "server/http/message/content_coding.h"

namespace voxeld::api {
namespace {

// The page loads nothing from other hosts, has no inline script and is in no frame. Pictures of
// grids are blobs.
constexpr std::string_view kContentSecurityPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

// A file of the page as the response to one request.
struct WebContent {
  std::string bytes;
  std::string media_type, etag;
  bool is_gzip = false;
};

std::string_view media_type_of(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 4> kTypes = {
      {{".html", "text/html; charset=utf-8"},
       {".js", "text/javascript; charset=utf-8"},
       {".css", "text/css; charset=utf-8"},
       {".map", "application/json"}}};
  const auto known =
      std::ranges::find_if(kTypes, [&](const auto& type) { return name.ends_with(type.first); });
  return known == kTypes.end() ? "application/octet-stream" : known->second;
}

// A plain name: no separators, and no dot at its begin.
bool is_file_name(std::string_view name) {
  constexpr std::string_view kAllowed =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
  return !name.empty() && name.front() != '.' && name.find_first_not_of(kAllowed) == name.npos;
}

Error no_such_file(std::string_view name) {
  return {ErrorCode::kNotFound, "the page has no such file", "a name of its document",
          echoed(name)};
}

// `--web-dir`: read anew for each request, so that a change shows at once.
Result<WebContent> read_content(const std::filesystem::path& dir, std::string_view name) {
  if (!is_file_name(name)) return no_such_file(name);
  const std::filesystem::path path = dir / name;
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return no_such_file(name);
  VOXELD_ASSIGN(const std::vector<uint8_t> bytes, read_file(path));
  Sha256 hash;
  hash.update(bytes);
  WebContent content;
  content.bytes.assign(bytes.begin(), bytes.end());
  content.media_type = media_type_of(name);
  content.etag = "\"" + hash.finish_id() + "\"";
  return content;
}

Result<std::string> inflated(const WebFile& file) {
  std::string plain;
  const auto decoder = http::make_content_decoder(http::ContentCoding::kGzip, file.plain_bytes);
  VOXELD_TRY(decoder->feed(file.gzip, [&](std::span<const uint8_t> piece) -> Status {
    plain.append(piece.begin(), piece.end());
    return {};
  }));
  VOXELD_TRY(decoder->finish());
  return plain;
}

Result<WebContent> embedded_content(std::string_view name, bool takes_gzip) {
  const auto files = web_files();
  const auto file = std::ranges::find(files, name, &WebFile::name);
  if (file == files.end()) return no_such_file(name);
  WebContent content;
  content.media_type = file->media_type;
  content.is_gzip = takes_gzip;
  // Each coding is a representation of its own (RFC 9110, section 8.8.3).
  content.etag = "\"" + std::string(file->hash) + (takes_gzip ? "-gzip\"" : "\"");
  if (takes_gzip) {
    content.bytes.assign(file->gzip.begin(), file->gzip.end());
  } else {
    VOXELD_ASSIGN(content.bytes, inflated(*file));
  }
  return content;
}

Result<WebContent> content_of(const Request& request, const Api& api, std::string_view name) {
  if (!api.web_dir.empty()) return read_content(api.web_dir, name);
  return embedded_content(name, accepts_gzip(request.head.header("Accept-Encoding")));
}

PieceBody pieces_of(std::string text) {
  return PieceBody{[text = std::move(text), sent = size_t{0}]() mutable {
    Piece piece{text.substr(sent, static_cast<size_t>(kPieceBytesMax)), false};
    sent += piece.text.size();
    piece.is_last = sent == text.size();
    return piece;
  }};
}

Response web_response(const Request& request, WebContent content) {
  Response response;
  response.headers["ETag"] = content.etag;
  add_vary(response, "Accept-Encoding");
  if (http::etag_matches(request.head.header("If-None-Match"), content.etag)) {
    response.status = 304;
    return response;
  }
  response.headers["Content-Type"] = content.media_type;
  if (content.is_gzip) response.headers["Content-Encoding"] = "gzip";
  response.body = pieces_of(std::move(content.bytes));
  return response;
}

}  // namespace

bool has_page(const Api& api) {
  return !api.web_dir.empty() || !web_files().empty();
}

Reply get_page(Request& request, Api& api) {
  auto content = content_of(request, api, kPageName);
  if (!content) return problem(request, content.error());
  Response response = web_response(request, *std::move(content));
  response.headers["Cache-Control"] = "no-cache";
  response.headers["Content-Security-Policy"] = kContentSecurityPolicy;
  response.headers["Referrer-Policy"] = "no-referrer";
  response.headers["Cross-Origin-Opener-Policy"] = "same-origin";
  return response;
}

Reply get_web_file(Request& request, Api& api) {
  const std::string& name = request.path_parameters[0];
  auto content = content_of(request, api, name);
  if (!content) return problem(request, content.error());
  Response response = web_response(request, *std::move(content));
  response.headers["Cache-Control"] =
      api.web_dir.empty() ? "public, max-age=31536000, immutable" : "no-cache";
  // The worker is a script with a policy of its own.
  response.headers["Content-Security-Policy"] = kContentSecurityPolicy;
  response.headers["Cross-Origin-Resource-Policy"] = "same-origin";
  return response;
}

}  // namespace voxeld::api
