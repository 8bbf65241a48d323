// A headless OpenGL 4.5 core context on one device, with its own function table, so that EGL and
// OSMesa live in one process. Bound to the thread that created it.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/gpu/device.h"
#include "server/gpu/gl_api.h"

namespace voxeld::gpu {

class Context {
 public:
  // Errors: device-unavailable with what failed (library, device, version, int64 missing);
  // egl:N refuses a software renderer unless it is what N names.
  static Result<std::unique_ptr<Context>> create(const DeviceId& device);
  virtual ~Context() = default;
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  // glFoo(…) is context.gl().Foo(…).
  const GlApi& gl() const { return gl_; }
  const DeviceInfo& info() const { return info_; }

  // Aborts (CHECK) on a GL error in debug contexts; otherwise returns internal / device-unavailable
  // with the error's name and `where`. Call at the end of a pass, not after every call.
  Status check(std::string_view where) const;

 protected:
  Context() = default;
  GlApi gl_{};
  DeviceInfo info_;
};

}  // namespace voxeld::gpu
