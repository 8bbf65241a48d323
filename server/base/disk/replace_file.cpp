#include "server/base/disk/replace_file.h"

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <string>
#include <system_error>

#include "server/base/disk/file.h"

namespace voxeld {

Status replace_file(const std::filesystem::path& path, std::string_view text) {
  std::error_code failed;
  std::filesystem::create_directories(path.parent_path(), failed);
  if (failed) {
    return Error{ErrorCode::kInternal, "cannot make " + path.parent_path().string(), "a folder",
                 failed.message()};
  }
  const std::filesystem::path temporary = path.string() + "." + std::to_string(::getpid()) + ".tmp";
  Status done = write_file(temporary, {reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  if (done) done = sync_path(temporary);
  if (done && ::rename(temporary.c_str(), path.c_str()) != 0) done = errno_error("rename to", path);
  if (!done) {
    ::unlink(temporary.c_str());
    return done;
  }
  return sync_path(path.parent_path());
}

}  // namespace voxeld
