// /livez, /readyz and /metrics: on a port and threads of their own, so that they respond while all
// request threads are busy.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "server/api/router.h"
#include "server/jobs/auth/key_ring.h"
#include "server/jobs/service/job_service.h"

namespace prometheus {
class Registry;
}

namespace voxeld::api {

// `refresh` is called before metrics are written.
std::vector<Route> admin_routes(JobService& jobs, const KeyRing& keys,
                                std::shared_ptr<prometheus::Registry> metrics,
                                std::function<void()> refresh);

}  // namespace voxeld::api
