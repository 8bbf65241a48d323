#include "server/worker/task/engine.h"

namespace voxeld {

Result<Engine::ChosenRenderer> Engine::choose_renderer(RendererChoice asked) {
  Renderer* gl = device.gl_renderer.get();
  if (asked == RendererChoice::kGl && gl == nullptr) {
    return Error{ErrorCode::kUnsupportedFeature,
                 "renderer gl needs a GL context, and this device has none", "renderer=cpu or auto",
                 "gl"};
  }
  const bool is_faulty = device_faults.has(DevicePart::kImages);
  if (asked == RendererChoice::kGl && is_faulty) {
    return Error{ErrorCode::kUnsupportedFeature,
                 "renderer gl failed the device's self-test (" +
                     device_faults.why(DevicePart::kImages) + ")",
                 "renderer=cpu or auto", "gl"};
  }
  const bool by_gl =
      asked == RendererChoice::kGl ||
      (asked == RendererChoice::kAuto && gl != nullptr && !device.info.is_software && !is_faulty);
  if (by_gl) return ChosenRenderer{gl, &cache.gl_resident_key, "gl"};
  return ChosenRenderer{device.cpu_renderer.get(), &cache.cpu_resident_key, "cpu"};
}

void Engine::set_device_faults(const DeviceFaults& faults) {
  device_faults = faults;
  voxelizer.set_device_faults(faults);
}

void Engine::begin_task_of(const std::string& tenant) {
  if (cache_tenant == tenant) return;
  cache = {};
  cache_tenant = tenant;
}

}  // namespace voxeld
