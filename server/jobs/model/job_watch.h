// Notifications of a job's changes, for waits that hold no thread.
#pragma once

namespace voxeld {

// Which changes of a job are announced.
enum class JobChange {
  kAny,    // state and progress
  kState,  // changes after which the job may have ended
};

// Announces changes for as long as it lives; JobService::watch() makes one.
class JobWatch {
 public:
  virtual ~JobWatch() = default;
};

}  // namespace voxeld
