#include "server/jobs/records/visibility.h"

#include <array>
#include <initializer_list>
#include <string>

namespace voxeld {
namespace {

Error gone(std::string what, bool is_deleted, std::string_view remedy) {
  what += is_deleted ? " was deleted; "
                     : " is not stored any more: it expired or made room for others; ";
  return {ErrorCode::kGone, what + std::string(remedy), "", ""};
}

// `selects` find the rows that name the thing.
Status check_stored(SqlConnection& connection, const Caller& caller, std::string_view what,
                    std::string_view id, std::initializer_list<std::string_view> selects) {
  const auto any = [&](std::string_view condition) -> Result<bool> {
    for (const std::string_view select : selects) {
      VOXELD_ASSIGN(const bool found,
                    sees_row(connection, caller, std::string(select) + std::string(condition), id));
      if (found) return true;
    }
    return false;
  };
  VOXELD_ASSIGN(const bool is_kept, any(" AND expired_ms = 0"));
  if (is_kept) return {};
  VOXELD_ASSIGN(const bool is_known, any(""));
  const std::string name(what);
  if (!is_known) {
    return Error{ErrorCode::kNotFound, "no such " + name, "the id of a " + name,
                 std::string(id.substr(0, 80))};
  }
  VOXELD_ASSIGN(const bool is_deleted, any(" AND is_deleted = 1"));
  return gone("the " + name + " " + std::string(id), is_deleted,
              "submit the job that made it again");
}

}  // namespace

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

Status check_stored_grid(SqlConnection& connection, const Caller& caller, std::string_view id) {
  return check_stored(connection, caller, "grid", id,
                      {"SELECT 1 FROM results WHERE grid = $1 AND grid <> ''",
                       "SELECT 1 FROM frames WHERE grid = $1"});
}

Status check_stored_sequence(SqlConnection& connection, const Caller& caller, std::string_view id) {
  return check_stored(connection, caller, "sequence", id,
                      {"SELECT 1 FROM results WHERE sequence = $1 AND sequence <> ''"});
}

Status check_stored_result(SqlConnection& connection, std::string_view job) {
  VOXELD_ASSIGN(SqlStatement row,
                connection.query("SELECT r.expired_ms, r.is_deleted FROM jobs j"
                                 " JOIN results r ON r.seq = j.result_seq WHERE j.id = $1",
                                 job));
  VOXELD_ASSIGN(const bool found, row.step());
  if (!found || row.int64(0) == 0) return {};
  return gone("the result of the job " + std::string(job), row.int64(1) != 0,
              "submit the job again");
}

}  // namespace voxeld
