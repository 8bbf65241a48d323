// Images of one colour, and animations of four of them.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <vector>

#include "server/render/animated_image.h"

namespace voxeld {

using Color = std::array<uint8_t, 4>;

inline RenderImage plain(int width, int height, const Color& color) {
  RenderImage image{width, height, {}};
  for (int i = 0; i < width * height; ++i) {
    image.rgba.insert(image.rgba.end(), color.begin(), color.end());
  }
  return image;
}

inline const std::vector<Color> kColors = {
    {200, 0, 0, 255}, {0, 200, 0, 255}, {0, 0, 200, 255}, {200, 200, 0, 255}};

inline void write_all_to(Result<std::unique_ptr<AnimationWriter>> writer) {
  ASSERT_TRUE(writer.ok()) << writer.error().message();
  for (const Color& color : kColors) {
    const Status added = (*writer)->add(plain(20, 12, color));
    ASSERT_TRUE(added.ok()) << added.error().message();
  }
  const Status finished = (*writer)->finish();
  ASSERT_TRUE(finished.ok()) << finished.error().message();
}

}  // namespace voxeld
