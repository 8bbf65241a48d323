#include "proto/result.h"

namespace voxeld {

std::string Error::message() const {
  std::string text = detail;
  if (!expected.empty()) text += ": expected " + expected;
  if (!got.empty()) text += (expected.empty() ? ": got " : ", got ") + got;
  return text;
}

}  // namespace voxeld
