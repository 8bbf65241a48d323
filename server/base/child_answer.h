// Runs a program and reads its output: for work in which a driver may crash or hang.
#pragma once

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld {

// The stdout of a child, and how it ended.
struct ChildAnswer {
  std::string text;
  std::string failure;  // empty: it exited with status 0
};

// Runs `command`, a path and its arguments. The child's stderr is discarded, because drivers
// complain there. A child that exceeds `timeout` is killed.
ChildAnswer run_child(const std::vector<std::string>& command, std::chrono::milliseconds timeout);

// The text from the last line on that starts with a brace. Drivers may have printed other lines
// before it.
std::string_view last_json_line(std::string_view text);

}  // namespace voxeld
