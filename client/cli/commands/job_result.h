// Jobs whose results go to a file: voxel MESH, voxel render, voxel jobs ID -o FILE.
#pragma once

#include <chrono>
#include <functional>
#include <stop_token>
#include <string>

#include "client/cli/arguments.h"
#include "client/include/voxeld/client.h"

namespace voxeld::cli {

// Waits for a job that this command submitted. If interrupted, cancels the job.
client::JobInfo wait_or_cancel(client::Client& daemon, const std::string& job,
                               const client::ProgressCallback& progress,
                               const std::stop_token& stop);

// Each throws client::Error.
void run_voxelize(const Arguments& arguments, const std::stop_token& stop);
void run_render(const Arguments& arguments, const std::stop_token& stop);
// Waits for the job and writes its result; in another format of grids than the job made, if the
// output's name says so.
void run_job_result(const Arguments& arguments, const std::stop_token& stop);

}  // namespace voxeld::cli
