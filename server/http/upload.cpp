// Uploads: from the socket into the content-addressed store, never through memory as a whole.
#include <algorithm>
#include <array>
#include <utility>

#include "proto/asset_id.h"
#include "proto/bundle_manifest.h"
#include "proto/client_texts.h"
#include "proto/limits.h"
#include "server/base/stopwatch.h"
#include "server/http/api.h"
#include "server/http/body_reader.h"

namespace voxeld::http {
namespace {

// application/x-www-form-urlencoded is what curl --data-binary says when nobody tells it otherwise.
constexpr std::array<std::string_view, 9> kMediaTypes = {
    "application/octet-stream",  "application/zip",
    "application/json",          "application/x-www-form-urlencoded",
    "application/sla",           "text/plain",
    "application/x-ply",         "application/x-zip-compressed",
    "application/vnd.ms-pki.stl"};

Status check_media_type(std::string_view type) {
  if (type.empty() || type.starts_with("model/") || std::ranges::count(kMediaTypes, type) != 0) {
    return {};
  }
  const bool form = type.starts_with("multipart/");
  return Error{ErrorCode::kUnsupportedMedia, "Content-Type of the body",
               form ? "the file itself as the body: curl --data-binary @mesh.ply"
                    : "model/*, application/octet-stream, application/zip or none",
               "\"" + header_safe(type.substr(0, 80)) + "\""};
}

// A file of a bundle that is not there shall cost nothing: this is looked at before the manifest is
// stored, and once more when it is registered.
Status check_files(const Request& request, Api& api, const std::vector<BundleFile>& files) {
  for (const BundleFile& file : files) {
    auto asset = api.jobs.get_asset(request.caller, file.asset);
    if (asset) continue;
    Error error = std::move(asset).error();
    error.detail = "bundle file \"" + file.name + "\": " + error.detail;
    return error;
  }
  return {};
}

// Formats that media types name, as extensions.
constexpr std::array<std::pair<std::string_view, std::string_view>, 7> kTypeExtensions = {
    {{"model/gltf+json", ".gltf"},
     {"model/gltf-binary", ".glb"},
     {"model/obj", ".obj"},
     {"model/stl", ".stl"},
     {"application/sla", ".stl"},
     {"application/vnd.ms-pki.stl", ".stl"},
     {"application/x-ply", ".ply"}}};

// The name with the extension of the media type, where it says no format itself.
std::string name_with_format(std::string name, std::string_view type) {
  if (!reading_of(name).empty()) return name;
  const auto* found = std::ranges::find(kTypeExtensions, type,
                                        &std::pair<std::string_view, std::string_view>::first);
  if (found == kTypeExtensions.end()) return name;
  return (name.empty() ? "asset" : name) + std::string(found->second);
}

// What a manifest is called: it ends with kBundleExtension; unnamed ones are called after the first
// of their files.
std::string bundle_filename(std::string name, const std::vector<BundleFile>& files) {
  if (name.empty()) {
    const std::string& first = files.front().name;
    name = first.substr(first.find_last_of('/') + 1);
    name = name.substr(0, name.find_last_of('.'));
  }
  if (name.ends_with(kBundleExtension)) return name;
  const size_t stem_max = client_texts::kFilename.bytes_max - kBundleExtension.size();
  return name.substr(0, stem_max) + std::string(kBundleExtension);
}

// A manifest is small: it is read whole and stored once it is known to be right.
Status receive_bundle(Request& request, Api& api, Upload& upload) {
  const int64_t bytes_max = std::min(api.config.upload_bytes_max, limits::kJsonBodyBytesMax);
  VOXELD_ASSIGN(const std::string text, request.body->read_text(bytes_max));
  VOXELD_ASSIGN(upload.bundle_files, parse_bundle_manifest(text));
  VOXELD_TRY(check_files(request, api, upload.bundle_files));
  upload.filename = bundle_filename(std::move(upload.filename), upload.bundle_files);
  VOXELD_ASSIGN(BlobWriter writer, api.jobs.begin_upload(bytes_max));
  VOXELD_TRY(writer.append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
  VOXELD_ASSIGN(upload.blob, writer.finish());
  return {};
}

Status receive_file(Request& request, Api& api, Upload& upload) {
  const int64_t bytes_max = api.config.upload_bytes_max;
  // What is larger than any upload may be is told so, whoever asks.
  const bool is_plain = request.head.coding == ContentCoding::kNone;
  const int64_t asked = is_plain ? std::min(request.head.content_length.value_or(0), bytes_max) : 0;
  VOXELD_ASSIGN(const int64_t room, api.jobs.upload_room(request.caller, asked));
  VOXELD_ASSIGN(BlobWriter writer, api.jobs.begin_upload(std::min(bytes_max, room)));
  const auto store = [&](std::span<const uint8_t> piece) -> Status {
    const auto more = static_cast<int64_t>(piece.size());
    if (writer.bytes() + more <= room) return writer.append(piece);
    // Of a body whose length nobody told: as if it had been what has come of it.
    VOXELD_TRY(api.jobs.upload_room(request.caller, writer.bytes() + more));
    return writer.append(piece);
  };
  VOXELD_TRY(request.body->read(bytes_max, store));
  if (writer.bytes() == 0) {
    return Error{ErrorCode::kBadRequest, "the body is empty", "a mesh file", "0 bytes"};
  }
  VOXELD_ASSIGN(upload.blob, writer.finish());
  return {};
}

// filename="…" of a Content-Disposition, without folders.
std::string disposition_filename(std::string_view disposition) {
  const size_t at = disposition.find("filename=");
  if (at == std::string_view::npos) return "";
  std::string_view name = disposition.substr(at + 9);
  if (name.starts_with('"')) {
    name = name.substr(1, name.substr(1).find('"'));
  } else {
    name = name.substr(0, name.find(';'));
  }
  return std::string(name.substr(name.find_last_of("/\\") + 1));
}

}  // namespace

std::string requested_filename(const Request& request) {
  if (const auto name = request.query("filename")) return *name;
  return disposition_filename(request.head.header("Content-Disposition"));
}

Result<Upload> receive_upload(Request& request, Api& api) {
  const Stopwatch watch;
  Upload upload;
  upload.content_type = request.head.header("Content-Type");
  upload.filename = requested_filename(request);
  VOXELD_TRY(check_length(client_texts::kContentType, upload.content_type));
  VOXELD_TRY(check_filename(upload.filename));
  const std::string type = request.head.media_type();
  if (type == kBundleMediaType) {
    VOXELD_TRY(receive_bundle(request, api, upload));
  } else {
    VOXELD_TRY(check_media_type(type));
    upload.filename = name_with_format(std::move(upload.filename), type);
    VOXELD_TRY(receive_file(request, api, upload));
  }
  upload.ms = watch.ms();
  return upload;
}

Result<Asset> register_upload(const Request& request, Api& api, const Upload& upload) {
  if (upload.bundle_files.empty()) {
    return api.jobs.put_asset(request.caller, upload.blob, upload.filename, upload.content_type);
  }
  return api.jobs.put_bundle(request.caller, upload.blob, upload.filename, upload.bundle_files);
}

}  // namespace voxeld::http
