// The resources of the admin port: /livez, /readyz and /metrics.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/api/health_server.h"
#include "server/jobs/auth/key_ring.h"
#include "server/jobs/service/job_service.h"

namespace prometheus {
class Registry;
}

namespace voxeld::api {

std::vector<std::string> admin_paths();
// `refresh` is called before metrics are written.
HealthHandler admin_handler(JobService& jobs, const KeyRing& keys,
                            std::shared_ptr<prometheus::Registry> metrics,
                            std::function<void()> refresh);

}  // namespace voxeld::api
