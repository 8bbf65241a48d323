// Several meshes in one call: a job for each, some at a time, and a file for each in --out-dir.
#pragma once

#include <optional>
#include <stop_token>
#include <vector>

#include "client/cli/arguments.h"
#include "client/include/voxeld/client.h"

namespace voxeld::cli {

// Jobs that are in flight at a time: enough for a daemon with a few workers, few enough for its
// other clients.
inline constexpr int kBatchJobsMax = 4;

// Lists the errors of files, as many as there are in the batch. Throws client::Error "some-failed"
// if some files failed, and the first error if all did.
void tell_failures(const Arguments& arguments,
                   const std::vector<std::optional<client::Error>>& errors);

// Continues after a file that fails, and tells the failures at the end. Throws what tell_failures()
// throws; "interrupted" when stopped.
void run_batch(const Arguments& arguments, const std::stop_token& stop);

}  // namespace voxeld::cli
