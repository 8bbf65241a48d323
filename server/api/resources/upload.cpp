#include "server/api/resources/upload.h"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "proto/asset_id.h"
#include "proto/limits.h"
#include "proto/messages/bundle_manifest.h"
#include "proto/text/client_texts.h"
#include "server/base/clock.h"

namespace voxeld::api {
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

// Called before the manifest is stored, so that a missing file costs nothing, and once more when
// the bundle is registered.
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

// The name with the extension of the media type, unless it names a format itself.
std::string name_with_format(std::string name, std::string_view type) {
  if (!reading_of(name).empty()) return name;
  const auto* found = std::ranges::find(kTypeExtensions, type,
                                        &std::pair<std::string_view, std::string_view>::first);
  if (found == kTypeExtensions.end()) return name;
  const size_t stem_max = client_texts::kFilename.bytes_max - found->second.size();
  return (name.empty() ? "asset" : name.substr(0, stem_max)) + std::string(found->second);
}

// The name of a manifest, with kBundleExtension; an unnamed one is named after its first file.
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

// The file name that the request gives: `filename=`, else Content-Disposition, else empty.
std::string requested_filename(const Request& request) {
  if (const auto name = request.query("filename")) return *name;
  return disposition_filename(request.head.header("Content-Disposition"));
}

using Then = std::function<Reply(Request&, Upload)>;

// The facts of an upload that come before its body.
struct Announced {
  std::string filename, content_type;
  Durability durability = Durability::kNow;
  Stopwatch watch;
  WaitPlace place;
  WaitPlace zstd_place;  // null: it is not zstd
};

// Responds to a body that was received and registered.
Reply registered(Request& request, Announced announced, const Result<Asset>& asset,
                 const Then& then) {
  if (!asset) return problem(request, asset.error());
  return then(request, Upload{*asset, std::move(announced.filename), announced.watch.ms(),
                              std::move(announced.place)});
}

// Stores a manifest. It is small, so that it is checked before anything is stored.
Result<Asset> put_bundle(const Request& request, Api& api, Announced& announced,
                         const std::string& text) {
  VOXELD_ASSIGN(const std::vector<BundleFile> files, parse_bundle_manifest(text));
  VOXELD_TRY(check_files(request, api, files));
  announced.filename = bundle_filename(std::move(announced.filename), files);
  VOXELD_ASSIGN(BlobWriter writer,
                api.jobs.begin_upload(static_cast<int64_t>(text.size()), announced.durability));
  VOXELD_TRY(writer.append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
  VOXELD_ASSIGN(const BlobInfo blob, writer.finish());
  return api.jobs.put_bundle(request.caller, blob, announced.filename, files, announced.durability);
}

Reply receive_bundle(const Request& request, Api& api, Announced announced, Then then) {
  const int64_t bytes_max = std::min(request.body_bytes_max, limits::kJsonBodyBytesMax);
  auto shared = std::make_shared<Announced>(std::move(announced));
  return TextBody{bytes_max,
                  [&api, shared, then = std::move(then)](Request& asking, const std::string& text) {
                    const auto asset = put_bundle(asking, api, *shared, text);
                    return registered(asking, std::move(*shared), asset, then);
                  }};
}

// Bytes that the tenant's uploads may have brought at a time; 0: any. One alone may fill its room.
int64_t unfinished_bytes_max(Api& api, const Caller& caller, int64_t room) {
  const int64_t quota = api.jobs.limits(caller).bytes;
  return quota == 0 ? 0 : std::max(quota, room);
}

// Writes a file into the store.
class FileSink final : public BodySink {
 public:
  // `room`: bytes that the caller's quota has left.
  FileSink(Api& api, Caller caller, Announced announced, BlobWriter writer, int64_t room, Then then)
      : api_(api),
        caller_(std::move(caller)),
        announced_(std::move(announced)),
        held_(api.upload_bytes, caller_.tenant(), unfinished_bytes_max(api, caller_, room)),
        writer_(std::move(writer)),
        room_(room),
        then_(std::move(then)) {}

  Status take(std::span<const uint8_t> piece) override {
    const auto more = static_cast<int64_t>(piece.size());
    // A body of unknown length fails as if it had been announced with what has come of it.
    if (writer_.bytes() + more > room_) {
      VOXELD_TRY(api_.jobs.upload_room(caller_, writer_.bytes() + more));
    }
    VOXELD_TRY(held_.add(more));
    return writer_.append(piece);
  }

  Reply finish(Request& request) override {
    const Result<Asset> asset = store();  // before what it reads is moved
    return registered(request, std::move(announced_), asset, then_);
  }

 private:
  Result<Asset> store() {
    if (writer_.bytes() == 0) {
      return Error{ErrorCode::kMalformedMesh, "the body is empty", "a mesh file", "0 bytes"};
    }
    VOXELD_ASSIGN(const BlobInfo blob, writer_.finish());
    return api_.jobs.put_asset(caller_, blob, announced_.filename, announced_.content_type,
                               announced_.durability);
  }

  Api& api_;
  const Caller caller_;
  Announced announced_;
  UploadBytes::Share held_;  // until the file is gone or registered
  BlobWriter writer_;
  const int64_t room_;
  const Then then_;
};

Result<Reply> receive_file(const Request& request, Api& api, Announced announced, Then then) {
  const int64_t bytes_max = request.body_bytes_max;
  // A body over the limit of all uploads is refused as that, whatever the caller's quota.
  const bool is_plain = request.head.coding == http::ContentCoding::kNone;
  const int64_t asked = is_plain ? std::min(request.head.content_length.value_or(0), bytes_max) : 0;
  VOXELD_ASSIGN(const int64_t room, api.jobs.upload_room(request.caller, asked));
  VOXELD_ASSIGN(BlobWriter writer,
                api.jobs.begin_upload(std::min(bytes_max, room), announced.durability));
  return Reply(StreamedBody{bytes_max,
                            std::make_unique<FileSink>(api, request.caller, std::move(announced),
                                                       std::move(writer), room, std::move(then))});
}

Result<Reply> receive(Request& request, Api& api, Durability durability, Then then) {
  Announced announced;
  announced.durability = durability;
  announced.content_type = request.head.header("Content-Type");
  announced.filename = requested_filename(request);
  VOXELD_TRY(check_length(client_texts::kContentType, announced.content_type));
  VOXELD_TRY(check_filename(announced.filename));
  const std::string type = request.head.media_type();
  if (type != kBundleMediaType) {
    VOXELD_TRY(check_media_type(type));
  }
  VOXELD_ASSIGN(announced.place, api.waits.take(request.caller.tenant()));
  if (request.head.coding == http::ContentCoding::kZstd) {
    VOXELD_ASSIGN(announced.zstd_place, api.zstd_uploads.take(request.caller.tenant()));
  }
  if (type == kBundleMediaType)
    return receive_bundle(request, api, std::move(announced), std::move(then));
  announced.filename = name_with_format(std::move(announced.filename), type);
  return receive_file(request, api, std::move(announced), std::move(then));
}

}  // namespace

Reply receive_upload(Request& request, Api& api, Durability durability,
                     std::function<Reply(Request&, Upload)> then) {
  auto reply = receive(request, api, durability, std::move(then));
  if (!reply) return problem(request, reply.error());
  return *std::move(reply);
}

}  // namespace voxeld::api
