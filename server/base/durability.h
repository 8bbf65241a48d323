// When a change of the store or its database has to survive power loss. A process that ends, even
// by a signal, loses neither.
#pragma once

namespace voxeld {

enum class Durability {
  kNow,   // on return
  kSoon,  // within a second or two of it; it may be lost until then, as if it had not come
};

}  // namespace voxeld
