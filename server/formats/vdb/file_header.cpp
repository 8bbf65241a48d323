#include "server/formats/vdb/file_header.h"

#include <array>

#include "server/base/sha256.h"
#include "server/formats/vdb/named_grids.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::vdb {
namespace {

constexpr int64_t kVdbMagic = 0x56444220;
constexpr uint32_t kVdbFileVersion = 224, kVdbMajor = 10, kVdbMinor = 0;

// The hash as a UUID of version 8, whose bits are free (RFC 9562, 5.8).
std::string uuid_of(const Grid& grid) {
  Sha256 hash;
  hash.update(grid.meta.text());
  hash.update(bytes_of(grid.spec.dims));
  hash.update(bytes_of(grid.spec.origin_world));
  hash.update(bytes_of(grid.spec.voxel_size));
  hash.update(bytes_of(channel_bits(grid.channels)));
  for (const SparseTile& tile : grid.tiles) {
    hash.update(bytes_of(tile.coord));
    hash.update(bytes_of(static_cast<uint64_t>(tile.voxel_count())));
  }
  constexpr size_t kDigits = 32, kVersionDigit = 12, kVariantDigit = 16;
  const std::string id = hash.finish_id();
  const std::string digits = id.substr(id.find('-') + 1, kDigits);
  std::string uuid;
  for (size_t i = 0; i < digits.size(); ++i) {
    if (i == 8 || i == 12 || i == 16 || i == 20) uuid += '-';
    uuid += i == kVersionDigit ? '8' : i == kVariantDigit ? 'a' : digits[i];
  }
  return uuid;
}

}  // namespace

MetaValue text_meta(std::string_view text) {
  return {"string", Bytes(text.begin(), text.end())};
}
MetaValue bool_meta(bool value) {
  return {"bool", {static_cast<uint8_t>(value ? 1 : 0)}};
}
MetaValue count_meta(uint64_t count) {
  MetaValue meta{"int64", {}};
  put(meta.value, static_cast<int64_t>(count));
  return meta;
}
MetaValue cell_meta(const Cell& cell) {
  MetaValue meta{"vec3i", {}};
  put(meta.value, cell);
  return meta;
}

void put_meta(Bytes& out, const MetaMap& meta) {
  put(out, static_cast<uint32_t>(meta.size()));
  for (const auto& [name, entry] : meta) {
    put_text(out, name);
    put_text(out, entry.type);
    put(out, static_cast<uint32_t>(entry.value.size()));
    out.insert(out.end(), entry.value.begin(), entry.value.end());
  }
}

void put_transform(Bytes& out, const GridSpec& spec) {
  const bool is_cubic = volume::is_cubic(spec);
  const glm::dvec3 scale = voxel_sides(spec);
  put_text(out, is_cubic ? "UniformScaleTranslateMap" : "ScaleTranslateMap");
  put(out, volume::first_center(spec));
  put(out, scale);
  put(out, scale);  // voxel size
  put(out, 1.0 / scale);
  put(out, 1.0 / (scale * scale));
  put(out, 0.5 / scale);
}

Bytes file_header(const Grid& grid, uint32_t grids) {
  Bytes out;
  put(out, kVdbMagic);
  put(out, kVdbFileVersion);
  put(out, kVdbMajor);
  put(out, kVdbMinor);
  put(out, uint8_t{1});
  const std::string uuid = uuid_of(grid);
  out.insert(out.end(), uuid.begin(), uuid.end());
  const glm::ivec3 dims = grid.spec.dims;
  MetaMap meta = {{"creator", text_meta("voxeld")},
                  {"dims", cell_meta({dims.x, dims.y, dims.z})},
                  {"meta", text_meta(grid.meta.text())}};
  if (const std::string units = volume::units_of(grid); !units.empty()) {
    meta["units"] = text_meta(units);
  }
  put_meta(out, meta);
  put(out, grids);
  return out;
}

}  // namespace voxeld::vdb
