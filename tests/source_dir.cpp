#include "tests/source_dir.h"

namespace voxeld::test {

std::filesystem::path source_dir() {
  return VOXELD_SOURCE_DIR;
}

}  // namespace voxeld::test
