#include "server/process/image_module.h"

#include <dlfcn.h>

#include <string>
#include <system_error>

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

struct Module {
  void* handle = nullptr;
  std::string failure;
};

Module load() {
  const std::filesystem::path path = image_module_folder() / "libvoxeld_images.so";
  Module module{::dlopen(path.c_str(), RTLD_LAZY | RTLD_LOCAL), ""};
  if (module.handle == nullptr) {
    const char* why = ::dlerror();
    module.failure = why != nullptr ? why : path.string();
  }
  return module;
}

}  // namespace

std::filesystem::path image_module_folder() {
  std::error_code failed;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", failed);
  return (program.parent_path() / VOXELD_MODULE_FOLDER).lexically_normal();
}

Result<const void*> image_module_symbol(const char* name) {
  cancel_point();  // loading takes long; and the module uses the flag of this program
  static const Module module = load();
  if (module.handle == nullptr) {
    return Error{ErrorCode::kInternal, "the module for images cannot be loaded: " + module.failure,
                 "", ""};
  }
  if (const void* symbol = ::dlsym(module.handle, name)) return symbol;
  return Error{ErrorCode::kInternal, "the module for images is of another version", name, ""};
}

}  // namespace voxeld
