// The grids that the tests of images and raw arrays write, and their samples as npy has them.
#pragma once

#include <cstring>
#include <optional>
#include <random>
#include <type_traits>
#include <vector>

#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld::test {

// Every channel with any samples, and cells of a full node, which have none.
inline Grid grid_of_every_channel(const glm::dvec3& voxel_size) {
  std::mt19937 random(17);
  Grid grid = grid_of({70, 40, 33}, random_voxels(random, {56, 40, 33}, 900),
                      channels_of_bits(~uint32_t{0}));
  for_each_channel(grid.tiles[0], [&](Channel, auto& values) {
    for (auto& value : values) value = static_cast<std::decay_t<decltype(value)>>(random());
  });
  grid.tiles[0].full = {{morton_encode(7, 1, 1), 0}};
  grid.spec.voxel_size = voxel_size;
  grid.spec.origin_world = {-1.5, 0.25, 1e10};
  grid.meta = GridMeta::parse(R"({"units":"mm","labels":[{"id":1,"name":"a \"roof\""}]})");
  return grid;
}

// Occupancy, then the channels.
inline std::vector<std::optional<Channel>> arrays_of_grid(const Grid& grid) {
  std::vector<std::optional<Channel>> arrays = {std::nullopt};
  for (const ChannelInfo& info : kChannels) {
    if (grid.channels.has(info.channel)) arrays.emplace_back(info.channel);
  }
  return arrays;
}

// The samples of npy, x fastest; distances are in voxels.
inline std::vector<uint8_t> npy_samples_of(const Grid& grid, std::optional<Channel> channel,
                                           DType dtype = DType::kUint8) {
  OutputOptions options;
  options.axes = AxisOrder::kZyx;
  options.dtype = dtype;
  return read_npy(npy_of(grid, channel, options)).data;
}

// The same with distances of cubes in world units.
inline std::vector<uint8_t> world_samples_of(const Grid& grid, std::optional<Channel> channel,
                                             DType dtype = DType::kUint8) {
  std::vector<uint8_t> bytes = npy_samples_of(grid, channel, dtype);
  const glm::dvec3 size = grid.spec.voxel_size;
  if (channel != Channel::kDistance || size.x != size.y || size.x != size.z) return bytes;
  for (size_t at = 0; at < bytes.size(); at += sizeof(float)) {
    float value = 0;
    std::memcpy(&value, &bytes[at], sizeof value);
    value = static_cast<float>(value * size.x);
    std::memcpy(&bytes[at], &value, sizeof value);
  }
  return bytes;
}

}  // namespace voxeld::test
