// Grid -> picture by ray marching, on a GL context (gl_renderer.h) or on the CPU
// (cpu/cpu_renderer.h): the same hits, and colours that rounding may change by one step of 255.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "proto/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"
#include "server/render/camera.h"

namespace voxeld {

struct Picture {
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;  // top row first, sRGB, straight alpha
};

// What a pixel's ray hit; for tests and picking.
struct Hit {
  glm::ivec3 cell{-1};  // -1,-1,-1: nothing
  int face = -1;        // 0..5: -x +x -y +y -z +z face through which the ray entered the cell
};

// How much work a pixel gets where the request does not say.
struct RenderQuality {
  // Rays along each side of a pixel, averaged in linear light; 1..4. Fewer are taken where the
  // device's loop limit demands it.
  int samples_per_side = 2;
  // Pictures with more pixels than this get one ray per pixel: time grows with the product.
  int64_t supersampled_pixels_max = int64_t{1024} * 1024;
};

// Called between picture blocks (at most 512x512 pixels); false cancels.
using BlockProgress = std::function<bool(int64_t blocks_done, int64_t blocks_total)>;

// Keeps a grid from picture to picture. One thread.
class Renderer {
 public:
  virtual ~Renderer() = default;

  // Takes the grid in; it stays resident until the next call. Errors: grid-too-large with bytes and
  // the device's limit.
  virtual Status set_grid(const Grid& grid) = 0;
  // Of one of the tables that a grid becomes; SIZE_MAX where memory alone is the limit.
  virtual size_t table_bytes_max() const { return SIZE_MAX; }
  // Without a grid, or of an empty one: the background. Voxels are drawn opaque, whatever their
  // alpha. Errors: cancelled when `progress` says false, invalid-option for a matrix that cannot be
  // inverted, internal and device-unavailable with the driver's words.
  virtual Result<Picture> render(const RenderOptions& options, const BlockProgress& progress) = 0;
  virtual void set_quality(const RenderQuality& quality) = 0;
  // width*height hits, top row first; one ray through the middle of each pixel. A ray that starts
  // inside a voxel (camera in the grid, section plane) hits it through the face of the ray's
  // longest axis.
  virtual Result<std::vector<Hit>> render_hits(const RenderOptions& options) = 0;
};

// PNG by OpenImageIO, 8 bits RGBA, marked sRGB. Errors: internal.
Result<std::vector<uint8_t>> encode_png(const Picture& picture);

}  // namespace voxeld
