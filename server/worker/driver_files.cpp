#include "server/worker/driver_files.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <system_error>

#include "server/base/disk/file.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
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
                                   "/opt/amdgpu",
                                   "/opt/amdgpu-pro",
                                   "/run/opengl-driver",
                                   "/run/opengl-driver-32",
                                   "/nix/store",
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
constexpr std::array kDevicePaths = {"/dev/dri", "/dev/kfd", "/dev/dxg"};
constexpr std::string_view kNvidiaPrefix = "nvidia";  // /dev/nvidia0, /dev/nvidiactl, …
constexpr const char* kSharedMemoryPath = "/dev/shm";

// Folders of manifests: Vulkan's drivers, and libglvnd's drivers for EGL.
constexpr std::array kManifestFolders = {"/usr/share/vulkan/icd.d",
                                         "/usr/local/share/vulkan/icd.d",
                                         "/usr/local/etc/vulkan/icd.d",
                                         "/etc/vulkan/icd.d",
                                         "/run/opengl-driver/share/vulkan/icd.d",
                                         "/usr/share/glvnd/egl_vendor.d",
                                         "/etc/glvnd/egl_vendor.d",
                                         "/run/opengl-driver/share/glvnd/egl_vendor.d"};

// A variable by which an operator names drivers of their own.
struct PathVariable {
  const char* name;
  const char* below;   // the folder of manifests beneath each path of the list
  bool has_manifests;  // else folders of libraries
};
constexpr std::array kPathVariables = {PathVariable{"LD_LIBRARY_PATH", "", false},
                                       PathVariable{"LIBGL_DRIVERS_PATH", "", false},
                                       PathVariable{"VK_ADD_DRIVER_FILES", "", true},
                                       PathVariable{"VK_DRIVER_FILES", "", true},
                                       PathVariable{"VK_ICD_FILENAMES", "", true},
                                       PathVariable{"__EGL_VENDOR_LIBRARY_DIRS", "", true},
                                       PathVariable{"__EGL_VENDOR_LIBRARY_FILENAMES", "", true},
                                       PathVariable{"XDG_CONFIG_DIRS", "vulkan/icd.d", true},
                                       PathVariable{"XDG_CONFIG_HOME", "vulkan/icd.d", true},
                                       PathVariable{"XDG_DATA_DIRS", "vulkan/icd.d", true},
                                       PathVariable{"XDG_DATA_HOME", "vulkan/icd.d", true}};

// Longer manifests are skipped; the longest that drivers bring have some 300 bytes.
constexpr uintmax_t kManifestBytesMax = 64 << 10;

// The absolute paths of a variable's list.
std::vector<fs::path> paths_in(const char* variable) {
  std::vector<fs::path> paths;
  const char* value = std::getenv(variable);
  std::string_view list = value == nullptr ? "" : value;
  while (!list.empty()) {
    const size_t colon = list.find(':');
    const std::string_view one = list.substr(0, colon);
    if (one.starts_with('/')) paths.emplace_back(one);
    list = colon == std::string_view::npos ? std::string_view{} : list.substr(colon + 1);
  }
  return paths;
}

// True if kReadPaths already opens the folder.
bool is_open(const fs::path& folder) {
  std::error_code failed;
  return std::ranges::any_of(kReadPaths, [&](const char* path) {
    return is_beneath(folder, fs::weakly_canonical(path, failed));
  });
}

bool is_library(const fs::path& file) {
  return file.filename().string().find(".so") != std::string::npos;
}

// Adds a library and those beside it, which it may load, but no other file of their folder.
void add_libraries(const fs::path& library, std::vector<FileRule>& rules) {
  std::error_code failed;
  const fs::path target = fs::canonical(library, failed);
  if (failed) return;
  rules.push_back({target, Access::kRead});
  for (const fs::path& named : {library, target}) {
    const fs::path folder = fs::canonical(named.parent_path(), failed);
    if (failed || is_open(folder)) continue;
    for (fs::directory_iterator it(folder, failed), end; !failed && it != end;
         it.increment(failed)) {
      if (is_library(it->path())) rules.push_back({it->path(), Access::kRead});
    }
  }
}

void add_manifest(const fs::path& file, std::vector<FileRule>& rules) {
  rules.push_back({file, Access::kRead});
  const fs::path library = manifest_library(file);
  if (!library.empty()) add_libraries(library, rules);
}

// `path`: a manifest or a folder of manifests.
void add_manifests(const fs::path& path, std::vector<FileRule>& rules) {
  std::error_code failed;
  if (!fs::is_directory(path, failed)) {
    if (fs::is_regular_file(path, failed)) add_manifest(path, rules);
    return;
  }
  rules.push_back({path, Access::kRead});
  for (fs::directory_iterator it(path, failed), end; !failed && it != end; it.increment(failed)) {
    if (it->path().extension() == ".json") add_manifest(it->path(), rules);
  }
}

void add_variables(std::vector<FileRule>& rules) {
  for (const PathVariable& variable : kPathVariables) {
    for (const fs::path& path : paths_in(variable.name)) {
      if (variable.has_manifests) {
        add_manifests(*variable.below == '\0' ? path : path / variable.below, rules);
      } else {
        rules.push_back({path, Access::kRead});
      }
    }
  }
  for (const fs::path& home : paths_in("HOME")) {
    add_manifests(home / ".config/vulkan/icd.d", rules);
    add_manifests(home / ".local/share/vulkan/icd.d", rules);
  }
}

// NVIDIA's driver shares memory with its threads and its server by files in /dev/shm.
void add_nvidia(std::vector<FileRule>& rules) {
  bool is_there = false;
  std::error_code failed;
  for (fs::directory_iterator it("/dev", failed), end; !failed && it != end; it.increment(failed)) {
    if (!it->path().filename().string().starts_with(kNvidiaPrefix)) continue;
    rules.push_back({it->path(), Access::kDevice});
    is_there = true;
  }
  if (is_there) rules.push_back({kSharedMemoryPath, Access::kSharedMemory});
}

}  // namespace

bool is_beneath(const fs::path& path, const fs::path& folder) {
  const auto [folder_end, rest] =
      std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
  return folder_end == folder.end();
}

fs::path manifest_library(const fs::path& manifest) {
  std::error_code failed;
  if (const auto size = fs::file_size(manifest, failed); failed || size > kManifestBytesMax)
    return {};
  const auto bytes = read_file(manifest);
  if (!bytes) return {};
  const json object = json::parse(*bytes, nullptr, /*allow_exceptions=*/false);
  const auto icd = object.is_object() ? object.find("ICD") : object.end();
  if (!object.is_object() || icd == object.end() || !icd->is_object()) return {};
  const auto path = icd->find("library_path");
  if (path == icd->end() || !path->is_string()) return {};
  const fs::path library = path->get<std::string>();
  // A bare name is searched for as every library is.
  if (library.string().find('/') == std::string::npos) return {};
  return (manifest.parent_path() / library).lexically_normal();
}

std::vector<FileRule> driver_rules() {
  std::vector<FileRule> rules;
  rules.reserve(kReadPaths.size() + kReadWritePaths.size() + kDevicePaths.size());
  for (const char* path : kReadPaths) rules.push_back({path, Access::kRead});
  for (const char* path : kReadWritePaths) rules.push_back({path, Access::kReadWrite});
  for (const char* path : kDevicePaths) rules.push_back({path, Access::kDevice});
  for (const char* folder : kManifestFolders) add_manifests(folder, rules);
  add_variables(rules);
  add_nvidia(rules);
  return rules;
}

}  // namespace voxeld
