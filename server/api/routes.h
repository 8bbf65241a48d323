// The table of all public routes.
#pragma once

#include <vector>

#include "server/api/resources/api.h"
#include "server/api/router.h"

namespace voxeld::api {

// In the order of openapi.yaml, which a test compares them with. `api` must outlive them.
std::vector<Route> public_routes(Api& api);

}  // namespace voxeld::api
