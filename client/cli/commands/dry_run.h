// voxel --dry-run: what the daemon expects a job to cost.
#pragma once

#include <stop_token>

#include "client/cli/arguments.h"

namespace voxeld::cli {

// Uploads the meshes and prints the estimates; no job is submitted. Continues after one of several
// files that fails. Throws client::Error, and what tell_failures() throws.
void run_dry_run(const Arguments& arguments, const std::stop_token& stop);

}  // namespace voxeld::cli
