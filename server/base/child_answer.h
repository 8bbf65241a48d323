// Runs a program and reads what it says: for work that a driver may crash or hang in.
#pragma once

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld {

// What a child wrote to stdout and how it ended.
struct ChildAnswer {
  std::string text;
  std::string failure;  // empty: it exited by itself with status 0
};

// `command`: a path and its arguments. The child's stderr goes nowhere: drivers complain there. A
// child that takes longer than `timeout` is killed.
ChildAnswer run_child(const std::vector<std::string>& command, std::chrono::milliseconds timeout);

// From the last line that starts with a brace on: drivers may have written others before it.
std::string_view last_json_line(std::string_view text);

}  // namespace voxeld
