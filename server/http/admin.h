// /livez, /readyz and /metrics: on a port and threads of their own, so that they answer when all
// request threads are busy.
#pragma once

#include <functional>
#include <memory>

#include "server/http/router.h"
#include "server/jobs/job_service.h"
#include "server/jobs/key_ring.h"

namespace prometheus {
class Registry;
}

namespace voxeld::http {

// `refresh` is called before metrics are written.
void add_admin_routes(Router& router, JobService& jobs, const KeyRing& keys,
                      std::shared_ptr<prometheus::Registry> metrics, std::function<void()> refresh);

}  // namespace voxeld::http
