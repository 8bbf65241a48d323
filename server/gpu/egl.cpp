#include "server/gpu/egl.h"

#define EGL_EGL_PROTOTYPES 0
#define EGL_EGLEXT_PROTOTYPES 0
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <dlfcn.h>

#include <algorithm>
#include <cstdio>
#include <mutex>
#include <string_view>
#include <utility>

#include "server/device/missing_driver.h"
#include "server/device/workarounds.h"
#include "server/gpu/environment.h"

namespace voxeld::gpu {
namespace {

// X(type, name without egl)
#define VOXELD_EGL_FUNCTIONS(X)                             \
  X(PFNEGLBINDAPIPROC, BindAPI)                             \
  X(PFNEGLCHOOSECONFIGPROC, ChooseConfig)                   \
  X(PFNEGLCREATECONTEXTPROC, CreateContext)                 \
  X(PFNEGLDESTROYCONTEXTPROC, DestroyContext)               \
  X(PFNEGLGETCURRENTCONTEXTPROC, GetCurrentContext)         \
  X(PFNEGLGETERRORPROC, GetError)                           \
  X(PFNEGLGETPLATFORMDISPLAYEXTPROC, GetPlatformDisplayEXT) \
  X(PFNEGLINITIALIZEPROC, Initialize)                       \
  X(PFNEGLMAKECURRENTPROC, MakeCurrent)                     \
  X(PFNEGLQUERYSTRINGPROC, QueryString)

struct Egl {
  PFNEGLGETPROCADDRESSPROC GetProcAddress = nullptr;
#define VOXELD_EGL_MEMBER(type, name) type name = nullptr;
  VOXELD_EGL_FUNCTIONS(VOXELD_EGL_MEMBER)
#undef VOXELD_EGL_MEMBER
  // Extensions; null if the library lacks them.
  PFNEGLQUERYDEVICESEXTPROC QueryDevicesEXT = nullptr;
  PFNEGLQUERYDEVICESTRINGEXTPROC QueryDeviceStringEXT = nullptr;
};

#ifndef EGL_RENDERER_EXT
#define EGL_RENDERER_EXT 0x335F
#endif
#ifndef EGL_DRM_RENDER_NODE_FILE_EXT
#define EGL_DRM_RENDER_NODE_FILE_EXT 0x3377
#endif

struct EglErrorName {
  EGLint code;
  std::string_view text;
};
constexpr EglErrorName kEglErrors[] = {
    {EGL_SUCCESS, "no error reported"},
    {EGL_NOT_INITIALIZED, "EGL_NOT_INITIALIZED: no driver opened the device"},
    {EGL_BAD_ACCESS, "EGL_BAD_ACCESS: the device or context is in use elsewhere"},
    {EGL_BAD_ALLOC, "EGL_BAD_ALLOC: the driver is out of memory or other resources"},
    {EGL_BAD_ATTRIBUTE, "EGL_BAD_ATTRIBUTE: the driver does not know an attribute"},
    {EGL_BAD_CONFIG, "EGL_BAD_CONFIG"},
    {EGL_BAD_CONTEXT, "EGL_BAD_CONTEXT"},
    {EGL_BAD_DISPLAY, "EGL_BAD_DISPLAY: there is no such display"},
    {EGL_BAD_MATCH, "EGL_BAD_MATCH: the driver has no such version of OpenGL"},
    {EGL_BAD_PARAMETER, "EGL_BAD_PARAMETER"},
    {EGL_CONTEXT_LOST, "EGL_CONTEXT_LOST: the device was reset"}};

std::string egl_error_text(EGLint code) {
  char number[16];
  std::snprintf(number, sizeof number, "0x%x", static_cast<unsigned>(code));
  for (const EglErrorName& one : kEglErrors) {
    if (one.code == code) return std::string(number) + " (" + std::string(one.text) + ")";
  }
  return number;
}

Error egl_unavailable(std::string what) {
  return Error{ErrorCode::kDeviceUnavailable, std::move(what), "", ""};
}

bool has_word(std::string_view words, std::string_view wanted) {
  while (!words.empty()) {
    const size_t space = words.find(' ');
    if (words.substr(0, space) == wanted) return true;
    words = space == std::string_view::npos ? std::string_view{} : words.substr(space + 1);
  }
  return false;
}

std::string_view or_empty(const char* text) {
  return text == nullptr ? "" : text;
}

// The library is never closed, because drivers keep threads and thread-local state.
Result<Egl> load_egl() {
  void* handle = ::dlopen("libEGL.so.1", RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    return egl_unavailable(std::string("cannot load libEGL.so.1 (package libegl1): ") +
                           ::dlerror());
  }
  Egl egl;
  egl.GetProcAddress =
      reinterpret_cast<PFNEGLGETPROCADDRESSPROC>(::dlsym(handle, "eglGetProcAddress"));
  if (egl.GetProcAddress == nullptr) return egl_unavailable("libEGL.so.1 has no eglGetProcAddress");
#define VOXELD_EGL_LOAD(type, name)                                                  \
  egl.name = reinterpret_cast<type>(::dlsym(handle, "egl" #name));                   \
  if (!egl.name) egl.name = reinterpret_cast<type>(egl.GetProcAddress("egl" #name)); \
  if (!egl.name) return egl_unavailable("libEGL.so.1 has no egl" #name);
  VOXELD_EGL_FUNCTIONS(VOXELD_EGL_LOAD)
#undef VOXELD_EGL_LOAD
  const std::string_view extensions = or_empty(egl.QueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS));
  if (has_word(extensions, "EGL_EXT_device_enumeration") ||
      has_word(extensions, "EGL_EXT_device_base")) {
    egl.QueryDevicesEXT =
        reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(egl.GetProcAddress("eglQueryDevicesEXT"));
    egl.QueryDeviceStringEXT = reinterpret_cast<PFNEGLQUERYDEVICESTRINGEXTPROC>(
        egl.GetProcAddress("eglQueryDeviceStringEXT"));
  }
  return egl;
}

struct FoundDevice {
  EGLDeviceEXT handle = EGL_NO_DEVICE_EXT;
  EglDevice about;
};

// "/dev/dri/renderD128" or "/dev/dri/card0"; empty if EGL names neither.
std::string drm_file(const Egl& egl, EGLDeviceEXT handle, std::string_view extensions) {
  std::string_view file;
  if (has_word(extensions, "EGL_EXT_device_drm_render_node")) {
    file = or_empty(egl.QueryDeviceStringEXT(handle, EGL_DRM_RENDER_NODE_FILE_EXT));
  }
  if (file.empty() && has_word(extensions, "EGL_EXT_device_drm")) {
    file = or_empty(egl.QueryDeviceStringEXT(handle, EGL_DRM_DEVICE_FILE_EXT));
  }
  return std::string(file);
}

EglDevice describe(const Egl& egl, EGLDeviceEXT handle) {
  EglDevice about;
  if (egl.QueryDeviceStringEXT == nullptr) return about;
  const std::string_view extensions = or_empty(egl.QueryDeviceStringEXT(handle, EGL_EXTENSIONS));
  about.is_software = has_word(extensions, "EGL_MESA_device_software");
  if (has_word(extensions, "EGL_EXT_device_query_name")) {
    about.description = or_empty(egl.QueryDeviceStringEXT(handle, EGL_RENDERER_EXT));
  }
  const std::string file = drm_file(egl, handle, extensions);
  if (!file.empty()) about.address = pci_address_of(file);
  if (about.description.empty()) about.description = file;
  if (about.description.empty()) {
    about.description = about.is_software ? "Mesa software device" : "unnamed device";
  }
  return about;
}

std::vector<FoundDevice> find_devices(const Egl& egl) {
  std::vector<FoundDevice> found;
  EGLint count = 0;
  if (egl.QueryDevicesEXT == nullptr || !egl.QueryDevicesEXT(0, nullptr, &count)) return found;
  std::vector<EGLDeviceEXT> handles(static_cast<size_t>(count));
  if (!egl.QueryDevicesEXT(count, handles.data(), &count)) return found;
  handles.resize(static_cast<size_t>(count));
  for (EGLDeviceEXT handle : handles) found.push_back({handle, describe(egl, handle)});
  std::stable_sort(found.begin(), found.end(), [](const FoundDevice& a, const FoundDevice& b) {
    const EglDevice &x = a.about, &y = b.about;
    if (x.is_software != y.is_software) return y.is_software;
    if (x.address && y.address) return *x.address < *y.address;
    return x.address.has_value() && !y.address;
  });
  return found;
}

// The kind of Mesa driver in this process. Mesa reads it from the environment once, and keeps it
// and the displays for the life of the process.
enum class MesaChoice { kNone, kByDevice, kLlvmpipe, kZink };

std::mutex g_mesa_mutex;
MesaChoice g_mesa_choice = MesaChoice::kNone;  // guarded by g_mesa_mutex

MesaChoice choice_of(DeviceKind kind) {
  switch (kind) {
    case DeviceKind::kLlvmpipe:
      return MesaChoice::kLlvmpipe;
    case DeviceKind::kLavapipe:
      return MesaChoice::kZink;
    default:
      return MesaChoice::kByDevice;
  }
}

std::string_view choice_name(MesaChoice choice) {
  switch (choice) {
    case MesaChoice::kLlvmpipe:
      return "llvmpipe";
    case MesaChoice::kZink:
      return "lavapipe";
    default:
      return "a Mesa device by number";
  }
}

Status claim_mesa(const DeviceId& device) {
  const std::lock_guard lock(g_mesa_mutex);
  const MesaChoice wanted = choice_of(device.kind);
  if (g_mesa_choice != MesaChoice::kNone && g_mesa_choice != wanted) {
    return egl_unavailable(device_name(device) + " cannot be opened: this process has opened " +
                           std::string(choice_name(g_mesa_choice)) +
                           ", and Mesa loads one EGL driver per process");
  }
  g_mesa_choice = wanted;
  return {};
}

void set_environment(const DeviceId& device, ScopedEnvironment& environment) {
  if (device.kind == DeviceKind::kEgl) return;
  set_mesa_software_environment(environment);
  environment.set("LIBGL_ALWAYS_SOFTWARE", "1");
  if (device.kind == DeviceKind::kLavapipe) {
    environment.set("MESA_LOADER_DRIVER_OVERRIDE", "zink");
    if (workaround_enabled(Workaround::kZinkStaleUniforms)) {
      environment.set("ZINK_INLINE_UNIFORMS", "0");
    }
  } else {
    environment.unset("MESA_LOADER_DRIVER_OVERRIDE");
    environment.unset("GALLIUM_DRIVER");
  }
}

class EglBackend final : public Context {
 public:
  explicit EglBackend(const Egl& egl) : egl_(egl) {}
  ~EglBackend() override { close(); }

  // The error names what failed; the caller then tries the next platform.
  Status open(const DeviceId& device, EGLDisplay display, std::string_view platform) {
    display_ = display;
    EGLint major = 0, minor = 0;
    if (display == EGL_NO_DISPLAY || !egl_.Initialize(display, &major, &minor)) {
      return failed(device, platform, "eglInitialize");
    }
    const std::string vendor(or_empty(egl_.QueryString(display, EGL_VENDOR)));
    if (vendor.find("Mesa") != std::string::npos) VOXELD_TRY(claim_mesa(device));
    if (!egl_.BindAPI(EGL_OPENGL_API)) return failed(device, platform, "eglBindAPI(OpenGL)");
    VOXELD_TRY(create_context(device, platform));
    VOXELD_TRY(make_current());
    info_.backend = "EGL " + std::to_string(major) + "." + std::to_string(minor) + " " + vendor +
                    ", " + std::string(platform);
    return finish_setup(device, [this](const char* name) { return egl_.GetProcAddress(name); });
  }

  void set_address(const std::optional<PciAddress>& address) {
    if (address) info_.pci_address = pci_address_text(*address);
  }

  Status make_current() const override {
    // libEGL returns at once if it believes that the context is already current. It does not notice
    // an OSMesa context that was bound in between. Unbinding first forces it to bind.
    egl_.MakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (!egl_.MakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_)) {
      return failed(info_.device, "current context", "eglMakeCurrent");
    }
    return {};
  }

 private:
  Error failed(const DeviceId& device, std::string_view platform, std::string_view call) const {
    return egl_unavailable(device_name(device) + ": " + std::string(call) + " failed on the " +
                           std::string(platform) + " with " + egl_error_text(egl_.GetError()));
  }

  Status create_context(const DeviceId& device, std::string_view platform) {
    const std::string_view extensions = or_empty(egl_.QueryString(display_, EGL_EXTENSIONS));
    EGLConfig config = EGL_NO_CONFIG_KHR;
    if (!has_word(extensions, "EGL_KHR_no_config_context")) {
      const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
      EGLint count = 0;
      if (!egl_.ChooseConfig(display_, wanted, &config, 1, &count) || count == 0) {
        return failed(device, platform, "eglChooseConfig");
      }
    }
    is_debug_ = gl_debug_wanted();
    for (const bool robust : {true, false}) {
      std::vector<EGLint> attributes = {
          EGL_CONTEXT_MAJOR_VERSION,       4,
          EGL_CONTEXT_MINOR_VERSION,       5,
          EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT};
      if (is_debug_) attributes.insert(attributes.end(), {EGL_CONTEXT_OPENGL_DEBUG, EGL_TRUE});
      if (robust) {
        attributes.insert(attributes.end(), {EGL_CONTEXT_OPENGL_ROBUST_ACCESS, EGL_TRUE,
                                             EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY,
                                             EGL_LOSE_CONTEXT_ON_RESET});
      }
      attributes.push_back(EGL_NONE);
      context_ = egl_.CreateContext(display_, config, EGL_NO_CONTEXT, attributes.data());
      info_.is_robust = robust;
      if (context_ != EGL_NO_CONTEXT) return {};
    }
    return failed(device, platform, "eglCreateContext(OpenGL 4.5 core)");
  }

  void close() {
    if (context_ == EGL_NO_CONTEXT) return;
    if (egl_.GetCurrentContext() == context_) {
      egl_.MakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    }
    // The display stays initialized, because other contexts of the process share it.
    egl_.DestroyContext(display_, context_);
    context_ = EGL_NO_CONTEXT;
  }

  Egl egl_;
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
};

struct Candidate {
  EGLenum platform = 0;
  void* native = nullptr;
  std::string_view name;
  const EglDevice* about = nullptr;  // of an egl:N or pci:ADDRESS
};

Error no_such_device(const DeviceId& device, const std::vector<FoundDevice>& found) {
  std::string names;
  for (size_t i = 0; i < found.size(); ++i) {
    names += (names.empty() ? "egl:" : ", egl:") + std::to_string(i);
    if (const auto& address = found[i].about.address) {
      names += " (pci:" + pci_address_text(*address) + ")";
    }
  }
  return Error{ErrorCode::kDeviceUnavailable, device_name(device) + " does not exist",
               found.empty() ? "a driver that enumerates EGL devices" : names,
               std::to_string(found.size()) + " devices"};
}

Result<std::vector<Candidate>> candidates(const DeviceId& device,
                                          const std::vector<FoundDevice>& found) {
  std::vector<Candidate> all;
  constexpr Candidate kSurfaceless{EGL_PLATFORM_SURFACELESS_MESA, nullptr, "surfaceless platform"};
  if (device.kind == DeviceKind::kEgl) {
    // A GPU that two vendors' libraries list has its address twice; one of them may open it.
    for (size_t i = 0; i < found.size(); ++i) {
      const bool is_asked = device.address ? found[i].about.address == device.address
                                           : std::cmp_equal(device.index, i);
      if (is_asked) {
        all.push_back(
            {EGL_PLATFORM_DEVICE_EXT, found[i].handle, "device platform", &found[i].about});
      }
    }
    if (all.empty()) return no_such_device(device, found);
    return all;
  }
  // Only the surfaceless platform selects Zink; the software device always loads llvmpipe.
  if (device.kind == DeviceKind::kLavapipe) return std::vector{kSurfaceless};
  for (const FoundDevice& one : found) {
    if (one.about.is_software) {
      all.push_back({EGL_PLATFORM_DEVICE_EXT, one.handle, "device platform"});
    }
  }
  all.push_back(kSurfaceless);
  return all;
}

// Checks that the loaded driver is the requested one.
Status check_renderer(const DeviceId& device, const DeviceInfo& info, const EglDevice* about) {
  const bool is_zink = info.renderer.find("zink") != std::string::npos;
  if (device.kind == DeviceKind::kEgl) {
    if (!info.is_software) return {};
    return Error{ErrorCode::kDeviceUnavailable,
                 device_name(device) + " (" + about->description + ") is no GPU: " +
                     missing_driver() + "; software renderers are chosen by name, as llvmpipe",
                 "a hardware renderer", info.renderer};
  }
  const bool is_wanted =
      info.is_software && (device.kind == DeviceKind::kLavapipe ? is_zink : !is_zink);
  if (!is_wanted) {
    return Error{ErrorCode::kDeviceUnavailable, device_name(device) + ": EGL gave another driver",
                 device.kind == DeviceKind::kLavapipe
                     ? "Zink over lavapipe (packages libgl1-mesa-dri, mesa-vulkan-drivers)"
                     : "llvmpipe (package libgl1-mesa-dri)",
                 info.renderer};
  }
  return {};
}

}  // namespace

Result<std::vector<EglDevice>> enumerate_egl_devices() {
  VOXELD_ASSIGN(const Egl egl, load_egl());
  if (egl.QueryDevicesEXT == nullptr) {
    return egl_unavailable("libEGL.so.1 has no EGL_EXT_device_enumeration");
  }
  std::vector<EglDevice> devices;
  for (const FoundDevice& one : find_devices(egl)) devices.push_back(one.about);
  return devices;
}

Result<std::unique_ptr<Context>> create_egl_context(const DeviceId& device) {
  ScopedEnvironment environment;
  set_environment(device, environment);
  VOXELD_ASSIGN(const Egl egl, load_egl());
  const std::vector<FoundDevice> found = find_devices(egl);
  VOXELD_ASSIGN(const std::vector<Candidate> tries, candidates(device, found));
  Error first_error;
  for (const Candidate& candidate : tries) {
    auto context = std::make_unique<EglBackend>(egl);
    Status status = context->open(
        device, egl.GetPlatformDisplayEXT(candidate.platform, candidate.native, nullptr),
        candidate.name);
    if (status.ok()) status = check_renderer(device, context->info(), candidate.about);
    if (status.ok()) {
      if (candidate.about != nullptr) context->set_address(candidate.about->address);
      return std::unique_ptr<Context>(std::move(context));
    }
    if (&candidate == tries.data()) first_error = std::move(status).error();
  }
  return first_error;
}

}  // namespace voxeld::gpu
