#include "proto/version.h"

namespace voxeld {

std::string_view version() {
  return VOXELD_VERSION;
}

}  // namespace voxeld
