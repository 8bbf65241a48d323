#include "server/store/quarantine.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <ctime>
#include <functional>
#include <utility>

#include "server/base/disk/directory.h"
#include "server/base/disk/file.h"
#include "server/base/sha256.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

bool is_day(std::string_view name) {
  constexpr std::string_view kShape = "dddd-dd-dd";
  return std::ranges::equal(name, kShape, [](char got, char shape) {
    return shape == 'd' ? got >= '0' && got <= '9' : got == shape;
  });
}

}  // namespace

std::string day_text(int64_t unix_ms) {
  const auto seconds = static_cast<std::time_t>(unix_ms / 1000);
  std::tm time{};
  ::gmtime_r(&seconds, &time);
  std::array<char, 16> text{};
  return {text.data(), std::strftime(text.data(), text.size(), "%Y-%m-%d", &time)};
}

Status Quarantine::take(const fs::path& blob, std::string_view day) const {
  VOXELD_TRY(make_directory(folder_));
  VOXELD_TRY(make_directory(folder_ / day));
  const fs::path target = folder_ / day / blob.filename();
  if (::rename(blob.c_str(), target.c_str()) != 0) return errno_error("move to quarantine", blob);
  return {};
}

Result<std::vector<QuarantinedBlob>> Quarantine::list() const {
  VOXELD_ASSIGN(auto days, directory_names(folder_));
  std::ranges::sort(days, std::greater<>());
  std::vector<QuarantinedBlob> blobs;
  for (const std::string& day : days) {
    if (!is_day(day)) continue;
    VOXELD_ASSIGN(auto names, directory_names(folder_ / day));
    for (std::string& name : names) {
      if (!is_sha256_id(name)) continue;
      fs::path path = folder_ / day / name;
      blobs.push_back({std::move(name), std::move(path)});
    }
  }
  return blobs;
}

Result<int64_t> Quarantine::remove_before(std::string_view day) const {
  VOXELD_ASSIGN(const auto days, directory_names(folder_));
  int64_t removed = 0;
  for (const std::string& name : days) {
    if (!is_day(name)) continue;
    if (name < day) {
      VOXELD_ASSIGN(const auto blobs, directory_names(folder_ / name));
      removed += static_cast<int64_t>(blobs.size());
      remove_tree(folder_ / name);
    } else {
      ::rmdir((folder_ / name).c_str());  // fails if the folder is not empty
    }
  }
  return removed;
}

}  // namespace voxeld
