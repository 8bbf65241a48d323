#include "server/jobs/retention/store_identity.h"
#include "server/jobs/model/store_limits.h"

#include <algorithm>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "server/jobs/database/sqlite_database.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

// The remedy stands before what was expected and got.
Error mismatch(const BlobStore& blobs, const std::string& what, std::string expected,
               std::string got) {
  const std::string dir = blobs.root().string();
  return {ErrorCode::kConflict,
          what +
              ". Put back the database of these files (jobs.sqlite and, where there is one, "
              "jobs.sqlite-wal); or run voxeld doctor --rebuild --data " +
              dir + "; or start once with --adopt, which moves files that the database does not " +
              "know to " + dir + "/quarantine",
          std::move(expected), std::move(got)};
}

std::string store_text(std::string_view id) {
  return "store " + std::string(id);
}

// nullopt: the database was never tied to a store.
Result<std::optional<StoreMark>> read_row(Database& database) {
  VOXELD_ASSIGN(Database::Lease reader, database.read());
  VOXELD_ASSIGN(SqlStatement row, reader->query("SELECT id, generation FROM store"));
  VOXELD_ASSIGN(const bool found, row.step());
  if (!found) return std::optional<StoreMark>();
  return std::optional(StoreMark{row.text(0), row.int64(1)});
}

Status write_row(Database& database, const StoreMark& mark) {
  return database.write([&](SqlConnection& connection) -> Status {
    VOXELD_TRY(connection.run("DELETE FROM store"));
    return connection.run("INSERT INTO store (only_one, id, generation) VALUES (1, $1, $2)",
                          mark.id, mark.generation);
  });
}

Error new_database(const BlobStore& blobs, size_t files, const std::optional<StoreMark>& mark) {
  return mismatch(blobs,
                  sqlite_path(blobs.root()).string() + " is missing or new, but " +
                      (blobs.root() / "blobs").string() + " holds " + std::to_string(files) +
                      " files",
                  mark ? "the database of " + store_text(mark->id) : "the database that names them",
                  "none that names any file");
}

Status check_match(const BlobStore& blobs, size_t files, const std::optional<StoreMark>& row,
                   const Result<std::unique_ptr<StoreMarkFile>>& file) {
  const std::string path = StoreMarkFile::path_in(blobs.root()).string();
  if (!file) return mismatch(blobs, file.error().detail, file.error().expected, file.error().got);
  const std::optional<StoreMark> mark =
      *file == nullptr ? std::nullopt : std::optional((*file)->mark());
  if (!row) return new_database(blobs, files, mark);
  if (!mark) return mismatch(blobs, path, "the mark of " + store_text(row->id), "no file");
  if (mark->id != row->id) {
    return mismatch(blobs, sqlite_path(blobs.root()).string() + " is the database of other files",
                    store_text(mark->id), store_text(row->id));
  }
  if (row->generation >= mark->generation) return {};
  return mismatch(blobs,
                  sqlite_path(blobs.root()).string() +
                      " is older than the files: a copy, or its jobs.sqlite-wal was removed",
                  "generation " + std::to_string(mark->generation) + " or higher",
                  std::to_string(row->generation));
}

bool has_database(const BlobStore& blobs) {
  std::error_code failed;
  return fs::file_size(sqlite_path(blobs.root()), failed) > 0 && !failed;
}

// The mark for row and file, so that a crash in between leaves a pair that matches.
StoreMark common_mark(const std::optional<StoreMark>& row, const StoreMarkFile* file) {
  StoreMark mark = new_store_mark();
  if (file != nullptr) mark = file->mark();
  if (!row) return mark;
  if (file == nullptr) mark.id = row->id;
  mark.generation = std::max(mark.generation, row->generation);
  return mark;
}

}  // namespace

Result<StoreDatabase> open_store_database(const BlobStore& blobs, StoreMatch match) {
  VOXELD_ASSIGN(const auto stored, blobs.list());
  auto file = StoreMarkFile::open(StoreMarkFile::path_in(blobs.root()));
  const bool must_match = match == StoreMatch::kRequired && !stored.empty();
  // Before SQLite makes one, which would be in the way of the database that is put back.
  if (must_match && !has_database(blobs)) {
    return new_database(blobs, stored.size(),
                        file && *file ? std::optional((*file)->mark()) : std::nullopt);
  }
  StoreDatabase opened;
  VOXELD_ASSIGN(opened.database, SqliteDatabase::open(sqlite_path(blobs.root())));
  VOXELD_ASSIGN(auto row, read_row(*opened.database));
  if (must_match) VOXELD_TRY(check_match(blobs, stored.size(), row, file));
  if (file) opened.mark = *std::move(file);
  const StoreMark mark = common_mark(row, opened.mark.get());
  // The file first: beside blobs, a database without its mark is refused.
  if (opened.mark == nullptr) {
    VOXELD_ASSIGN(opened.mark, StoreMarkFile::create(StoreMarkFile::path_in(blobs.root()), mark));
  }
  if (!row || row->id != mark.id || row->generation < mark.generation) {
    VOXELD_TRY(write_row(*opened.database, mark));
    VOXELD_ASSIGN(row, read_row(*opened.database));
  }
  opened.mark->raise_generation(row->generation);
  opened.database->tell_generation(
      [file = opened.mark.get()](int64_t generation) { file->raise_generation(generation); });
  return opened;
}

}  // namespace voxeld
