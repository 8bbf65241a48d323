// The schema in SQLite: tables.h, with triggers for derived rows.
#pragma once

#include <cstdint>

#include "proto/result.h"
#include "server/jobs/database/sqlite_connection.h"

namespace voxeld {

// The schema that the file has (PRAGMA user_version); 0: none.
Result<int64_t> sqlite_schema_version(SqliteConnection& connection);
// Makes the tables of an empty database. Errors: internal for a database with another schema.
Status create_sqlite_schema(SqliteConnection& connection);

}  // namespace voxeld
