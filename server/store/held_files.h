// Files that downloads have open. One that was deleted meanwhile takes room on the disk until its
// last reader closes it: that counts for the tenant that reads.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "server/base/thread_annotations.h"

namespace voxeld {

// Whether the open file has no name any more, so that it goes once it is closed.
bool is_deleted(int fd);

// Thread-safe.
class HeldFiles {
 public:
  // Ends when the reader is done; before the descriptor is closed.
  class Hold {
   public:
    Hold() = default;
    ~Hold() { end(); }
    Hold(Hold&& other) noexcept
        : files_(std::exchange(other.files_, nullptr)),
          tenant_(std::move(other.tenant_)),
          fd_(other.fd_) {}
    Hold& operator=(Hold&& other) noexcept {
      if (this == &other) return *this;
      end();
      files_ = std::exchange(other.files_, nullptr);
      tenant_ = std::move(other.tenant_);
      fd_ = other.fd_;
      return *this;
    }

   private:
    friend class HeldFiles;
    Hold(HeldFiles& files, std::string tenant, int fd)
        : files_(&files), tenant_(std::move(tenant)), fd_(fd) {}
    void end() {
      if (files_ != nullptr) files_->remove(tenant_, fd_);
      files_ = nullptr;
    }
    HeldFiles* files_ = nullptr;
    std::string tenant_;
    int fd_ = -1;
  };
  Hold add(std::string tenant, int fd) EXCLUDES(mutex_);
  // Bytes on the disk of deleted files that the tenant reads, each file once. Looks at each of its
  // open files.
  int64_t bytes(std::string_view tenant) const EXCLUDES(mutex_);

 private:
  void remove(const std::string& tenant, int fd) EXCLUDES(mutex_);
  mutable Mutex mutex_;
  std::map<std::string, std::set<int>, std::less<>> open_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
