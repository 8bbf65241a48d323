// Writes PCL's .pcd, version 0.7, binary: lines of text, then a record for each voxel in the order
// of sparse arrays (Morton), little-endian and without gaps.
//
//   x y z           F 4, or F 8 where floats are too coarse: the centre in world units
//   rgb             F 4: the bits of 0x00RRGGBB, sRGB
//   normal_x _y _z  F 4: unit normal
//   material label  U 4: id, 0: none
//   distance        F 4: in world units; in voxels if those are no cubes, unless distance=world
//   coverage        F 4: 0..1
//
// The fields of channels are there if the grid has them. Voxels inside of solids have the mean
// colour; those of full nodes also the largest distance inside, coverage 1 and otherwise zeros.
// Comments hold dims, origin, voxel_size, units and transform.
#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "server/formats/formats.h"
#include "server/formats/mesh/voxel_colors.h"
#include "server/formats/mesh/world_vertices.h"
#include "server/formats/npy/array_pieces.h"
#include "server/formats/npy/sample_writers.h"
#include "server/formats/output_file.h"
#include "server/formats/points/voxel_points.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::points {
namespace {

constexpr size_t kFieldBytes = 4;  // of all but coordinates

struct PcdField {
  std::string name;
  size_t bytes;
  char type;
};

std::vector<PcdField> pcd_fields(const Grid& grid, bool is_float) {
  std::vector<PcdField> fields;
  for (const char* name : {"x", "y", "z"}) {
    fields.push_back({name, is_float ? sizeof(float) : sizeof(double), 'F'});
  }
  for (const ChannelInfo& info : kChannels) {
    if (!grid.channels.has(info.channel)) continue;
    switch (info.kind) {
      case ChannelKind::kColor:
        fields.push_back({"rgb", kFieldBytes, 'F'});
        break;
      case ChannelKind::kVector:
        for (const char* name : {"normal_x", "normal_y", "normal_z"}) {
          fields.push_back({name, kFieldBytes, 'F'});
        }
        break;
      default:
        fields.push_back({std::string(info.name), kFieldBytes, info.is_id() ? 'U' : 'F'});
    }
  }
  return fields;
}

std::string pcd_header(const Grid& grid, const std::vector<PcdField>& fields, uint64_t points) {
  std::string text = "# .PCD v0.7 - Point Cloud Data file format\n# voxeld\n";
  for (const std::string& line : mesh::placement_lines(grid)) text += "# " + line + "\n";
  std::string names, sizes, types, counts;
  for (const PcdField& field : fields) {
    names += " " + field.name;
    sizes += " " + std::to_string(field.bytes);
    types += std::string(" ") + field.type;
    counts += " 1";
  }
  text += "VERSION 0.7\nFIELDS" + names + "\nSIZE" + sizes + "\nTYPE" + types + "\nCOUNT" + counts;
  const std::string number = std::to_string(points);
  return text + "\nWIDTH " + number + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + number +
         "\nDATA binary\n";
}

class PcdRecords : public ArrayPieces {
 public:
  PcdRecords(const VoxelPieces& voxels, size_t record_bytes, bool is_float)
      : voxels_(voxels),
        grid_(voxels.grid()),
        record_bytes_(record_bytes),
        is_float_(is_float),
        mean_(rgb(mean_color(grid_))),
        distance_scale_(volume::stored_distance_scale(grid_)) {
    if (grid_.channels.distance) deepest_ = -farthest(grid_, &SparseTile::distance);
  }

  size_t piece_count() const override { return voxels_.count(); }
  uint64_t piece_begin(size_t piece) const override { return voxels_.begin(piece) * record_bytes_; }
  void fill(size_t piece, std::span<uint8_t> bytes) const override {
    uint8_t* out = bytes.data();
    for_each_point(voxels_, piece,
                   [&](const SparseTile& tile, const std::array<int32_t, 3>& cell,
                       size_t attribute) { out = put_record(out, tile, cell, attribute); });
  }
  Repeats repeats() const override { return Repeats::anywhere(); }

