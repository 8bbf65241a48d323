// The parts of a VDB file around its trees.
//
//   file      i64 magic 0x56444220, u32 file version 224, u32 library version major 10, minor 0,
//             u8 1 (the grids have offsets), 36 characters of a UUID, metadata, u32 grids; grids
//   metadata  u32 entries; of each: text name, text type, u32 bytes, value
//   grid      text name, text type, text "" (not an instance), i64 offsets of the compression,
//             of the leaves and of the grid's end; u32 compression, metadata, transform, topology,
//             leaves
//   transform text type, f64[3] translation, scale, voxel size, 1 / scale, 1 / scale^2,
//             1 / (2 scale)
//   text      u32 length, characters
//
// The format is that of OpenVDB 10:
// https://github.com/AcademySoftwareFoundation/openvdb (io/Archive.cc, math/Maps.h).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "server/formats/vdb/bytes.h"
#include "server/formats/vdb/tree_order.h"
#include "server/grid/grid.h"

namespace voxeld::vdb {

inline constexpr uint32_t kCompression = 3;  // zip (1) and active values (2)

struct MetaValue {
  std::string_view type;
  Bytes value;
};
// Names are written in their order, as OpenVDB does.
using MetaMap = std::map<std::string, MetaValue>;

MetaValue text_meta(std::string_view text);
MetaValue bool_meta(bool value);
MetaValue count_meta(uint64_t count);
MetaValue cell_meta(const Cell& cell);

void put_meta(Bytes& out, const MetaMap& meta);
void put_transform(Bytes& out, const GridSpec& spec);
// Everything before the first grid. The UUID is made of the grid's meta, placement and tiles.
Bytes file_header(const Grid& grid, uint32_t grids);

}  // namespace voxeld::vdb
