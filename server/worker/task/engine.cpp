#include "server/worker/task/engine.h"

namespace voxeld {

Result<Engine::ChosenRenderer> Engine::choose_renderer(RendererChoice asked) {
  Renderer* gl = device.gl_renderer.get();
  if (asked == RendererChoice::kGl && gl == nullptr) {
    return Error{ErrorCode::kUnsupportedFeature,
                 "renderer gl needs a GL context, and this device has none", "renderer=cpu or auto",
                 "gl"};
  }
  const bool by_gl = asked == RendererChoice::kGl ||
                     (asked == RendererChoice::kAuto && gl != nullptr && !device.info.is_software);
  if (by_gl) return ChosenRenderer{gl, &cache.gl_resident_key, "gl"};
  return ChosenRenderer{device.cpu_renderer.get(), &cache.cpu_resident_key, "cpu"};
}

void Engine::begin_task_of(const std::string& tenant) {
  if (cache_tenant == tenant) return;
  cache = {};
  cache_tenant = tenant;
}

}  // namespace voxeld
