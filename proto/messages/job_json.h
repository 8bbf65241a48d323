// JSON of the parts that the job API and the task API share.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "proto/messages/job.h"

namespace voxeld {

nlohmann::json error_json(const Error& error);
Error parse_error_json(const nlohmann::json& body);
nlohmann::json warnings_json(const std::vector<Warning>& warnings);
Result<std::vector<Warning>> parse_warnings(const nlohmann::json& body);
// [["parse", 1.5], …]: an array, because the order matters.
nlohmann::json timings_json(const StageTimes& timings);
Result<StageTimes> parse_timings(const nlohmann::json& body);

}  // namespace voxeld
