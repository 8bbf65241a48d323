// A JSON writer, member by member, without a tree of values. A tree takes 16 bytes and more per
// value. nlohmann's destructor also allocates, which ends a process that is out of memory.
#pragma once

#include <array>
#include <charconv>
#include <concepts>
#include <cstddef>
#include <string>
#include <string_view>

namespace voxeld {

// Appends JSON to a text and sets the commas.
class JsonWriter {
 public:
  explicit JsonWriter(std::string& text) : text_(text) {}

  JsonWriter& begin_object() { return open('{'); }
  JsonWriter& end_object() { return close('}'); }
  JsonWriter& begin_array() { return open('['); }
  JsonWriter& end_array() { return close(']'); }
  // Writes a key; its value must follow.
  JsonWriter& key(std::string_view name);

  // Writes a string. Bytes that are not UTF-8 become U+FFFD.
  JsonWriter& value(std::string_view text);
  JsonWriter& value(const std::string& text) { return value(std::string_view(text)); }
  JsonWriter& value(const char* text) { return value(std::string_view(text)); }
  JsonWriter& value(std::same_as<bool> auto flag) { return raw(flag ? "true" : "false"); }
  // Writes the shortest text that reads back as the same number; null if it is not finite.
  JsonWriter& value(double number);
  template <std::integral Number>
  requires(!std::same_as<Number, bool> &&
           !std::same_as<Number, char>) JsonWriter& value(Number number) {
    std::array<char, 24> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), number).ptr;
    return raw({digits.data(), end});
  }
  template <typename Number, size_t kCount>
  JsonWriter& value(const std::array<Number, kCount>& numbers) {
    begin_array();
    for (const Number number : numbers) value(number);
    return end_array();
  }
  // Writes text that is JSON already.
  JsonWriter& raw(std::string_view json);

  template <typename Value>
  JsonWriter& member(std::string_view name, const Value& one) {
    return key(name).value(one);
  }

 private:
  JsonWriter& open(char bracket);
  JsonWriter& close(char bracket);
  // Sets the comma before a value or a key, if one is due.
  void separate();

  std::string& text_;
};

}  // namespace voxeld
