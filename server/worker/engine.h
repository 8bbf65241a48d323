// What a worker keeps from one task to the next: its GL context, compiled programs, and the inputs
// that the next task is likely to ask for again.
#pragma once

#include <memory>
#include <string>

#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/grid/grid.h"
#include "server/render/gl_renderer.h"
#include "server/scene/scene.h"
#include "server/voxel/gl/gl_pipeline.h"
#include "server/voxel/voxelize.h"

namespace voxeld {

// Scenes above this are not kept: memory is for the task that runs.
inline constexpr size_t kCachedSceneBytesMax = size_t{512} << 20;

// A grid with what is costly to learn of it.
struct LoadedGrid {
  Grid grid;
  std::string content_hash;
};

// One of each, the last used: somebody who turns a model looks at the same grid again and again.
struct InputCache {
  std::string scene_key;  // input hash and what of the file name matters
  std::shared_ptr<const Scene> scene;
  std::string grid_key;  // hash of the container, or of input and options for renders of a mesh
  std::shared_ptr<const LoadedGrid> grid;
  std::string resident_key;  // the grid that the renderer has in its buffers
};

struct Engine {
  Engine(std::unique_ptr<gpu::Context> gl_context, const std::string& shader_dir)
      : context(std::move(gl_context)),
        shaders(*context, shader_dir),
        voxelizer(std::make_unique<GlPipeline>(*context, shaders)),
        renderer(*context, shaders) {}

  std::unique_ptr<gpu::Context> context;
  gpu::ShaderLibrary shaders;
  Voxelizer voxelizer;
  GlRenderer renderer;
  InputCache cache;
};

}  // namespace voxeld
