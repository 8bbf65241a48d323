#include <algorithm>
#include <array>
#include <cstdint>

#include "server/grid/grid.h"

namespace voxeld {

std::array<uint8_t, 3> id_color(uint16_t id) {
  if (id == 0) return kNeutralColor;
  // Hues a golden section of the circle apart, in six sectors of 256 steps, at three brightnesses.
  const uint32_t hue = (id * 949u) % 1536u;
  const uint32_t bright = std::array{235u, 190u, 150u}[id / 7u % 3u], dark = bright / 4;
  const uint32_t rising = dark + (bright - dark) * (hue % 256u) / 255u;
  const uint32_t falling = bright + dark - rising;
  const std::array<std::array<uint32_t, 3>, 6> sixths = {{{bright, rising, dark},
                                                          {falling, bright, dark},
                                                          {dark, bright, rising},
                                                          {dark, falling, bright},
                                                          {rising, dark, bright},
                                                          {bright, dark, falling}}};
  std::array<uint8_t, 3> color{};
  std::ranges::transform(sixths[hue / 256u], color.begin(),
                         [](uint32_t component) { return static_cast<uint8_t>(component); });
  return color;
}

std::optional<Channel> coloring_ids(const Grid& grid) {
  if (grid.channels.color) return std::nullopt;
  std::optional<Channel> ids;
  for (const ChannelInfo& info : kChannels) {
    if (info.is_id() && grid.channels.has(info.channel)) ids = info.channel;
  }
  return ids;
}

}  // namespace voxeld
