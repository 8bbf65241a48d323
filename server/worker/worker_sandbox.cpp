#include "server/worker/worker_sandbox.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <system_error>
#include <vector>

#include "server/base/log.h"
#include "server/process/sandbox.h"
#include "server/voxel/estimates/calibration.h"
#include "server/worker/device/self_test_record.h"
#include "server/worker/driver_files.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;
using Access = FileRule::Access;

// Variables of shader cache folders. Each worker gets its own: a hijacked one could otherwise leave
// shaders for the next.
constexpr std::array kCacheVariables = {"MESA_SHADER_CACHE_DIR", "__GL_SHADER_DISK_CACHE_PATH"};

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
    rules.push_back({data_dir / kSelfTestFileName, Access::kRead});
  }
  if (!shader_dir.empty()) rules.push_back({shader_dir, Access::kRead});
  rules.push_back({folders.scratch_dir, Access::kOutput});
  rules.push_back({folders.input_dir, Access::kRead});
  rules.push_back({folders.cache_dir, Access::kOutput});
  for (const char* variable : kCacheVariables) {
    if (!folders.cache_dir.empty()) ::setenv(variable, folders.cache_dir.c_str(), 1);
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

Error WorkerSandbox::suspected(Error error, const std::string& device) const {
  if (mode_ == SandboxMode::kOff) return error;
  error.detail += "; the sandbox may keep a file or system call from the driver (`" +
                  refusals_command(device) + "` lists what failed, --sandbox off works without)";
  return error;
}

std::string refusals_command(const std::string& device) {
  return "strace -f -Z voxeld probe-device --device " + device;
}

std::string WorkerSandbox::level() const {
  if (mode_ == SandboxMode::kOff) return "off";
  return missing_.empty() ? "full" : missing_;
}

}  // namespace voxeld
