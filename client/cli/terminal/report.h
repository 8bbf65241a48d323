// Output of commands: JSON and warnings, and lines for people.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "client/cli/arguments.h"
#include "client/include/voxeld/client.h"

namespace voxeld::cli {

// null for a text that is not JSON.
nlohmann::json parsed(const std::string& text);
void print_json(const nlohmann::json& value);

client::Settings settings_of(const Arguments& arguments);

// Prints the job's warnings to stderr, unless --quiet.
void tell_warnings(const Arguments& arguments, const client::JobInfo& job);

// "bunny.vox: 256 x 254 x 199 cells, 145,231 voxels, 1.2 MB, 0.42 s".
std::string result_line(const std::string& output, const client::JobInfo& job, std::int64_t bytes,
                        double seconds);

}  // namespace voxeld::cli
