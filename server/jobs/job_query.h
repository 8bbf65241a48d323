// Which jobs a list is of.
#pragma once

#include <optional>
#include <string>

#include "proto/job.h"

namespace voxeld {

enum class JobOrder { kNewestFirst, kOldestFirst };

// How much of a job is read.
enum class JobTexts {
  kWhole,
  kBrief,  // texts longer than limits::kRowTextBytesMax stay in the database: is_brief()
};

struct JobQuery {
  std::optional<JobState> state;
  JobOrder order = JobOrder::kNewestFirst;
  JobTexts texts = JobTexts::kWhole;
  std::string after;  // id of a job: those that come after it; empty: all
};

}  // namespace voxeld
