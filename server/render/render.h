// Grid -> picture by ray marching on a GL context.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "proto/options.h"
#include "proto/result.h"
#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/grid/grid.h"

namespace voxeld {

struct Picture {
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;  // top row first, sRGB, straight alpha
};

// world space -> clip space of OpenGL (y up, z in -1..1).
struct Camera {
  glm::dmat4 clip_from_world{1.0};
};
// Frames the occupied box: at zoom 1 its bounding sphere fits the smaller side of the picture.
Camera make_camera(const RenderOptions& options, const glm::dvec3& occupied_min_world,
                   const glm::dvec3& occupied_max_world);

// What a pixel's ray hit; for tests and picking.
struct Hit {
  glm::ivec3 cell{-1};  // -1,-1,-1: nothing
  int face = -1;        // 0..5: -x +x -y +y -z +z face through which the ray entered the cell
};

// Called between picture blocks (at most 512x512 pixels); false cancels.
using BlockProgress = std::function<bool(int64_t blocks_done, int64_t blocks_total)>;

class Renderer {
 public:
  Renderer(gpu::Context& context, gpu::ShaderLibrary& shaders);
  ~Renderer();

  // Uploads the grid; it stays resident until the next call. Errors: grid-too-large with bytes and
  // the device's limit.
  Status set_grid(const Grid& grid);
  Result<Picture> render(const RenderOptions& options, const BlockProgress& progress);
  // width*height hits, top row first.
  Result<std::vector<Hit>> render_hits(const RenderOptions& options);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// PNG by OpenImageIO. Errors: internal.
Result<std::vector<uint8_t>> encode_png(const Picture& picture);

}  // namespace voxeld
