// proto/openapi.yaml as JSON, embedded by openapi_json.py.
#pragma once

#include <string_view>

namespace voxeld::api {
std::string_view openapi_json();
}  // namespace voxeld::api
