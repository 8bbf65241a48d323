// The occupied voxels of a container in the files of others: grid_sizes GRID.voxg FOLDER writes
// binvox, and OpenVDB and NanoVDB where they are installed, and prints one JSON object: voxels, and
// the path by format.
//
// binvox (Min 2004): a text header, then pairs of bytes, value 0 or 1 and count 1..255, over cells
// in the order x, z, y, y fastest.
#include <cstdio>
#include <exception>
#include <fstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/container/grid_format.h"
#include "server/base/disk/file.h"
#include "tests/bench/grid_sizes.h"

namespace voxeld::bench {
namespace {

constexpr size_t kRunMax = 255;

using Dims = std::array<int32_t, 3>;

std::vector<bool> dense(const std::vector<SparseTile>& tiles, const Dims& dims) {
  const auto height = static_cast<size_t>(dims[1]), depth = static_cast<size_t>(dims[2]);
  std::vector<bool> cells(static_cast<size_t>(dims[0]) * height * depth);
  for (const SparseTile& tile : tiles) {
    for_each_voxel(tile, [&](int32_t x, int32_t y, int32_t z, size_t) {
      cells[(static_cast<size_t>(x) * depth + static_cast<size_t>(z)) * height +
            static_cast<size_t>(y)] = true;
    });
  }
  return cells;
}

Status write_binvox(const std::vector<SparseTile>& tiles, const Dims& dims,
                    const std::string& path) {
  const std::vector<bool> cells = dense(tiles, dims);
  std::string runs;
  for (size_t i = 0; i < cells.size();) {
    size_t end = i + 1;
    while (end < cells.size() && end - i < kRunMax && cells[end] == cells[i]) ++end;
    runs.push_back(cells[i] ? '\1' : '\0');
    runs.push_back(static_cast<char>(end - i));
    i = end;
  }
  std::ofstream out(path, std::ios::binary);
  out << "#binvox 1\ndim " << dims[0] << " " << dims[2] << " " << dims[1]
      << "\ntranslate 0 0 0\nscale 1\ndata\n"
      << runs;
  if (out.flush()) return {};
  return Error{ErrorCode::kInternal, "cannot write " + path, "", ""};
}

Status write_all(const std::string& container, const std::string& folder) {
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(container));
  VOXELD_ASSIGN(const GridReader reader, GridReader::open(file.bytes()));
  std::vector<SparseTile> tiles;
  for (size_t i = 0; i < reader.tile_count(); ++i) {
    VOXELD_ASSIGN(SparseTile tile, reader.decode_tile(i));
    tiles.push_back(std::move(tile));
  }
  const auto& dims = reader.header().dims;
  const std::string binvox = folder + "/grid.binvox";
  VOXELD_TRY(write_binvox(tiles, {dims[0], dims[1], dims[2]}, binvox));
  nlohmann::json files = {{"binvox", binvox}};
#if VOXELD_BENCH_OPENVDB
  for (const auto& [name, path] : write_vdbs(tiles, folder)) files[name] = path;
#endif
  std::printf("%s\n",
              nlohmann::json{{"voxels", reader.voxel_count()}, {"files", files}}.dump(2).c_str());
  return {};
}

}  // namespace
}  // namespace voxeld::bench

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::fprintf(stderr, "grid_sizes GRID.voxg FOLDER\n");
    return 2;
  }
  const auto status = voxeld::bench::write_all(argv[1], argv[2]);
  if (!status) std::fprintf(stderr, "%s\n", status.error().message().c_str());
  return status ? 0 : 1;
} catch (const std::exception& e) {
  std::fprintf(stderr, "%s\n", e.what());
  return 1;
}
