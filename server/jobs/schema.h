// Tables of the job database, and how older ones are brought up to date.
#pragma once

#include "proto/result.h"
#include "server/jobs/sqlite.h"

namespace voxeld {

// Number of the newest schema that this program knows (PRAGMA user_version).
int schema_version();
// Applies every step that the database lacks, each in a transaction of its own. Errors: internal
// when it was written by a newer voxeld.
Status migrate_schema(SqlConnection& connection);

}  // namespace voxeld
