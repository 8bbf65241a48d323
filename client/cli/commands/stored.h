// Commands on what the daemon stores: jobs, ls, rm, share, whoami.
#pragma once

#include <stop_token>

#include "client/cli/arguments.h"

namespace voxeld::cli {

// Each throws client::Error.
void run_jobs(const Arguments& arguments, const std::stop_token& stop);
void run_list(const Arguments& arguments);
// Continues after an id that cannot be deleted. The first such error becomes the command's.
void run_remove(const Arguments& arguments);
void run_share(const Arguments& arguments);
void run_whoami(const Arguments& arguments);

}  // namespace voxeld::cli
