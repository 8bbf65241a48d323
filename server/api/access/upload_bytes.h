// Counts the bytes of unfinished uploads by tenant.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "proto/result.h"
#include "server/base/thread_annotations.h"

namespace voxeld::api {

// The bytes take room on the disk, and no row of the database counts them. Without a limit, a
// tenant could fill the disk with uploads that each fit into its quota and never end. Thread-safe.
class UploadBytes {
 public:
  // The bytes of one upload, while it lives. It must not outlive the object.
  class Share {
   public:
    // `bytes_max`: that all uploads of the tenant may have brought at a time; 0: any.
    Share(UploadBytes& all, std::string tenant, int64_t bytes_max)
        : all_(all), tenant_(std::move(tenant)), bytes_max_(bytes_max) {}
    ~Share() { all_.give_back(tenant_, bytes_); }
    Share(const Share&) = delete;
    Share& operator=(const Share&) = delete;
    // More is about to be written. Errors: too-many-requests.
    Status add(int64_t bytes);

   private:
    UploadBytes& all_;
    const std::string tenant_;
    const int64_t bytes_max_;
    int64_t bytes_ = 0;
  };

 private:
  Status take(const std::string& tenant, int64_t bytes, int64_t bytes_max) EXCLUDES(mutex_);
  void give_back(const std::string& tenant, int64_t bytes) EXCLUDES(mutex_);

  Mutex mutex_;
  std::map<std::string, int64_t> by_tenant_ GUARDED_BY(mutex_);  // none is 0
};

}  // namespace voxeld::api
