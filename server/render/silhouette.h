// The part of an image in which a grid may be seen.
#pragma once

#include <vector>

#include "server/render/camera.h"

namespace voxeld {

// The image of the subject's convex hull, a few pixels wider: voxels that are narrower than a pixel
// are drawn as cubes that may stand out of it, and positions are rounded.
class Silhouette {
 public:
  // Pixels first to end - 1 of a row.
  struct Columns {
    int first = 0, end = 0;
  };

  // Where a point of the subject is not in front of the camera, that is the whole image.
  Silhouette(const Camera& camera, const Subject& subject, int width, int height);
  // y: from the bottom.
  Columns row(int y) const { return rows_[static_cast<size_t>(y)]; }

 private:
  std::vector<Columns> rows_;
};

}  // namespace voxeld
