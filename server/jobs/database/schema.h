// Tables of the job database, and how older ones are brought up to date.
#pragma once

#include "proto/result.h"
#include "server/jobs/database/sqlite.h"

namespace voxeld {

// Number of the newest schema that this program knows (PRAGMA user_version).
int schema_version();
// Applies every step that the database lacks, each in a transaction of its own. Errors: internal
// when it was written by a newer voxeld. With a lower `last` it makes a database of an older one.
Status migrate_schema(SqlConnection& connection, int last = schema_version());

}  // namespace voxeld
