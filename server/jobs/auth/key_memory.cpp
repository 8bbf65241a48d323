#include "server/jobs/auth/key_memory.h"

#include "server/base/log.h"

namespace voxeld {

Status KeyMemory::write(bool had_keys) {
  VOXELD_TRY(database_.write([&](SqlConnection& connection) {
    return connection.run("UPDATE store SET had_keys = $1", int64_t{had_keys});
  }));
  had_keys_ = had_keys;
  return {};
}

Status KeyMemory::check(bool has_keys, bool forgets) {
  {
    VOXELD_ASSIGN(Database::Lease reader, database_.read());
    VOXELD_ASSIGN(SqlStatement row, reader->query("SELECT had_keys FROM store"));
    VOXELD_ASSIGN(const bool found, row.step());
    had_keys_ = found && row.int64(0) != 0;
  }
  if (has_keys && !had_keys_) return write(true);
  if (has_keys || !had_keys_) return {};
  if (forgets) return write(false);
  return Error{ErrorCode::kConflict,
               "the API keys of this store are gone, and without them everybody could use it. Put "
               "the file keys back, make new ones with voxeld keys add, or start once with "
               "--forget-keys",
               "the file keys in the data directory", "none"};
}

void KeyMemory::remember() {
  if (had_keys_) return;
  if (const Status written = write(true); !written) {
    log::warn("cannot note that there are API keys", {{"error", written.error().message()}});
  }
}

}  // namespace voxeld
