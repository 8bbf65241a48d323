#include "server/jobs/visibility.h"

#include <string>

namespace voxeld {

Result<bool> sees_row(SqlConnection& connection, const Caller& caller, std::string_view sql,
                      std::string_view id) {
  if (caller.sees_all()) {
    VOXELD_ASSIGN(SqlStatement any, connection.query(std::string(sql) + " LIMIT 1", id));
    return any.step();
  }
  // By an index that ends in `tenant`: rows of others are not even read, so that they take no time.
  VOXELD_ASSIGN(SqlStatement own, connection.query(std::string(sql) + " AND tenant = $2 LIMIT 1",
                                                   id, caller.tenant()));
  return own.step();
}

}  // namespace voxeld
