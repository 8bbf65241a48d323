// Messages of the task API, from a faulty worker or gateway. An accepted message is written as a
// text that is accepted again and gives the same message.
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>

#include "proto/messages/task_api.h"
#include "proto/messages/task_bounds.h"
#include "server/base/check.h"

namespace {

template <typename Message>
void check(const nlohmann::json& json,
           voxeld::Result<Message> (*parse)(const nlohmann::json& message)) {
  const auto message = parse(json);
  if (!message) {
    VOXELD_CHECK(!message.error().detail.empty(), "an error says what");
    return;
  }
  const nlohmann::json written = voxeld::to_json_message(*message);
  const auto again = parse(written);
  VOXELD_CHECK(again.ok(), "what is written is taken");
  VOXELD_CHECK(voxeld::to_json_message(*again) == written, "a message comes back");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto json = voxeld::parse_worker_message({reinterpret_cast<const char*>(data), size});
  if (!json) return 0;
  check(*json, voxeld::parse_worker_hello);
  check(*json, voxeld::parse_worker_folders);
  check(*json, voxeld::parse_task);
  check(*json, voxeld::parse_task_progress);
  check(*json, voxeld::parse_task_progress_reply);
  check(*json, voxeld::parse_task_frame);
  check(*json, voxeld::parse_task_frame_reply);
  check(*json, voxeld::parse_task_part);
  check(*json, voxeld::parse_task_part_reply);
  check(*json, voxeld::parse_task_completion);
  check(*json, voxeld::parse_task_preempt);
  check(*json, voxeld::parse_task_failure);
  check(*json, voxeld::parse_slices_hello);
  check(*json, voxeld::parse_slice_request);
  check(*json, voxeld::parse_slice_reply);
  return 0;
}
