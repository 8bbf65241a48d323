// The gateway's side of a connection for time slices on a device (proto/messages/task_api.h).
#pragma once

#include <atomic>

#include "proto/messages/task_api.h"
#include "proto/result.h"
#include "server/jobs/events/job_board.h"
#include "server/jobs/model/worker_state.h"
#include "server/jobs/scheduling/time_slices.h"
#include "server/process/frame_socket.h"

namespace voxeld {

struct SliceServerContext {
  TimeSlices& slices;
  const JobBoard& board;  // knows of cancels
  const std::atomic<bool>& stopping;
  const TaskLimits& limits;
};

// Serves requests until the worker closes the connection or breaks the protocol. Its time slice is
// then given back. Errors: gone, bad-request.
Status serve_slices(FrameSocket& socket, const SlicesHello& worker,
                    const SliceServerContext& context);

}  // namespace voxeld
