// Structured logging to stderr: one line per event, "message key=value …". A thin layer over
// spdlog, so only log.cpp compiles it.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace voxeld::log {

enum class Level { kDebug, kInfo, kWarn, kError };

// A key and its value. The value is quoted if it contains spaces, and cleaned of control
// characters: put text from users into fields. Fields with an empty value are omitted.
struct Field {
  std::string_view key;
  std::string value;
  Field(std::string_view k, std::string_view v) : key(k), value(v) {}
  Field(std::string_view k, const char* v) : key(k), value(v) {}
  Field(std::string_view k, const std::string& v) : key(k), value(v) {}
  Field(std::string_view k, long long v) : key(k), value(std::to_string(v)) {}
  Field(std::string_view k, long v) : key(k), value(std::to_string(v)) {}
  Field(std::string_view k, int v) : key(k), value(std::to_string(v)) {}
  Field(std::string_view k, unsigned long v) : key(k), value(std::to_string(v)) {}
  Field(std::string_view k, double v) : key(k), value(std::to_string(v)) {}
};

// Sets the lowest level that is written (default kInfo) and the process name of every line
// ("gateway", "worker llvmpipe"). Call it once, before threads start.
void configure(Level lowest, std::string_view process);
void write(Level level, std::string_view message, std::initializer_list<Field> fields = {});

inline void debug(std::string_view m, std::initializer_list<Field> f = {}) {
  write(Level::kDebug, m, f);
}
inline void info(std::string_view m, std::initializer_list<Field> f = {}) {
  write(Level::kInfo, m, f);
}
inline void warn(std::string_view m, std::initializer_list<Field> f = {}) {
  write(Level::kWarn, m, f);
}
inline void error(std::string_view m, std::initializer_list<Field> f = {}) {
  write(Level::kError, m, f);
}

}  // namespace voxeld::log
