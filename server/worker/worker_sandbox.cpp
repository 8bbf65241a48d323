#include "server/worker/worker_sandbox.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <system_error>
#include <vector>

#include "server/base/log.h"
#include "server/process/sandbox.h"
#include "server/voxel/estimates/calibration.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;
using Access = FileRule::Access;

// Paths that the loader, libEGL, Mesa, Vulkan's loader and NVIDIA's libraries read.
constexpr std::array kReadPaths = {"/usr/lib",
                                   "/usr/lib32",
                                   "/usr/lib64",
                                   "/usr/local/lib",
                                   "/usr/share/glvnd",
                                   "/usr/share/egl",
                                   "/usr/share/drirc.d",
                                   "/usr/share/vulkan",
                                   "/usr/share/libdrm",
                                   "/usr/share/nvidia",
                                   "/usr/share/zoneinfo",
                                   "/lib",
                                   "/lib64",
                                   "/etc/ld.so.cache",
                                   "/etc/ld.so.preload",
                                   "/etc/drirc",
                                   "/etc/egl",
                                   "/etc/glvnd",
                                   "/etc/localtime",
                                   "/etc/nvidia",
                                   "/etc/ssl/openssl.cnf",
                                   "/etc/vulkan",
                                   "/sys/bus",
                                   "/sys/class/drm",
                                   "/sys/dev",
                                   "/sys/devices",
                                   "/sys/module",
                                   "/proc/self",
                                   "/proc/cpuinfo",
                                   "/proc/devices",
                                   "/proc/driver",
                                   "/proc/filesystems",
                                   "/proc/meminfo",
                                   "/proc/modules",
                                   "/proc/stat",
                                   "/proc/sys/kernel",
                                   "/proc/sys/vm",
                                   "/proc/version"};
// clear_refs: server/base/host_memory resets the peak of the process there.
constexpr std::array kReadWritePaths = {"/proc/self/clear_refs", "/dev/full",    "/dev/null",
                                        "/dev/random",           "/dev/urandom", "/dev/zero"};
constexpr std::array kDevicePaths = {"/dev/dri", "/dev/kfd"};
constexpr std::string_view kNvidiaPrefix = "nvidia";  // /dev/nvidia0, /dev/nvidiactl, …

// Variables by which an operator names drivers of their own.
constexpr std::array kPathVariables = {"LD_LIBRARY_PATH",
                                       "LIBGL_DRIVERS_PATH",
                                       "VK_ADD_DRIVER_FILES",
                                       "VK_DRIVER_FILES",
                                       "VK_ICD_FILENAMES",
                                       "__EGL_VENDOR_LIBRARY_DIRS",
                                       "__EGL_VENDOR_LIBRARY_FILENAMES"};

// Variables of shader cache folders. Each worker gets its own: a hijacked one could otherwise leave
// shaders for the next.
constexpr std::array kCacheVariables = {"MESA_SHADER_CACHE_DIR", "__GL_SHADER_DISK_CACHE_PATH"};

void add_variable_paths(const char* variable, std::vector<FileRule>& rules) {
  const char* value = std::getenv(variable);
  std::string_view list = value == nullptr ? "" : value;
  while (!list.empty()) {
    const size_t colon = list.find(':');
    const std::string_view one = list.substr(0, colon);
    if (one.starts_with('/')) rules.push_back({one, Access::kRead});
    list = colon == std::string_view::npos ? std::string_view{} : list.substr(colon + 1);
  }
}

std::vector<FileRule> driver_rules() {
  std::vector<FileRule> rules;
  rules.reserve(kReadPaths.size() + kReadWritePaths.size() + kDevicePaths.size());
  for (const char* path : kReadPaths) rules.push_back({path, Access::kRead});
  for (const char* path : kReadWritePaths) rules.push_back({path, Access::kReadWrite});
  for (const char* path : kDevicePaths) rules.push_back({path, Access::kDevice});
  for (const char* variable : kPathVariables) add_variable_paths(variable, rules);
  std::error_code failed;
  for (fs::directory_iterator it("/dev", failed), end; !failed && it != end; it.increment(failed)) {
    if (it->path().filename().string().starts_with(kNvidiaPrefix)) {
      rules.push_back({it->path(), Access::kDevice});
    }
  }
  return rules;
}

bool is_beneath(const fs::path& path, const fs::path& folder) {
  const auto [folder_end, rest] =
      std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
  return folder_end == folder.end();
}

// Checks that paths opened for drivers do not contain the tenants' files.
Status check_apart(const std::vector<FileRule>& rules, const fs::path& data_dir) {
  std::error_code failed;
  const fs::path data = fs::canonical(data_dir, failed);
  for (const FileRule& rule : rules) {
    if (failed || !is_beneath(data, fs::weakly_canonical(rule.path, failed))) continue;
    return Error{ErrorCode::kDeviceUnavailable,
                 "the data directory " + data.string() + " is in a folder that drivers read",
                 "outside of " + rule.path.string(), data.string()};
  }
  return {};
}

}  // namespace

SandboxMode sandbox_mode(std::string_view text) {
  if (text == "off") return SandboxMode::kOff;
  return text == "require" ? SandboxMode::kRequire : SandboxMode::kAuto;
}

std::string sandbox_support() {
  if (landlock_abi() == 0) return "no Landlock in this kernel: workers can read other files";
  return seccomp_available() ? "full" : "no seccomp in this kernel: workers can do any system call";
}

Status WorkerSandbox::lacks(const Error& error) {
  if (mode_ == SandboxMode::kRequire) {
    return Error{ErrorCode::kDeviceUnavailable, "--sandbox require: " + error.message(), "", ""};
  }
  log::warn("the worker is not isolated as it should be", {{"missing", error.message()}});
  missing_ += (missing_.empty() ? "" : "; ") + error.message();
  return {};
}

Status WorkerSandbox::restrict_to(const WorkerFolders& folders, const fs::path& data_dir,
                                  const fs::path& shader_dir) {
  if (mode_ == SandboxMode::kOff) return {};
  std::vector<FileRule> rules = driver_rules();
  if (!data_dir.empty()) {
    if (Status apart = check_apart(rules, data_dir); !apart) VOXELD_TRY(lacks(apart.error()));
    rules.push_back({data_dir / kCalibrationFileName, Access::kRead});
  }
  if (!shader_dir.empty()) rules.push_back({shader_dir, Access::kRead});
  rules.push_back({folders.scratch_dir, Access::kOutput});
  rules.push_back({folders.input_dir, Access::kRead});
  rules.push_back({folders.cache_dir, Access::kOutput});
  for (const char* variable : kCacheVariables) {
    ::setenv(variable, folders.cache_dir.c_str(), 1);
  }
  if (Status restricted = restrict_files(rules); !restricted) return lacks(restricted.error());
  return {};
}

Status WorkerSandbox::close() {
  if (mode_ == SandboxMode::kOff) return {};
  if (Status limited = restrict_resources(); !limited) VOXELD_TRY(lacks(limited.error()));
  if (Status restricted = restrict_calls(); !restricted) VOXELD_TRY(lacks(restricted.error()));
  return {};
}

std::string WorkerSandbox::level() const {
  if (mode_ == SandboxMode::kOff) return "off";
  return missing_.empty() ? "full" : missing_;
}

}  // namespace voxeld
