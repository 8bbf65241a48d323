#include "server/device/missing_driver.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace voxeld::gpu {
namespace {

namespace fs = std::filesystem;

// Names in `folder` that begin with `prefix`, sorted; none if it cannot be read.
std::vector<std::string> names_in(const fs::path& folder, std::string_view prefix) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::string name = it->path().filename().string();
    if (name.starts_with(prefix)) names.push_back(std::move(name));
  }
  std::ranges::sort(names);
  return names;
}

// Whether a vendor file of libglvnd names NVIDIA's driver.
bool has_nvidia_vendor_file(const fs::path& root) {
  for (const char* folder : {"usr/share/glvnd/egl_vendor.d", "etc/glvnd/egl_vendor.d"}) {
    for (const std::string& name : names_in(root / folder, "")) {
      if (name.find("nvidia") != std::string::npos) return true;
    }
  }
  return false;
}

// Names of NVIDIA's cards in /dev, which is not listed: a sandbox forbids that.
std::vector<std::string> nvidia_cards(const fs::path& root) {
  constexpr int kCardsMax = 64;
  std::vector<std::string> names;
  std::error_code error;
  for (int card = 0; card < kCardsMax; ++card) {
    std::string name = "nvidia" + std::to_string(card);
    if (fs::exists(root / "dev" / name, error)) names.push_back(std::move(name));
  }
  return names;
}

std::vector<std::string> render_nodes(const fs::path& root) {
  return names_in(root / "dev/dri", "renderD");
}

bool has_wsl_node(const fs::path& root) {
  std::error_code error;
  return fs::exists(root / "dev/dxg", error);
}

std::string open_error(const fs::path& node) {
  const int descriptor = ::open(node.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor < 0) return std::strerror(errno);
  ::close(descriptor);
  return "";
}

}  // namespace

std::string missing_driver(const fs::path& root) {
  const std::vector<std::string> cards = nvidia_cards(root);
  if (!cards.empty()) {
    const std::string node = "/dev/" + cards.front();
    if (const std::string error = open_error(root / "dev" / cards.front()); !error.empty()) {
      return node + " cannot be opened: " + error;
    }
    if (!has_nvidia_vendor_file(root)) {
      return node +
             " is there, but not NVIDIA's EGL driver: no vendor file such as "
             "/usr/share/glvnd/egl_vendor.d/10_nvidia.json (package libnvidia-egl or "
             "libnvidia-gl; in a container NVIDIA_DRIVER_CAPABILITIES=graphics)";
    }
    return node +
           " is there, but its EGL driver did not open: do its version and the kernel "
           "module's agree (nvidia-smi)?";
  }
  const std::vector<std::string> renderers = render_nodes(root);
  if (renderers.empty()) {
    if (has_wsl_node(root)) {
      return "/dev/dxg is there, but no Mesa driver for it (package libgl1-mesa-dri, and WSL's "
             "libraries in /usr/lib/wsl/lib)";
    }
    return "no GPU's device node is there (/dev/nvidia0 or /dev/dri/renderD128)";
  }
  const std::string node = "/dev/dri/" + renderers.front();
  if (const std::string error = open_error(root / "dev/dri" / renderers.front()); !error.empty()) {
    return node + " cannot be opened: " + error + " (is this user in the group render?)";
  }
  return node + " is there, but no Mesa driver for it (package libgl1-mesa-dri)";
}

bool has_gpu_node(const fs::path& root) {
  return !nvidia_cards(root).empty() || !render_nodes(root).empty() || has_wsl_node(root);
}

}  // namespace voxeld::gpu