 private:
  template <typename T>
  static uint8_t* put_field(uint8_t* out, T value) {
    put(out, value);
    return out + sizeof value;
  }
  template <typename Bytes>
  static uint32_t rgb(const Bytes& color) {
    return uint32_t{color[0]} << 16 | uint32_t{color[1]} << 8 | uint32_t{color[2]};
  }

  uint8_t* put_record(uint8_t* out, const SparseTile& tile, const std::array<int32_t, 3>& cell,
                      size_t attribute) const {
    const glm::dvec3 center =
        grid_.spec.world_from_grid(glm::dvec3(cell[0], cell[1], cell[2]) + 0.5);
    for (const double p : {center.x, center.y, center.z}) {
      out = is_float_ ? put_field(out, static_cast<float>(p)) : put_field(out, p);
    }
    for_each_channel_member([&](auto which, auto member) {
      if (!grid_.channels.has(which)) return;
      constexpr const ChannelInfo& kInfo = channel_info(which);
      const bool is_inner = attribute == kNoAttributes ||
                            (kInfo.kind == ChannelKind::kColor && !has_own_color(tile, attribute));
      if (is_inner) {
        out = put_inner<kInfo.kind>(out);
      } else {
        out = put_samples<kInfo.kind>(out, &(tile.*member)[kInfo.components * attribute]);
      }
    });
    return out;
  }

  template <ChannelKind kind, typename Stored>
  uint8_t* put_samples(uint8_t* out, const Stored* stored) const {
    if constexpr (kind == ChannelKind::kColor) {
      return put_field(out, rgb(stored));
    } else if constexpr (kind == ChannelKind::kVector) {
      for (size_t c = 0; c < 3; ++c) {
        out = put_field(out, static_cast<float>(stored[c]) / INT8_MAX);
      }
      return out;
    } else if constexpr (kind == ChannelKind::kId) {
      return put_field(out, uint32_t{*stored});
    } else if constexpr (kind == ChannelKind::kDistance) {
      return put_distance(out, static_cast<float>(*stored) / kDistanceSteps);
    } else {
      return put_field(out, static_cast<float>(*stored) / UINT8_MAX);
    }
  }

  // The sample of a voxel inside of a solid.
  template <ChannelKind kind>
  uint8_t* put_inner(uint8_t* out) const {
    if constexpr (kind == ChannelKind::kColor) {
      return put_field(out, mean_);
    } else if constexpr (kind == ChannelKind::kVector) {
      return put_field(put_field(put_field(out, 0.0F), 0.0F), 0.0F);
    } else if constexpr (kind == ChannelKind::kId) {
      return put_field(out, uint32_t{0});
    } else if constexpr (kind == ChannelKind::kDistance) {
      return put_distance(out, deepest_);
    } else {
      return put_field(out, 1.0F);
    }
  }

  uint8_t* put_distance(uint8_t* out, float voxels) const {
    return put_field(out, static_cast<float>(voxels * distance_scale_));
  }

  const VoxelPieces& voxels_;
  const Grid& grid_;
  size_t record_bytes_;
  bool is_float_;
  uint32_t mean_;
  double distance_scale_;
  float deepest_ = 0;  // in distance_unit()
};

}  // namespace
}  // namespace voxeld::points

namespace voxeld {

Status encode_pcd(const Grid& grid, const OutputOptions& /*options*/, OutputFile& file) {
  using namespace points;
  const VoxelPieces voxels(grid);
  VOXELD_TRY(check_sparse(voxels.voxel_count(), Format::kPcd));
  const bool is_float = mesh::fits_float(grid.spec);
  const std::vector<PcdField> fields = pcd_fields(grid, is_float);
  size_t record_bytes = 0;
  for (const PcdField& field : fields) record_bytes += field.bytes;
  VOXELD_TRY(file.append(volume::text_bytes(pcd_header(grid, fields, voxels.voxel_count()))));
  return append_pieces(file, PcdRecords(voxels, record_bytes, is_float));
}

}  // namespace voxeld
