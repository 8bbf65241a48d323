// How many requests of each tenant may wait or upload at a time.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/base/thread_annotations.h"

namespace voxeld::api {

// Thread-safe. A tenant may take another place while it has fewer than are free: dynamic thresholds
// with alpha 1 (Choudhury and Hahne 1998), as in the queue of jobs. One tenant can take half of the
// places, n tenants n/(n + 1) of them; a tenant without any always finds one.
class WaitLimit {
 public:
  // Errors name `what` the requests of a tenant do.
  explicit WaitLimit(int places, std::string_view what = "wait") : places_(places), what_(what) {}

  // One place, from the start of a request that may wait until its response begins. It must not
  // outlive the limit.
  class Place {
   public:
    Place(WaitLimit& limit, std::string tenant) : limit_(limit), tenant_(std::move(tenant)) {}
    ~Place() { limit_.free(tenant_); }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

   private:
    WaitLimit& limit_;
    const std::string tenant_;
  };
  // Errors: too-many-requests.
  Result<std::unique_ptr<Place>> take(const std::string& tenant) EXCLUDES(mutex_);

 private:
  void free(const std::string& tenant) EXCLUDES(mutex_);

  const int places_;
  const std::string_view what_;
  Mutex mutex_;
  int taken_ GUARDED_BY(mutex_) = 0;
  std::map<std::string, int, std::less<>> by_tenant_ GUARDED_BY(mutex_);  // none is 0
};

}  // namespace voxeld::api
