// An EGL vendor library for libglvnd with three GPUs, each of which Mesa's software device plays.
// EGL lists them in the reverse order of their PCI addresses; two of them have a DRM device, of
// which sysfs knows the address. It is preloaded, too, so that readlink() is that of a machine with
// these GPUs.
#define EGL_EGLEXT_PROTOTYPES 0
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <dlfcn.h>
#include <glvnd/libeglabi.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <string_view>

#ifndef EGL_DRM_RENDER_NODE_FILE_EXT
#define EGL_DRM_RENDER_NODE_FILE_EXT 0x3377
#endif

namespace {

struct FakeGpu {
  const char* extensions;
  const char* drm_file;  // null: none
};
FakeGpu g_gpus[] = {
    {"EGL_EXT_device_query_name", nullptr},
    {"EGL_EXT_device_drm EGL_EXT_device_drm_render_node", "/dev/dri/renderD129"},
    {"EGL_EXT_device_drm EGL_EXT_device_drm_render_node", "/dev/dri/renderD128"},
};
struct SysfsLink {
  std::string_view path, target;
};
constexpr SysfsLink kLinks[] = {
    {"/sys/class/drm/renderD128/device", "../../../0000:3b:00.0"},
    {"/sys/class/drm/renderD129/device", "../../../0000:af:00.0"},
};

__EGLapiImports g_mesa;

EGLBoolean query_devices(EGLint room, EGLDeviceEXT* devices, EGLint* count) {
  *count = 0;
  for (FakeGpu& gpu : g_gpus) {
    if (devices != nullptr && *count == room) break;
    if (devices != nullptr) devices[*count] = &gpu;
    ++*count;
  }
  return EGL_TRUE;
}

const char* query_device_string(EGLDeviceEXT device, EGLint name) {
  const auto& gpu = *static_cast<const FakeGpu*>(device);
  switch (name) {
    case EGL_EXTENSIONS:
      return gpu.extensions;
    case EGL_DRM_DEVICE_FILE_EXT:
    case EGL_DRM_RENDER_NODE_FILE_EXT:
      return gpu.drm_file;
    default:
      return "a GPU without a DRM device";
  }
}

EGLDisplay platform_display(EGLenum platform, void* device, const EGLAttrib* attributes) {
  if (platform != EGL_PLATFORM_DEVICE_EXT) {
    return g_mesa.getPlatformDisplay(platform, device, attributes);
  }
  const auto mesa_devices =
      reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(g_mesa.getProcAddress("eglQueryDevicesEXT"));
  EGLDeviceEXT software = EGL_NO_DEVICE_EXT;
  EGLint count = 0;
  if (!mesa_devices(1, &software, &count) || count == 0) return EGL_NO_DISPLAY;
  return g_mesa.getPlatformDisplay(platform, software, attributes);
}

void* proc_address(const char* name) {
  const std::string_view wanted = name;
  if (wanted == "eglQueryDevicesEXT") return reinterpret_cast<void*>(query_devices);
  if (wanted == "eglQueryDeviceStringEXT") return reinterpret_cast<void*>(query_device_string);
  return g_mesa.getProcAddress(name);
}

}  // namespace

extern "C" {

EGLBoolean __egl_Main(uint32_t version, const __EGLapiExports* exports, __EGLvendorInfo* vendor,
                      __EGLapiImports* imports) {
  void* mesa = ::dlopen("libEGL_mesa.so.0", RTLD_NOW | RTLD_LOCAL);
  if (mesa == nullptr) return EGL_FALSE;
  const auto mesa_main = reinterpret_cast<decltype(&__egl_Main)>(::dlsym(mesa, "__egl_Main"));
  if (mesa_main == nullptr || !mesa_main(version, exports, vendor, imports)) return EGL_FALSE;
  g_mesa = *imports;
  imports->getProcAddress = proc_address;
  imports->getPlatformDisplay = platform_display;
  return EGL_TRUE;
}

ssize_t readlink(const char* path, char* buffer, size_t room) {
  for (const SysfsLink& link : kLinks) {
    if (link.path != path) continue;
    const size_t bytes = link.target.size() < room ? link.target.size() : room;
    std::memcpy(buffer, link.target.data(), bytes);
    return static_cast<ssize_t>(bytes);
  }
  using Readlink = ssize_t (*)(const char*, char*, size_t);
  static const auto real = reinterpret_cast<Readlink>(::dlsym(RTLD_NEXT, "readlink"));
  return real(path, buffer, room);
}

}  // extern "C"
