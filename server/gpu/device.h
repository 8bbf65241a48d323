// The devices of the machine, their abilities, and the choice of `auto`.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"

namespace voxeld::gpu {

// Kinds of devices. kCpu has no GL at all: only pipeline cpu and the ray march on the CPU.
enum class DeviceKind { kEgl, kLlvmpipe, kLavapipe, kOsmesa, kCpu };

// "egl:0", "llvmpipe", "lavapipe", "osmesa", "cpu".
struct DeviceId {
  DeviceKind kind = DeviceKind::kLlvmpipe;
  int index = 0;  // in EGL's device enumeration; kEgl only
  bool operator==(const DeviceId&) const = default;
};

// Parses a device's name. Errors: invalid-option, naming the forms. "auto" is not a device: resolve
// it first.
Result<DeviceId> parse_device(std::string_view text);
std::string device_name(const DeviceId& device);

// The abilities of a context, read from it or known of its driver. Device cpu has no context:
// `renderer` names the processor, and all limits of GL are 0. Every pass respects all limits, so
// that none is hit silently.
struct DeviceInfo {
  DeviceId device;
  std::string vendor, renderer, version, glsl_version;
  std::string backend;             // "EGL 1.5 Mesa Project, device platform", "OSMesa"
  bool is_robust = false;          // bounds-checked access and reset notification
  bool is_software = false;        // llvmpipe, softpipe, SwiftShader, OSMesa, lavapipe
  bool has_int64 = false;          // GL_ARB_gpu_shader_int64
  bool has_float64 = false;        // GL_ARB_gpu_shader_fp64; a pass must test how exact it is
  bool has_timer_queries = false;  // queries exist and do not always return 0
  int64_t ssbo_bytes_max = 0;      // GL_MAX_SHADER_STORAGE_BLOCK_SIZE
  int ssbo_bindings_max = 0;
  int ubo_bytes_max = 0;
  int texture_side_max = 0;  // GL_MAX_TEXTURE_SIZE
  int texture3d_side_max = 0;
  int framebuffer_side_max = 0;
  int64_t dispatch_groups_max = 65535;  // per axis
  int64_t loop_iterations_max = 0;      // per shader invocation group; 0: no known limit
};

// The result of probing a device. Each is opened in a child process, so that a broken driver ends
// only the child.
struct DeviceProbe {
  DeviceId device;
  bool works = false;
  std::string reason;  // why it does not work
  DeviceInfo info;     // valid only if it works
  double context_ms = 0;
};
// Probes every candidate. `self_executable` is run as `<self> probe-device --device NAME` and
// prints one JSON object. A child that takes longer than `timeout_each` is killed, and its device
// counts as not working. Device cpu comes last and always works.
std::vector<DeviceProbe> probe_devices(
    const std::string& self_executable,
    std::chrono::milliseconds timeout_each = std::chrono::seconds(20));
// The child's main function: opens the device and prints the JSON. Returns the exit status, which
// is 0 also if the device does not work.
int probe_device_main(const DeviceId& device);

// The abilities of device cpu.
DeviceInfo cpu_device_info();

// The choice of `auto`; `why` explains it in a sentence. Hardware comes first (egl:N that is not
// software, lowest N), then llvmpipe, lavapipe, osmesa, in the order of measured speed. All come
// before cpu, because they can do what it does (pipeline cpu runs beside any context) and more.
struct AutoChoice {
  DeviceId device;
  std::string why;
};
AutoChoice choose_device(const std::vector<DeviceProbe>& probes);

}  // namespace voxeld::gpu
