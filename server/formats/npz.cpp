// Writes NumPy's .npz: a zip of deflated .npy members. Dates are fixed, so equal grids give equal
// bytes.
#include <zip.h>

#include <array>
#include <memory>
#include <string>

#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/npy_array.h"

namespace voxeld {
namespace {

// 1980-01-01, the earliest date of a zip.
constexpr zip_uint16_t kDosDate = 0x21;
constexpr zip_uint32_t kDeflateLevel = 1;  // voxels are runs: more effort gains little

struct Member {
  std::string name;
  std::vector<uint8_t> bytes;
};

struct CloseSource {
  void operator()(zip_source_t* source) const { zip_source_free(source); }
};

Error failed(const std::string& what, const char* why) {
  return {ErrorCode::kInternal, "npz: " + what + ": " + why, "", ""};
}

Status add_members(zip_t* archive, const std::vector<Member>& members) {
  for (const Member& member : members) {
    zip_source_t* source = zip_source_buffer(archive, member.bytes.data(), member.bytes.size(), 0);
    if (source == nullptr) return failed(member.name, zip_strerror(archive));
    const zip_int64_t index =
        zip_file_add(archive, member.name.c_str(), source, ZIP_FL_ENC_UTF_8 | ZIP_FL_OVERWRITE);
    if (index < 0) {
      zip_source_free(source);
      return failed(member.name, zip_strerror(archive));
    }
    const auto i = static_cast<zip_uint64_t>(index);
    zip_set_file_compression(archive, i, ZIP_CM_DEFLATE, kDeflateLevel);
    zip_file_set_dostime(archive, i, 0, kDosDate, 0);
  }
  return {};
}

Result<std::vector<uint8_t>> read_source(zip_source_t* source) {
  zip_stat_t stat;
  if (zip_source_open(source) != 0 || zip_source_stat(source, &stat) != 0) {
    return failed("archive", zip_error_strerror(zip_source_error(source)));
  }
  std::vector<uint8_t> bytes(stat.size);
  const zip_int64_t got = zip_source_read(source, bytes.data(), bytes.size());
  zip_source_close(source);
  if (got != static_cast<zip_int64_t>(bytes.size())) return failed("archive", "short read");
  return bytes;
}

Result<std::vector<uint8_t>> zip_members(const std::vector<Member>& members) {
  zip_error_t error;
  zip_error_init(&error);
  const std::unique_ptr<zip_source_t, CloseSource> target(
      zip_source_buffer_create(nullptr, 0, 0, &error));
  if (target == nullptr) return failed("archive", zip_error_strerror(&error));
  zip_source_keep(target.get());  // zip_close releases its own reference
  zip_t* archive = zip_open_from_source(target.get(), ZIP_TRUNCATE, &error);
  if (archive == nullptr) {
    zip_source_free(target.get());
    return failed("archive", zip_error_strerror(&error));
  }
  if (Status status = add_members(archive, members); !status) {
    zip_discard(archive);
    return status.error();
  }
  // libzip calls this after each deflated piece.
  const auto cancelled = [](zip_t*, void*) { return is_cancelled() ? 1 : 0; };
  zip_register_cancel_callback_with_state(archive, cancelled, nullptr, nullptr);
  if (zip_close(archive) != 0) {
    Error why = failed("archive", zip_strerror(archive));
    zip_discard(archive);
    cancel_point();
    return why;
  }
  return read_source(target.get());
}

}  // namespace

Result<std::vector<uint8_t>> encode_npz(const Grid& grid, const OutputOptions& options) {
  const GridHeader header = container_header(grid);
  std::vector<Member> members;
  members.push_back({"occupancy.npy", npy_occupancy(grid, options)});
  if (grid.channels.color) members.push_back({"color.npy", npy_color(grid, options)});
  if (grid.channels.normal) members.push_back({"normal.npy", npy_normal(grid, options)});
  const ChannelSet& channels = grid.channels;
  for (const Channel ids : {Channel::kMaterial, Channel::kLabel}) {
    if (!channels.has(ids)) continue;
    members.push_back({std::string(channel_info(ids).name) + ".npy", npy_ids(grid, ids, options)});
  }
  if (channels.distance) members.push_back({"distance.npy", npy_distance(grid, options)});
  if (channels.coverage) members.push_back({"coverage.npy", npy_coverage(grid, options)});
  members.push_back({"origin.npy", npy_doubles(header.origin)});
  members.push_back({"voxel_size.npy", npy_doubles(header.voxel_size)});
  members.push_back({"meta.npy", npy_text(grid.meta_json)});
  return zip_members(members);
}

}  // namespace voxeld
