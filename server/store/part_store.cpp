#include "server/store/part_store.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <map>
#include <optional>
#include <system_error>
#include <utility>

#include "proto/text/number_text.h"
#include "server/base/disk/directory.h"
#include "server/base/disk/file.h"
#include "server/base/log.h"
#include "server/base/sha256.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

// Whether a job id is safe as a file name; others have no folder.
bool is_plain_name(std::string_view name) {
  return !name.empty() && name.size() <= 64 && !name.starts_with('.') &&
         name.find('/') == std::string_view::npos;
}

struct Part {
  int64_t position = 0, tiles = 0;
  std::string hash;
  fs::path path;
};

// Takes a number and the dot behind it from the front of `name`; nullopt for another text.
std::optional<int64_t> take_number(std::string_view& name) {
  const size_t dot = name.find('.');
  if (dot == std::string_view::npos) return std::nullopt;
  const auto number = parse_digits<int64_t>(name.substr(0, dot));
  name.remove_prefix(dot + 1);
  return number;
}

// Parses a name such as "12.64.sha256-…".
std::optional<Part> parse_name(const fs::path& folder, const std::string& name) {
  std::string_view rest = name;
  const auto position = take_number(rest);
  const auto tiles = position ? take_number(rest) : std::nullopt;
  if (!tiles) return std::nullopt;
  return Part{*position, *tiles, std::string(rest), folder / name};
}

std::map<int64_t, Part> parts_in(const fs::path& folder) {
  std::map<int64_t, Part> parts;
  const auto names = directory_names(folder);
  if (!names) return parts;
  for (const std::string& name : *names) {
    auto part = parse_name(folder, name);
    if (!part) continue;
    const int64_t position = part->position;
    parts[position] = *std::move(part);
  }
  return parts;
}

Status check_plain_file(const fs::path& file) {
  struct stat info {};
  if (::lstat(file.c_str(), &info) != 0) return errno_error("stat", file);
  if (S_ISREG(info.st_mode) && info.st_nlink == 1) return {};
  return Error{ErrorCode::kInternal, file.filename().string() + " is not a plain file", "", ""};
}

}  // namespace

Result<PartStore> PartStore::open(const fs::path& root) {
  VOXELD_TRY(make_directory(root / "parts"));
  return PartStore(root / "parts");
}

Status PartStore::add(std::string_view job, int64_t position, int64_t tiles,
                      const fs::path& file) const {
  if (!is_plain_name(job)) {
    return Error{ErrorCode::kInternal, "parts of a job", "its id", std::string(job.substr(0, 80))};
  }
  VOXELD_TRY(check_plain_file(file));
  VOXELD_ASSIGN(const std::string hash, sha256_file_id(file));
  VOXELD_TRY(sync_path(file));
  const fs::path folder = folder_ / job;
  VOXELD_TRY(make_directory(folder));
  // Remove from the last part on, so an interruption leaves consecutive parts.
  const auto parts = parts_in(folder);
  for (auto it = parts.rbegin(); it != parts.rend() && it->first >= position; ++it) {
    std::error_code failed;
    const fs::path& old = it->second.path;
    if (!fs::remove(old, failed) && failed) return errno_error("remove", old);
  }
  const fs::path target =
      folder / (std::to_string(position) + "." + std::to_string(tiles) + "." + hash);
  if (std::rename(file.c_str(), target.c_str()) != 0) return errno_error("move", file);
  return sync_path(folder);
}

std::vector<fs::path> PartStore::of_job(std::string_view job) const {
  std::vector<fs::path> paths;
  if (!is_plain_name(job)) return paths;
  for (const auto& [position, part] : parts_in(folder_ / job)) {
    if (position != static_cast<int64_t>(paths.size())) break;
    const auto hash = sha256_file_id(part.path);
    if (!hash || *hash != part.hash) {
      log::warn("a part has other bytes than were stored", {{"job", job}, {"position", position}});
      break;
    }
    paths.push_back(part.path);
  }
  return paths;
}

int64_t PartStore::bytes_before(std::string_view job, int64_t position) const {
  int64_t bytes = 0;
  if (!is_plain_name(job)) return bytes;
  for (const auto& [other, part] : parts_in(folder_ / job)) {
    struct stat info {};
    if (other < position && ::stat(part.path.c_str(), &info) == 0) bytes += info.st_size;
  }
  return bytes;
}

std::optional<JobPart> PartStore::with_tile(std::string_view job, int64_t tile) const {
  if (!is_plain_name(job)) return std::nullopt;
  int64_t next = 0, before = 0;
  for (const auto& [position, part] : parts_in(folder_ / job)) {
    if (position != next++) break;
    if (tile - before < part.tiles) return JobPart{part.path, before};
    before += part.tiles;
  }
  return std::nullopt;
}

void PartStore::remove(std::string_view job) const {
  if (is_plain_name(job)) remove_tree(folder_ / job);
}

void PartStore::remove_unless(const std::function<bool(std::string_view job)>& wanted) const {
  const auto jobs = directory_names(folder_);
  if (!jobs) return;
  for (const std::string& job : *jobs) {
    if (!wanted(job)) remove(job);
  }
}

}  // namespace voxeld
