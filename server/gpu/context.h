// A headless OpenGL 4.5 core context on one device. It has its own function table, so that EGL and
// OSMesa can exist in one process. Bound to the thread that created it.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/device/device.h"
#include "server/gpu/gl_api.h"

namespace voxeld::gpu {

// Device memory. 0, 0 if the driver does not report it.
struct MemoryInfo {
  int64_t bytes_total = 0, bytes_free = 0;
};

class Context {
 public:
  // Creates a context and leaves it current on the calling thread. While a Mesa driver loads, the
  // environment is changed and then restored, so call this before other threads start. egl:N
  // refuses every software renderer. A second kind of Mesa EGL driver in one process is refused,
  // because Mesa reads its choice of driver once. Errors: device-unavailable with what failed
  // (library, device, version).
  static Result<std::unique_ptr<Context>> create(const DeviceId& device);
  virtual ~Context() = default;
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  // glFoo(…) is context.gl().Foo(…).
  const GlApi& gl() const { return gl_; }
  const DeviceInfo& info() const { return info_; }

  // Needed only if one thread holds several contexts. Errors: device-unavailable.
  virtual Status make_current() const = 0;

  // Checks for a GL error: aborts (CHECK) in debug contexts, otherwise returns internal or
  // device-unavailable with the error's name and `where`. A reset of the device is one, too, also
  // if no call reports it. Call it at the end of a pass, not after every call. A context that was
  // lost stays lost.
  Status check(std::string_view where) const;

  // Memory of the whole device, by GL_NVX_gpu_memory_info or GL_ATI_meminfo.
  MemoryInfo memory() const;

 protected:
  Context() = default;
  // Fills gl_ and info_ and checks the baseline. For the backends; the context must be current.
  Status finish_setup(const DeviceId& device, const GetGlProc& get_proc);

  GlApi gl_{};
  DeviceInfo info_;
  bool is_debug_ = false;  // VOXELD_GL_DEBUG=1 in the environment: driver messages go to the log

 private:
  enum class MemorySource { kNone, kNvx, kAti };
  MemorySource memory_source_ = MemorySource::kNone;
  int64_t ati_bytes_at_start_ = 0;
  mutable bool is_lost_ = false;
};

}  // namespace voxeld::gpu
