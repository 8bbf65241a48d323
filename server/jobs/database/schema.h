// Tables of the job database.
#pragma once

#include "proto/result.h"
#include "server/jobs/database/sqlite.h"

namespace voxeld {

// The schema that this program reads and writes (PRAGMA user_version).
int schema_version();
// Makes the tables of an empty database. Errors: internal for a database with another schema.
Status create_schema(SqlConnection& connection);

}  // namespace voxeld
