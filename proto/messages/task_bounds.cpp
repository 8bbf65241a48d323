#include "proto/messages/task_bounds.h"

#include <nlohmann/json.hpp>
#include <string>

#include "proto/messages/json_bounds.h"
#include "proto/messages/task_fields.h"

namespace voxeld {
namespace {

using Json = nlohmann::json;

std::string type_of(const Json& message) {
  const auto type = message.is_object() ? message.find("type") : message.end();
  return type != message.end() && type->is_string() ? type->get<std::string>() : std::string();
}

}  // namespace

Result<Json> parse_worker_message(std::string_view text) {
  VOXELD_ASSIGN(Json message, parse_json_bounded(
                                  text, JsonBounds{.bytes_max = limits::kWorkerMessageBytesMax,
                                                   .depth_max = limits::kWorkerMessageDepthMax,
                                                   .values_max = limits::kWorkerMessageValuesMax}));
  const std::string type = type_of(message);
  if (type == "complete" || text.size() <= limits::kWorkerReportBytesMax) return message;
  Error error = unfit("at most " + std::to_string(limits::kWorkerReportBytesMax) + " bytes",
                      std::to_string(text.size()));
  error.detail = "task message is too long: " + unfit("", type).got;
  return error;
}

Status check_bounds(const TaskCompletion& completion) {
  return check_fields(completion);
}

}  // namespace voxeld
