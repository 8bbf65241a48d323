// Writes points as text: a line "x y z" for the centre of each voxel in world units, in the order
// of the container (Morton), with " r g b" (sRGB, 0..255) where the grid has colour. Numbers are
// the shortest that read back as the same double. Voxels inside of solids have the grid's mean
// colour.
#include <array>
#include <charconv>
#include <cstdint>
#include <string>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/output_file.h"

namespace voxeld {
namespace {

template <typename Number>
void append(std::vector<uint8_t>& text, Number value, char end) {
  std::array<char, 32> digits{};  // the longest double has 24 characters
  const auto written = std::to_chars(digits.data(), digits.data() + digits.size(), value);
  text.insert(text.end(), digits.data(), written.ptr);
  text.push_back(static_cast<uint8_t>(end));
}

}  // namespace

Status encode_xyz(const Grid& grid, const OutputOptions& /*options*/, OutputFile& file) {
  const size_t channels = channel_info(Channel::kColor).components;
  const std::array<uint8_t, 3> mean = grid.channels.color ? mean_color(grid) : kNeutralColor;
  if (const uint64_t points = grid.voxel_count(); points > kXyzPointsMax) {
    return Error{ErrorCode::kGridTooLarge, "xyz: too many voxels for points",
                 "at most " + std::to_string(kXyzPointsMax), std::to_string(points)};
  }
  std::vector<uint8_t> text;  // of a tile
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      cancel_point();
      const glm::dvec3 center = grid.spec.world_from_grid(glm::dvec3(x, y, z) + 0.5);
      append(text, center.x, ' ');
      append(text, center.y, ' ');
      append(text, center.z, grid.channels.color ? ' ' : '\n');
      if (!grid.channels.color) return;
      const bool is_inner = voxel == kNoAttributes || !has_own_color(tile, voxel);
      const uint8_t* color = is_inner ? mean.data() : tile.color.data() + channels * voxel;
      append(text, unsigned{color[0]}, ' ');
      append(text, unsigned{color[1]}, ' ');
      append(text, unsigned{color[2]}, '\n');
    });
    VOXELD_TRY(file.append(text));
    text.clear();
  }
  return {};
}

}  // namespace voxeld
