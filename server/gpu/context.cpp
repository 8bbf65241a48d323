#include "server/gpu/context.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <thread>

#include "server/base/check.h"
#include "server/base/log.h"
#include "server/device/workarounds.h"
#include "server/gpu/egl.h"
#include "server/gpu/osmesa.h"

namespace voxeld::gpu {
namespace {

constexpr int kGlMajor = 4, kGlMinor = 5;
constexpr int64_t kMesaSoftwareLoopIterationsMax = 65535;

Error unavailable(const DeviceId& device, const std::string& what, std::string expected = "",
                  std::string got = "") {
  return Error{ErrorCode::kDeviceUnavailable, device_name(device) + ": " + what,
               std::move(expected), std::move(got)};
}

std::string get_string(const GlApi& gl, GLenum name) {
  const GLubyte* text = gl.GetString(name);
  return text == nullptr ? "" : reinterpret_cast<const char*>(text);
}

bool has_extension(const GlApi& gl, std::string_view wanted) {
  GLint count = 0;
  gl.GetIntegerv(GL_NUM_EXTENSIONS, &count);
  for (GLint i = 0; i < count; ++i) {
    const GLubyte* name = gl.GetStringi(GL_EXTENSIONS, static_cast<GLuint>(i));
    if (name != nullptr && wanted == reinterpret_cast<const char*>(name)) return true;
  }
  return false;
}

int get_int(const GlApi& gl, GLenum name) {
  GLint value = 0;
  gl.GetIntegerv(name, &value);
  return value;
}

int64_t get_int64(const GlApi& gl, GLenum name) {
  GLint64 value = 0;
  gl.GetInteger64v(name, &value);
  return value;
}

bool has_timer_queries(const GlApi& gl, bool is_software) {
  if (is_software && workaround_enabled(Workaround::kTimerQueryZero)) return false;
  GLint bits = 0;
  gl.GetQueryiv(GL_TIME_ELAPSED, GL_QUERY_COUNTER_BITS, &bits);
  return bits >= 30;  // 30 bits of nanoseconds are one second, the limit of a pass
}

void read_limits(const GlApi& gl, DeviceInfo& info) {
  info.ssbo_bytes_max = get_int64(gl, GL_MAX_SHADER_STORAGE_BLOCK_SIZE);
  info.ssbo_bindings_max = get_int(gl, GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS);
  info.ubo_bytes_max = get_int(gl, GL_MAX_UNIFORM_BLOCK_SIZE);
  info.texture_side_max = get_int(gl, GL_MAX_TEXTURE_SIZE);
  info.texture3d_side_max = get_int(gl, GL_MAX_3D_TEXTURE_SIZE);
  info.framebuffer_side_max =
      std::min(get_int(gl, GL_MAX_FRAMEBUFFER_WIDTH), get_int(gl, GL_MAX_FRAMEBUFFER_HEIGHT));
  GLint groups = 0;
  gl.GetIntegeri_v(GL_MAX_COMPUTE_WORK_GROUP_COUNT, 0, &groups);
  info.dispatch_groups_max = groups;
  const bool is_mesa = info.version.find("Mesa") != std::string::npos;
  if (info.is_software && is_mesa && workaround_enabled(Workaround::kLoopIterations65535)) {
    info.loop_iterations_max = kMesaSoftwareLoopIterationsMax;
  }
}

void APIENTRY log_message(GLenum /*source*/, GLenum type, GLuint id, GLenum severity,
                          GLsizei /*length*/, const GLchar* message, const void* /*user*/) {
  if (severity == GL_DEBUG_SEVERITY_NOTIFICATION) return;
  const auto level = type == GL_DEBUG_TYPE_ERROR ? log::Level::kError : log::Level::kWarn;
  log::write(level, "gl message", {{"id", static_cast<long long>(id)}, {"text", message}});
}

}  // namespace

Result<std::unique_ptr<Context>> Context::create(const DeviceId& device) {
  if (device.kind == DeviceKind::kCpu) {
    return Error{ErrorCode::kDeviceUnavailable, "device cpu has no OpenGL context",
                 "egl:N, llvmpipe, lavapipe or osmesa", "cpu"};
  }
  if (device.kind == DeviceKind::kOsmesa) return create_osmesa_context(device);
  return create_egl_context(device);
}

Status Context::finish_setup(const DeviceId& device, const GetGlProc& get_proc) {
  VOXELD_ASSIGN(gl_, load_gl_api(get_proc));
  const int major = get_int(gl_, GL_MAJOR_VERSION), minor = get_int(gl_, GL_MINOR_VERSION);
  info_.device = device;
  info_.vendor = get_string(gl_, GL_VENDOR);
  info_.renderer = get_string(gl_, GL_RENDERER);
  info_.version = get_string(gl_, GL_VERSION);
  info_.glsl_version = get_string(gl_, GL_SHADING_LANGUAGE_VERSION);
  if (major < kGlMajor || (major == kGlMajor && minor < kGlMinor)) {
    return unavailable(device, info_.renderer + " is too old", "OpenGL 4.5 core",
                       std::to_string(major) + "." + std::to_string(minor));
  }
  info_.is_software = is_software_renderer(info_.renderer);
  info_.has_int64 = has_extension(gl_, "GL_ARB_gpu_shader_int64");
  info_.has_float64 = has_extension(gl_, "GL_ARB_gpu_shader_fp64");
  // Software drivers have no memory of a device. That of Mesa 25 has the extension, with numbers of
  // uninitialized variables.
  if (info_.is_software) {
    memory_source_ = MemorySource::kNone;
  } else if (has_extension(gl_, "GL_NVX_gpu_memory_info")) {
    memory_source_ = MemorySource::kNvx;
  } else if (has_extension(gl_, "GL_ATI_meminfo")) {
    memory_source_ = MemorySource::kAti;
    ati_bytes_at_start_ = memory().bytes_free;  // the extension does not report the total
  }
  info_.has_timer_queries = has_timer_queries(gl_, info_.is_software);
  read_limits(gl_, info_);
  if (is_debug_) {
    gl_.Enable(GL_DEBUG_OUTPUT);
    gl_.Enable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
    gl_.DebugMessageCallback(log_message, nullptr);
  }
  gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl_.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  return check("opening " + device_name(device));
}

MemoryInfo Context::memory() const {
  // GL_NVX_gpu_memory_info (2013) and GL_ATI_meminfo (2009), both in KiB.
  constexpr GLenum kNvxDedicated = 0x9047, kNvxCurrentAvailable = 0x9049, kAtiTextureFree = 0x87FC;
  constexpr int64_t kKibi = 1024;
  if (is_lost_ || memory_source_ == MemorySource::kNone) return {};
  if (memory_source_ == MemorySource::kNvx) {
    GLint total = 0, available = 0;
    gl_.GetIntegerv(kNvxDedicated, &total);
    gl_.GetIntegerv(kNvxCurrentAvailable, &available);
    return {total * kKibi, available * kKibi};
  }
  std::array<GLint, 4> pools{};  // total free, largest free block, the same of auxiliary memory
  gl_.GetIntegerv(kAtiTextureFree, pools.data());
  return {ati_bytes_at_start_, pools[0] * kKibi};
}

Status Context::check(std::string_view where) const {
  const auto lost = [&] {
    return Error{ErrorCode::kDeviceUnavailable,
                 std::string(where) + ": " + device_name(info_.device) + " (" + info_.renderer +
                     "): the device was reset",
                 "", ""};
  };
  // The robustness extension reports each error once, but later callers must get it too.
  if (is_lost_) return lost();
  const GLenum error = gl_.GetError();
  // A driver may notice a reset only when it is asked. Until then commands report no error, but
  // what they read is not what was computed.
  const GLenum reset = gl_.GetGraphicsResetStatus();
  if (error == GL_NO_ERROR && reset == GL_NO_ERROR) return {};
  if (error == GL_CONTEXT_LOST || reset != GL_NO_ERROR) {
    is_lost_ = true;
    return lost();
  }
  // Errors queue up. The first is the cause; the others must not be blamed on a later pass. A
  // context that is lost meanwhile reports GL_CONTEXT_LOST for ever, so the loop is bounded.
  for (int i = 0; i < 16 && gl_.GetError() != GL_NO_ERROR; ++i) {
  }
  const std::string detail = std::string(where) + ": " + gl_error_name(error) + " on " +
                             device_name(info_.device) + " (" + info_.renderer + ")";
  if (error == GL_OUT_OF_MEMORY) {
    return Error{ErrorCode::kDeviceUnavailable, detail + ": out of device memory", "", ""};
  }
  VOXELD_CHECK(!is_debug_, detail);
  return Error{ErrorCode::kInternal, detail, "", ""};
}

bool gl_debug_wanted() {
  const char* value = std::getenv("VOXELD_GL_DEBUG");
  return value != nullptr && std::string_view(value) == "1";
}

}  // namespace voxeld::gpu
