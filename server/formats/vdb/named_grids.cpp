#include "server/formats/vdb/named_grids.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "server/base/cancel_point.h"
#include "server/formats/npy/sample_writers.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::vdb {
namespace {

class DensityValues : public GridValues<float> {
 public:
  explicit DensityValues(const Grid& grid) : has_coverage_(grid.channels.coverage) { inner = 1.0F; }
  void fill(const SparseTile& tile, size_t first, std::span<float> values) const override {
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = has_coverage_ ? static_cast<float>(tile.coverage[first + i]) / UINT8_MAX : 1.0F;
    }
  }

 private:
  bool has_coverage_;
};

class DistanceValues : public GridValues<float> {
 public:
  explicit DistanceValues(const Grid& grid) : scale_(volume::stored_distance_scale(grid)) {
    background = in_world(farthest(grid, &SparseTile::distance));
    inner = -background;
    is_signed = grid.meta.tells_sides();
  }
  void fill(const SparseTile& tile, size_t first, std::span<float> values) const override {
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = in_world(static_cast<float>(tile.distance[first + i]) / kDistanceSteps);
    }
  }

 private:
  float in_world(float voxels) const { return static_cast<float>(voxels * scale_); }

  double scale_;
};

// Whether a voxel has a colour: those inside of solids have zeros instead.
bool has_color(const uint8_t* color) {
  return std::any_of(color, color + 4, [](uint8_t byte) { return byte != 0; });
}

Vec3s linear_color(const uint8_t* color) {
  return {linear_from_srgb(color[0]), linear_from_srgb(color[1]), linear_from_srgb(color[2])};
}

class ColorValues : public GridValues<Vec3s> {
 public:
  explicit ColorValues(const Grid& grid) { inner = linear_color(mean_color(grid).data()); }
  void fill(const SparseTile& tile, size_t first, std::span<Vec3s> values) const override {
    for (size_t i = 0; i < values.size(); ++i) {
      const uint8_t* const color = &tile.color[4 * (first + i)];
      values[i] = has_color(color) ? linear_color(color) : inner;
    }
  }
};

class AlphaValues : public GridValues<float> {
 public:
  AlphaValues() { inner = 1.0F; }
  void fill(const SparseTile& tile, size_t first, std::span<float> values) const override {
    for (size_t i = 0; i < values.size(); ++i) {
      const uint8_t* const color = &tile.color[4 * (first + i)];
      values[i] = has_color(color) ? static_cast<float>(color[3]) / UINT8_MAX : inner;
    }
  }
};

bool has_transparent(const SparseTile& tile) {
  cancel_point();
  for (size_t i = 0; i < tile.color.size(); i += 4) {
    if (tile.color[i + 3] != UINT8_MAX && has_color(&tile.color[i])) return true;
  }
  return false;
}

class NormalValues : public GridValues<Vec3s> {
 public:
  void fill(const SparseTile& tile, size_t first, std::span<Vec3s> values) const override {
    for (size_t i = 0; i < values.size(); ++i) {
      for (size_t c = 0; c < 3; ++c) {
        values[i][c] = static_cast<float>(tile.normal[3 * (first + i) + c]) / INT8_MAX;
      }
    }
  }
};

class IdValues : public GridValues<int32_t> {
 public:
  explicit IdValues(Channel channel) : channel_(channel) {}
  void fill(const SparseTile& tile, size_t first, std::span<int32_t> values) const override {
    const std::vector<uint16_t>& ids = id_samples(tile, channel_);
    for (size_t i = 0; i < values.size(); ++i) values[i] = ids[first + i];
  }

 private:
  Channel channel_;
};

// Only bands with voxels and solids tell on which side a cell without a voxel is.
bool is_level_set(const Grid& grid) {
  const bool is_known_band =
      grid.meta.tells_sides() && !std::ranges::all_of(grid.tiles, &SparseTile::empty);
  return volume::has_world_distances(grid) && (is_known_band || grid.meta.is_solid());
}

}  // namespace

std::vector<std::string> names_of_grids(const Grid& grid) {
  std::vector<std::string> names;
  const bool is_told_by_distances = grid.meta.tells_sides() && grid.channels.distance;
  if (!is_told_by_distances || grid.channels.coverage) names.emplace_back("density");
  if (grid.channels.distance) names.emplace_back("surface");
  if (grid.channels.color) names.emplace_back("color");
  if (grid.channels.color && std::ranges::any_of(grid.tiles, has_transparent)) {
    names.emplace_back("alpha");
  }
  for (const auto& [channel, name] : {std::pair{Channel::kNormal, "normal"},
                                      {Channel::kMaterial, "material"},
                                      {Channel::kLabel, "label"}}) {
    if (grid.channels.has(channel)) names.emplace_back(name);
  }
  return names;
}

NamedGrid named_grid(const Grid& grid, const std::string& name) {
  if (name == "density") {
    return {VolumeClass::kFogVolume, std::make_unique<DensityValues>(grid)};
  }
  if (name == "surface") {
    return {is_level_set(grid) ? VolumeClass::kLevelSet : VolumeClass::kUnknown,
            std::make_unique<DistanceValues>(grid)};
  }
  if (name == "color") return {VolumeClass::kUnknown, std::make_unique<ColorValues>(grid)};
  if (name == "alpha") return {VolumeClass::kUnknown, std::make_unique<AlphaValues>()};
  if (name == "normal") return {VolumeClass::kUnknown, std::make_unique<NormalValues>()};
  const Channel channel = name == "label" ? Channel::kLabel : Channel::kMaterial;
  return {VolumeClass::kUnknown, std::make_unique<IdValues>(channel)};
}

glm::dvec3 voxel_sides(const GridSpec& spec) {
  return volume::is_cubic(spec) ? glm::dvec3(spec.voxel_size.x) : spec.voxel_size;
}

}  // namespace voxeld::vdb
