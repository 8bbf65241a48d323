// Whether a store ever had API keys. Without its file of keys a daemon is open to everybody, which
// must not come about by a file that went away.
#pragma once

#include <atomic>

#include "proto/result.h"
#include "server/jobs/database/database.h"

namespace voxeld {

// Thread-safe.
class KeyMemory {
 public:
  explicit KeyMemory(Database& database) : database_(database) {}
  // At start. Errors: conflict where there were keys and are none now; `forgets`: that is wanted,
  // and is remembered instead.
  Status check(bool has_keys, bool forgets);
  // There are keys now. Writes the first time; again where that failed.
  void remember();

 private:
  Status write(bool had_keys);
  Database& database_;
  std::atomic<bool> had_keys_{false};
};

}  // namespace voxeld
