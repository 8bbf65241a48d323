#include "tests/folders.h"

namespace voxeld::test {

std::filesystem::path source_dir() {
  return VOXELD_SOURCE_DIR;
}

std::filesystem::path program_dir() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path();
}

}  // namespace voxeld::test
