// Rendering block by block, which bounds the time until a cancel takes effect.
#pragma once

#include <algorithm>

#include "proto/result.h"
#include "server/render/render.h"

namespace voxeld {

// Pixels along a side of a block.
inline constexpr int kImageBlockSide = 512;

// Calls draw(x, y, width, height) -> Status for each block, of at most `rows` rows. Errors:
// cancelled if `progress` returns false; those of draw.
template <typename Draw>
Status for_each_block(int width, int height, int rows, const BlockProgress& progress, Draw&& draw) {
  constexpr int kSide = kImageBlockSide;
  const int across = (width + kSide - 1) / kSide;
  const int down = (height + rows - 1) / rows;
  for (int block = 0; block < across * down; ++block) {
    const int x = block % across * kSide, y = block / across * rows;
    VOXELD_TRY(draw(x, y, std::min(kSide, width - x), std::min(rows, height - y)));
    if (progress && !progress(block + 1, int64_t{across} * down)) {
      return Error{ErrorCode::kCancelled, "the image was cancelled", "", ""};
    }
  }
  return {};
}

}  // namespace voxeld
