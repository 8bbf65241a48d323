// What the daemon's JSON says, as the library's structures.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "client/include/voxeld/client.h"

namespace voxeld::client {

// A member, "" or 0 where there is none of that type.
std::string text_of(const nlohmann::json& object, const char* name);
int64_t number_of(const nlohmann::json& object, const char* name);

// Throws Error "bad-answer" for text that is no JSON object.
nlohmann::json parse_object(const std::string& text);
// Throws Error "bad-answer" for an object that is no job.
JobInfo job_info(const nlohmann::json& status);
// Throws Error "bad-answer" for an object that is no list of frames.
JobFrames job_frames(const nlohmann::json& answer);

// Throws Error "bad-answer" for an object that is no queue.
Queue queue_of(const nlohmann::json& answer);

}  // namespace voxeld::client
