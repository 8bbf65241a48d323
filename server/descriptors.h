// How the process's file descriptors are shared out between connections and everything else.
#pragma once

#include <cstdint>

#include "proto/result.h"

namespace voxeld {

// Descriptors that each part may have open at once.
inline constexpr int kDescriptorsOfProcess = 64;  // log, locks, listeners, writer, sweeps, admin
inline constexpr int kDescriptorsOfWorker = 12;  // its two sockets, a reader, outputs it hands over
inline constexpr int kDescriptorsOfThread = 6;   // two readers of the database, two files
inline constexpr int kDescriptorsOfConnection = 2;  // the socket, and the file that it is sent
// A daemon that could have fewer does not start.
inline constexpr int kConnectionsMin = 8;
inline constexpr int kRequestThreadsMin = 4;
// Connections of the admin port; more are closed. A sixteenth of the limit where that is less.
inline constexpr int kAdminConnectionsMax = 64;

struct DescriptorPlan {
  int64_t limit = 0;  // RLIMIT_NOFILE
  int connections = 0;
  int connections_per_address = 0;  // at most half of `connections`; 0: any number
  int admin_connections = 0;
  int request_threads = 0;
  bool operator==(const DescriptorPlan&) const = default;
};

// The wanted plan, made to fit into `limit` descriptors. The needs of jobs, workers, the database
// and requests are set aside first, so that connections never take them. Errors: invalid-option
// with the number that is needed.
Result<DescriptorPlan> fit_descriptors(const DescriptorPlan& wanted, int workers);

// Raises the soft limit as far as `wanted` needs and the hard limit allows, and logs what came of
// it. Errors: those of fit_descriptors().
Result<DescriptorPlan> share_out_descriptors(DescriptorPlan wanted, int workers);

}  // namespace voxeld
