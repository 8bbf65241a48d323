// Bounds of a JSON text from outside.
#pragma once

#include <cstdint>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "proto/limits.h"
#include "proto/result.h"

namespace voxeld {

// Bytes of text per value. In memory a value takes up to a hundred bytes, however short its text
// is. A text that is limited in bytes alone may have as many values as if each took this many
// bytes.
inline constexpr int64_t kJsonBytesPerValue = 32;

struct JsonBounds {
  int64_t bytes_max = limits::kJsonBodyBytesMax;
  int depth_max = limits::kJsonDepthMax;
  int64_t values_max = bytes_max / kJsonBytesPerValue;  // in all arrays and objects
  int64_t members_max = INT64_MAX;                      // in one object
};

// Like parse_json_bounded() in proto/messages/job.h, within these bounds. Errors: bad-request,
// payload-too-large.
Result<nlohmann::json> parse_json_bounded(std::string_view text, const JsonBounds& bounds);

}  // namespace voxeld
