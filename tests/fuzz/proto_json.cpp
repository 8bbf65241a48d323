// JSON from outside. Accepted values must survive operations that overflow the stack on deep
// values: copy, compare and dump. They also pass through the reader of requests.
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>

#include "proto/messages/job.h"
#include "server/base/check.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto json = voxeld::parse_json_bounded({reinterpret_cast<const char*>(data), size});
  if (!json) {
    VOXELD_CHECK(!json.error().detail.empty(), "an error says what");
    return 0;
  }
  const nlohmann::json copy = *json;
  VOXELD_CHECK(!copy.is_discarded(), "what is taken is a value");
  const auto again = voxeld::parse_json_bounded(copy.dump());
  VOXELD_CHECK(again && *again == copy, "what is written is read as the same");
  if (const auto request = voxeld::parse_job_request(copy)) {
    const voxeld::OptionScope scope = voxeld::option_scope(*request);
    const auto options = nlohmann::json::parse(voxeld::canonical_json(request->options, scope));
    VOXELD_CHECK(voxeld::parse_options(options, scope).ok(), "the canonical form is taken");
  }
  return 0;
}
