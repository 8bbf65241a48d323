// The cost of jobs of each kind on this machine, learned and stored in a file beside the database.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "proto/messages/job.h"
#include "server/base/clock.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/estimates/cost_regression.h"
#include "server/jobs/estimates/job_guess.h"

namespace voxeld {

// The properties of a job that its cost depends on.
struct JobWork {
  std::string sort;       // "voxelize npy surface occupancy": jobs of one sort have one law
  std::string read_sort;  // "read zip": that of reading the input
  CostFeatures features;
  double frames = 1;  // of a sequence, or views
  JobGuess guess;
};
JobWork work_of(JobKind kind, const RequestOptions& options, const JobInput& input);

// Seconds of a worker that a finished job needed: all stages but waiting and the upload; those of
// them in which it read its input, and on the device.
struct MeasuredSeconds {
  double worker = 0, read = 0, device = 0;
};
MeasuredSeconds measured_seconds(const JobStatus& status);

// DIR/costs, a line for each sort and quantity, between tabs: "voxelize npy surface occupancy",
// "seconds", CostRegression::text(). Losing it costs what was learned. Thread-safe.
class JobCosts {
 public:
  // A file that is missing or broken is as if nothing had been learned; the log tells.
  explicit JobCosts(std::filesystem::path file);
  // Writes what is new.
  ~JobCosts();

  JobEstimate estimate(const JobWork& work) const EXCLUDES(mutex_);
  // A job that ran; jobs that got another one's result do not count.
  void learn(const JobWork& work, const JobStatus& done) EXCLUDES(mutex_);
  // A job that ended early, after so long on the device. It counts where it was expected to need
  // less in all: hostile requests, which nobody waits for, would never be learned otherwise.
  void learn_at_least(const JobWork& work, double device_seconds) EXCLUDES(mutex_);

 private:
  enum class Quantity { kSeconds, kDeviceSeconds, kResultBytes, kHostBytes };
  static constexpr std::array<std::string_view, 4> kQuantities = {"seconds", "device_seconds",
                                                                  "result_bytes", "host_bytes"};
  // The factors of one sort, in the order of kQuantities. Reading has seconds alone.
  using Sort = std::array<CostRegression, kQuantities.size()>;
  // Nothing where there would be too many sorts.
  Sort* sort_of(std::string_view name) REQUIRES(mutex_);
  const CostRegression& factor(std::string_view sort, Quantity quantity) const REQUIRES(mutex_);
  CostRange device_seconds(const JobWork& work) const REQUIRES(mutex_);
  void load();
  void save() REQUIRES(mutex_);
  void note_new() REQUIRES(mutex_);

  const std::filesystem::path file_;
  mutable Mutex mutex_;
  std::map<std::string, Sort, std::less<>> sorts_ GUARDED_BY(mutex_);
  Stopwatch since_saved_ GUARDED_BY(mutex_);
  bool is_new_ GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld
