// Converts the daemon's JSON to the library's structures.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "client/include/voxeld/client.h"

namespace voxeld::client {

// A member of an object; "" or 0 if there is none of that type.
std::string text_of(const nlohmann::json& object, const char* name);
int64_t number_of(const nlohmann::json& object, const char* name);

// Throws Error "bad-response" if the text is not a JSON object.
nlohmann::json parse_object(const std::string& text);
// Throws Error "bad-response" if the object is not a job.
JobInfo job_info(const nlohmann::json& status);
// Throws Error "bad-response" if the object is not a list of frames.
JobFrames job_frames(const nlohmann::json& response);

// Throws Error "bad-response" if the object is not a queue.
Queue queue_of(const nlohmann::json& response);

}  // namespace voxeld::client
