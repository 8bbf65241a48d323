#include <stdexcept>

#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include "tests/bench/grid_sizes.h"
#if VOXELD_BENCH_NANOVDB
#define NANOVDB_USE_BLOSC
#define NANOVDB_USE_ZIP
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#endif

namespace voxeld::bench {
namespace {

openvdb::MaskGrid::Ptr mask_grid(const std::vector<SparseTile>& tiles) {
  openvdb::initialize();
  auto grid = openvdb::MaskGrid::create();
  auto accessor = grid->getAccessor();
  uint64_t voxels = 0;
  for (const SparseTile& tile : tiles) {
    for_each_voxel(tile, [&](int32_t x, int32_t y, int32_t z, size_t) {
      accessor.setValueOn({x, y, z});
    });
    voxels += tile.voxel_count();
  }
  grid->pruneGrid();
  if (grid->activeVoxelCount() != voxels) {
    throw std::runtime_error("OpenVDB: " + std::to_string(grid->activeVoxelCount()) +
                             " voxels, expected " + std::to_string(voxels));
  }
  return grid;
}

void add_openvdb(const openvdb::MaskGrid::Ptr& grid, const std::string& folder,
                 WrittenFiles& files) {
  using openvdb::io::COMPRESS_ACTIVE_MASK, openvdb::io::COMPRESS_BLOSC, openvdb::io::COMPRESS_ZIP;
  const std::pair<const char*, uint32_t> codecs[] = {{"zip", COMPRESS_ZIP},
                                                     {"blosc", COMPRESS_BLOSC}};
  for (const auto& [name, codec] : codecs) {
    const std::string path = folder + "/" + name + ".vdb";
    openvdb::io::File file(path);
    file.setCompression(codec | COMPRESS_ACTIVE_MASK);
    file.write(openvdb::GridPtrVec{grid});
    files.emplace_back(std::string("OpenVDB ") + name, path);
  }
}

#if VOXELD_BENCH_NANOVDB
void add_nanovdb(const openvdb::MaskGrid& grid, const std::string& folder, WrittenFiles& files) {
  const auto handle = nanovdb::openToNanoVDB(grid);
  const auto* copy = handle.grid<nanovdb::ValueMask>();
  if (copy == nullptr || copy->activeVoxelCount() != grid.activeVoxelCount()) {
    throw std::runtime_error("NanoVDB: the number of voxels differs");
  }
  const std::pair<const char*, nanovdb::io::Codec> codecs[] = {
      {"none", nanovdb::io::Codec::NONE},
      {"zip", nanovdb::io::Codec::ZIP},
      {"blosc", nanovdb::io::Codec::BLOSC}};
  for (const auto& [name, codec] : codecs) {
    const std::string path = folder + "/" + name + ".nvdb";
    nanovdb::io::writeGrid(path, handle, codec);
    files.emplace_back(std::string("NanoVDB ") + name, path);
  }
}
#endif

}  // namespace

WrittenFiles write_vdbs(const std::vector<SparseTile>& tiles, const std::string& folder) {
  const auto grid = mask_grid(tiles);
  WrittenFiles files;
  add_openvdb(grid, folder, files);
#if VOXELD_BENCH_NANOVDB
  add_nanovdb(*grid, folder, files);
#endif
  return files;
}

}  // namespace voxeld::bench
