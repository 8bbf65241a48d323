// The exit status of voxel. Documented in docs/voxel.md.
#pragma once

#include "client/include/voxeld/client.h"

namespace voxeld::cli {

enum ExitStatus {
  kSuccess = 0,
  kFailure = 1,       // a local file, or the service failed inside
  kUsage = 2,         // flags and values that voxel or the daemon does not know
  kBadInput = 3,      // the mesh, image or archive cannot be read
  kTooLarge = 4,      // over a limit: grid, body, storage
  kUnreachable = 5,   // no daemon, or it has no device, is full or is shutting down
  kJobFailed = 6,     // the job was cancelled, took too long or ended its workers
  kSomeFailed = 7,    // of several files
  kInterrupted = 130  // Ctrl-C or SIGTERM
};

ExitStatus exit_status_of(const client::Error& error);

}  // namespace voxeld::cli
