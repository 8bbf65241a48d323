// Rendering of a grid by ray marching, on a GL context (gl_renderer.h) or on the CPU
// (cpu/cpu_renderer.h). Both give the same hits; colours may differ by one step of 255 through
// rounding.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "proto/options/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"
#include "server/render/camera.h"

namespace voxeld {

struct RenderImage {
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;  // top row first, sRGB, straight alpha
};

// The voxel that a pixel's ray hits; for tests and picking.
struct Hit {
  glm::ivec3 cell{-1};  // -1,-1,-1: nothing
  int face = -1;        // 0..5: -x +x -y +y -z +z face through which the ray entered the cell
};

// The work per pixel if the request does not set it.
struct RenderQuality {
  // Rays along each side of a pixel, averaged in linear light; 1..4. Fewer are taken if the
  // device's loop limit demands it.
  int samples_per_side = 2;
  // Images with more pixels than this get one ray per pixel, because time grows with the product.
  int64_t supersampled_pixels_max = int64_t{1024} * 1024;
};

// Called between blocks of an image (at most 512x512 pixels); returning false cancels.
using BlockProgress = std::function<bool(int64_t blocks_done, int64_t blocks_total)>;

// Renders a grid, which it keeps from image to image. Not thread-safe.
class Renderer {
 public:
  virtual ~Renderer() = default;

  // Loads the grid, which stays resident until the next call. After an error of the device there is
  // none. Errors: grid-too-large with bytes and the device's limit, internal and device-unavailable
  // with the driver's words.
  virtual Status set_grid(const Grid& grid) = 0;
  // The largest size of one of a grid's tables; SIZE_MAX if memory alone is the limit.
  virtual size_t table_bytes_max() const { return SIZE_MAX; }
  // The device memory of the grid that it keeps.
  virtual size_t device_bytes() const { return 0; }
  // Renders an image. Without a grid, or with an empty one, it shows the background. Voxels are
  // drawn opaque, whatever their alpha. Errors: cancelled if `progress` returns false,
  // invalid-option if the matrix cannot be inverted, internal and device-unavailable with the
  // driver's words.
  virtual Result<RenderImage> render(const RenderOptions& options,
                                     const BlockProgress& progress) = 0;
  virtual void set_quality(const RenderQuality& quality) = 0;
  // Returns width*height hits, top row first, with one ray through the middle of each pixel. A ray
  // that starts inside a voxel (camera in the grid, section plane) hits it through the face of the
  // ray's longest axis.
  virtual Result<std::vector<Hit>> render_hits(const RenderOptions& options) = 0;
};

// Encodes a PNG: 8 bits RGBA, marked sRGB. Errors: internal. Has cancellation points.
Result<std::vector<uint8_t>> encode_png(const RenderImage& image);

}  // namespace voxeld
