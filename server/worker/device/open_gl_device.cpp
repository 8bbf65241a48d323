#include <thread>

#include "server/gpu/context.h"
#include "server/gpu/shader_library.h"
#include "server/render/gl_renderer.h"
#include "server/voxel/gl/gl_pipeline.h"
#include "server/worker/device/open_device.h"

namespace voxeld {
namespace {

// Holds the context first, so it is destroyed last: programs and buffers must be freed in it.
struct GlState {
  GlState(std::unique_ptr<gpu::Context> gl_context, const std::string& shader_dir)
      : context(std::move(gl_context)), shaders(*context, shader_dir) {}

  std::unique_ptr<gpu::Context> context;
  gpu::ShaderLibrary shaders;
};

}  // namespace

Result<OpenedDevice> open_gl_device(const gpu::DeviceId& device, const std::string& shader_dir) {
  VOXELD_ASSIGN(auto context, gpu::Context::create(device));
  const auto state = std::make_shared<GlState>(std::move(context), shader_dir);
  OpenedDevice opened;
  opened.info = state->context->info();
  opened.shaders = state->shaders.sources_hash();
  opened.context = state;
  opened.pipeline = std::make_unique<GlPipeline>(*state->context, state->shaders);
  opened.gl_renderer = std::make_unique<GlRenderer>(*state->context, state->shaders);
  opened.memory = [gl = state->context.get(), thread = std::this_thread::get_id()] {
    if (std::this_thread::get_id() != thread) return DeviceMemory();
    const gpu::MemoryInfo memory = gl->memory();
    return DeviceMemory{memory.bytes_total, memory.bytes_free};
  };
  opened.check = [gl = state->context.get()](std::string_view where) { return gl->check(where); };
  return opened;
}

}  // namespace voxeld
