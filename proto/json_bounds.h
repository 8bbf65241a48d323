// Bounds of a JSON text from outside.
#pragma once

#include <cstdint>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "proto/limits.h"
#include "proto/result.h"

namespace voxeld {

// A value takes up to a hundred bytes in memory, however short it is in the text: of a text with a
// limit on its bytes alone, as many values are taken as it would have if each had so many bytes.
inline constexpr int64_t kJsonBytesPerValue = 32;

struct JsonBounds {
  int64_t bytes_max = limits::kJsonBodyBytesMax;
  int depth_max = limits::kJsonDepthMax;
  int64_t values_max = bytes_max / kJsonBytesPerValue;  // of all arrays and objects
  int64_t members_max = INT64_MAX;                      // of one object
};

// As the other parse_json_bounded() (proto/job.h), within these bounds. Errors: bad-request,
// payload-too-large.
Result<nlohmann::json> parse_json_bounded(std::string_view text, const JsonBounds& bounds);

}  // namespace voxeld
