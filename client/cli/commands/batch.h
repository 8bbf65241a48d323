// Several meshes in one call: a job for each, some at a time, and a file for each in --out-dir.
#pragma once

#include <stop_token>

#include "client/cli/arguments.h"

namespace voxeld::cli {

// Jobs that are in flight at a time: enough for a daemon with a few workers, few enough for its
// other clients.
inline constexpr int kBatchJobsMax = 4;

// Continues after a file that fails, and lists the errors at the end. Throws client::Error
// "some-failed" if some files failed; the first error if all did; "interrupted" when stopped.
void run_batch(const Arguments& arguments, const std::stop_token& stop);

}  // namespace voxeld::cli
