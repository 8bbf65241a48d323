// The table of all public routes.
#pragma once

#include <vector>

#include "server/api/resources/api.h"
#include "server/api/router.h"

namespace voxeld::api {

// A test compares them with openapi.yaml. `api` must outlive them.
std::vector<Route> public_routes(Api& api, int64_t upload_bytes_max);

}  // namespace voxeld::api
