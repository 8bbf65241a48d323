// Environment variables that are set only while a driver loads.
#pragma once

#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

namespace voxeld::gpu {

// Sets and unsets variables and restores them at the end of the scope. A driver's settings then
// leak neither to another device nor to child processes. Not thread-safe, like the environment
// itself.
class ScopedEnvironment {
 public:
  ScopedEnvironment() = default;
  ScopedEnvironment(const ScopedEnvironment&) = delete;
  ScopedEnvironment& operator=(const ScopedEnvironment&) = delete;
  ~ScopedEnvironment() {
    for (auto it = saved_.rbegin(); it != saved_.rend(); ++it) {
      if (it->value) {
        ::setenv(it->name.c_str(), it->value->c_str(), 1);
      } else {
        ::unsetenv(it->name.c_str());
      }
    }
  }
  void set(const char* name, const char* value) {
    save(name);
    ::setenv(name, value, 1);
  }
  void unset(const char* name) {
    save(name);
    ::unsetenv(name);
  }

 private:
  struct Saved {
    std::string name;
    std::optional<std::string> value;
  };
  void save(const char* name) {
    const char* value = std::getenv(name);
    saved_.push_back({name, value == nullptr ? std::nullopt : std::optional<std::string>(value)});
  }
  std::vector<Saved> saved_;
};

// Sets the variables that every Mesa software driver needs; see workarounds.h.
void set_mesa_software_environment(ScopedEnvironment& environment);

}  // namespace voxeld::gpu
