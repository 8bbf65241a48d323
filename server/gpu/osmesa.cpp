#include "server/gpu/osmesa.h"

#include <dlfcn.h>

#include <array>

#include "server/gpu/egl.h"
#include "server/gpu/environment.h"

namespace voxeld::gpu {
namespace {

// Constants of GL/osmesa.h (OSMesa 11.2 and later), which the packages that voxeld needs do not
// install.
constexpr int kOsmesaFormat = 0x22;
constexpr int kOsmesaDepthBits = 0x30;
constexpr int kOsmesaProfile = 0x33;
constexpr int kOsmesaCoreProfile = 0x34;
constexpr int kOsmesaMajorVersion = 0x36;
constexpr int kOsmesaMinorVersion = 0x37;

using OsmesaContext = void*;
using CreateContextAttribs = OsmesaContext (*)(const int* attributes, OsmesaContext share);
using DestroyContext = void (*)(OsmesaContext);
using MakeCurrent = GLboolean (*)(OsmesaContext, void* buffer, GLenum type, GLsizei width,
                                  GLsizei height);
using GetCurrentContext = OsmesaContext (*)();
using GetProcAddress = GlProc (*)(const char*);

struct OsmesaLibrary {
  void* handle = nullptr;
  CreateContextAttribs create_context_attribs = nullptr;
  DestroyContext destroy_context = nullptr;
  MakeCurrent make_current = nullptr;
  GetCurrentContext current_context = nullptr;
  GetProcAddress proc_address = nullptr;
};

Error osmesa_unavailable(std::string what) {
  return Error{ErrorCode::kDeviceUnavailable, "osmesa: " + std::move(what), "", ""};
}

// The library is never closed, because Mesa keeps thread-local state that outlives any context.
Result<OsmesaLibrary> load_library() {
  OsmesaLibrary library;
  library.handle = ::dlopen("libOSMesa.so.8", RTLD_NOW | RTLD_LOCAL);
  if (library.handle == nullptr) {
    return osmesa_unavailable(std::string("cannot load libOSMesa.so.8 (package libosmesa6): ") +
                              ::dlerror());
  }
  const auto symbol = [&](const char* name) { return ::dlsym(library.handle, name); };
  library.create_context_attribs =
      reinterpret_cast<CreateContextAttribs>(symbol("OSMesaCreateContextAttribs"));
  library.destroy_context = reinterpret_cast<DestroyContext>(symbol("OSMesaDestroyContext"));
  library.make_current = reinterpret_cast<MakeCurrent>(symbol("OSMesaMakeCurrent"));
  library.current_context = reinterpret_cast<GetCurrentContext>(symbol("OSMesaGetCurrentContext"));
  library.proc_address = reinterpret_cast<GetProcAddress>(symbol("OSMesaGetProcAddress"));
  if (!library.create_context_attribs || !library.destroy_context || !library.make_current ||
      !library.current_context || !library.proc_address) {
    return osmesa_unavailable("libOSMesa.so.8 lacks functions of OSMesa 11.2");
  }
  return library;
}

class OsmesaBackend final : public Context {
 public:
  explicit OsmesaBackend(const OsmesaLibrary& library) : library_(library) {}
  ~OsmesaBackend() override {
    if (context_ == nullptr) return;
    if (library_.current_context() == context_) {
      library_.make_current(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0);
    }
    library_.destroy_context(context_);
  }

  Status open(const DeviceId& device) {
    const std::array attributes = {kOsmesaFormat,
                                   static_cast<int>(GL_RGBA),
                                   kOsmesaProfile,
                                   kOsmesaCoreProfile,
                                   kOsmesaMajorVersion,
                                   4,
                                   kOsmesaMinorVersion,
                                   5,
                                   kOsmesaDepthBits,
                                   0,
                                   0};
    context_ = library_.create_context_attribs(attributes.data(), nullptr);
    if (context_ == nullptr) return osmesa_unavailable("refused an OpenGL 4.5 core context");
    VOXELD_TRY(make_current());
    is_debug_ = gl_debug_wanted();
    info_.backend = "OSMesa";
    return finish_setup(device, [this](const char* name) { return library_.proc_address(name); });
  }

  Status make_current() const override {
    if (!library_.make_current(context_, window_.data(), GL_UNSIGNED_BYTE, kWindowSide,
                               kWindowSide)) {
      return osmesa_unavailable("OSMesaMakeCurrent failed");
    }
    return {};
  }

 private:
  // OSMesa requires a window buffer, but every pass draws to its own framebuffer object.
  static constexpr size_t kWindowSide = 16;
  OsmesaLibrary library_;
  OsmesaContext context_ = nullptr;
  mutable std::array<uint8_t, 4 * kWindowSide * kWindowSide> window_{};
};

}  // namespace

Result<std::unique_ptr<Context>> create_osmesa_context(const DeviceId& device) {
  ScopedEnvironment environment;
  set_mesa_software_environment(environment);
  VOXELD_ASSIGN(const OsmesaLibrary library, load_library());
  auto context = std::make_unique<OsmesaBackend>(library);
  VOXELD_TRY(context->open(device));
  return std::unique_ptr<Context>(std::move(context));
}

}  // namespace voxeld::gpu
