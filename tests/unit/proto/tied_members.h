// Equality of structs whose members a test lists.
#pragma once

#include <tuple>

#include "proto/messages/job.h"
#include "proto/result.h"

namespace voxeld {

// All members of a struct, for comparison. A member that is added to the struct but not here does
// not compile.
inline auto tied(const Error& e) {
  const auto& [code, detail, expected, got] = e;
  return std::tie(code, detail, expected, got);
}
inline auto tied(const Warning& w) {
  const auto& [code, detail] = w;
  return std::tie(code, detail);
}

// Equality of every struct that has a tied() in this namespace.
template <typename Struct>
requires requires(const Struct& s) {
  tied(s);
}
bool operator==(const Struct& a, const Struct& b) {
  return tied(a) == tied(b);
}

}  // namespace voxeld
