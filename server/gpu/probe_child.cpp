// The child process of a probe: it opens one device and describes it.
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>

#include "server/base/clock.h"
#include "server/device/device.h"
#include "server/gpu/context.h"
#include "server/gpu/egl.h"

namespace voxeld::gpu {
namespace {

using nlohmann::json;

json info_json(const DeviceInfo& info) {
  return {{"vendor", info.vendor},
          {"renderer", info.renderer},
          {"version", info.version},
          {"glsl_version", info.glsl_version},
          {"backend", info.backend},
          {"pci_address", info.pci_address},
          {"is_robust", info.is_robust},
          {"is_software", info.is_software},
          {"has_int64", info.has_int64},
          {"has_float64", info.has_float64},
          {"has_timer_queries", info.has_timer_queries},
          {"ssbo_bytes_max", info.ssbo_bytes_max},
          {"ssbo_bindings_max", info.ssbo_bindings_max},
          {"ubo_bytes_max", info.ubo_bytes_max},
          {"texture_side_max", info.texture_side_max},
          {"texture3d_side_max", info.texture3d_side_max},
          {"framebuffer_side_max", info.framebuffer_side_max},
          {"dispatch_groups_max", info.dispatch_groups_max},
          {"loop_iterations_max", info.loop_iterations_max}};
}

// Prints the object on a line of its own, because drivers may have written before it.
void print_line(const json& object) {
  const std::string line =
      "\n" + object.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
  std::fwrite(line.data(), 1, line.size(), stdout);
  std::fflush(stdout);
}

}  // namespace

int probe_device_main(const DeviceId& device, const std::function<Status()>& enter_sandbox) {
  const Stopwatch clock;
  if (device.kind == DeviceKind::kCpu) {
    print_line({{"device", "cpu"}, {"works", true}, {"info", info_json(cpu_device_info())}});
    return 0;
  }
  if (const Status entered = enter_sandbox(); !entered) {
    print_line({{"device", device_name(device)},
                {"works", false},
                {"reason", device_name(device) + ": " + entered.error().message()}});
    return 0;
  }
  const auto context = Context::create(device);
  json object = {{"device", device_name(device)}, {"works", context.ok()}};
  if (device.kind == DeviceKind::kEgl) {
    const auto found = enumerate_egl_devices();
    object["egl_device_count"] = found.ok() ? found->size() : 0;
  }
  if (context.ok()) {
    object["context_ms"] = clock.ms();
    object["info"] = info_json((*context)->info());
  } else {
    object["reason"] = context.error().message();
  }
  print_line(object);
  return 0;
}

}  // namespace voxeld::gpu
