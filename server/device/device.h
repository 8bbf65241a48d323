// The devices of the machine, their abilities, and the choice of `auto`.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/device/pci_address.h"

namespace voxeld::gpu {

// Kinds of devices. kCpu has no GL at all: only pipeline cpu and the ray march on the CPU.
enum class DeviceKind { kEgl, kLlvmpipe, kLavapipe, kOsmesa, kCpu };

// "egl:0", "pci:0000:3b:00.0", "llvmpipe", "lavapipe", "osmesa", "cpu".
struct DeviceId {
  DeviceKind kind = DeviceKind::kLlvmpipe;
  int index = 0;  // place among EGL's devices; kEgl without an address only
  std::optional<PciAddress> address = std::nullopt;  // of a kEgl that is named by it
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
  std::string pci_address;         // "0000:3b:00.0"; empty: not on a PCI bus, or not known
  bool is_robust = false;          // bounds-checked access and reset notification
  bool is_software = false;        // is_software_renderer()
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

// Whether GL_RENDERER names a driver that computes on the CPU, also that of a virtual machine's
// host or of another API below OpenGL. A GPU by number is refused there.
bool is_software_renderer(std::string_view renderer);

// The result of probing a device. Each is opened in a child process, so that a broken driver ends
// only the child.
struct DeviceProbe {
  DeviceId device;
  bool works = false;
  std::string reason;  // why it does not work
  // It works outside of the sandbox of workers alone.
  bool is_kept_out = false;
  DeviceInfo info;  // valid only if it works
  double context_ms = 0;
};
// The children of a probe. Each is `<executable> probe-device --device NAME --sandbox MODE`, which
// prints one JSON object.
struct ProbeSettings {
  std::string executable;
  // The workers' sandbox. A driver that opens only outside of it is of no use to them.
  std::string sandbox = "auto";
  // Probes a device that does not work in the sandbox again, without it (DeviceProbe::is_kept_out).
  bool compares_sandbox = false;
  // A child that takes longer is killed, and its device counts as not working.
  std::chrono::milliseconds timeout_each = std::chrono::seconds(20);
};
// Probes every candidate. Device cpu comes last and always works.
std::vector<DeviceProbe> probe_devices(const ProbeSettings& settings);
// The child's main function: enters the sandbox, opens the device and prints the JSON. Returns the
// exit status, which is 0 also if the device does not work.
int probe_device_main(const DeviceId& device, const std::function<Status()>& enter_sandbox);

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
