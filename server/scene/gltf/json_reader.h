// Reads a JSON tree into structs and checks it on the way. Each struct has a function
//
//   void members(Object o, T& to);
//
// that lists its members: key, destination, and for an index the top-level array that it points
// into. The type of the destination is the rule, so the check and the conversion are one line.
//
//   bool, double, std::string   that type; strings are moved out of the tree
//   uint64_t, int               an integer from 0 to 2^53; 1.0 is one. An int keeps at most INT_MAX
//   int with a target           an index of an existing element of that array
//   std::vector<T>              an array of at most kArrayElementsMax elements of that rule
//   std::map<std::string, int>  an object whose members are indices
//   a struct, a lambda          an object with the members that the function lists
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "proto/range_text.h"
#include "server/scene/gltf/document.h"
#include "server/scene/mesh_error.h"

namespace voxeld::gltf {

using Json = nlohmann::json;

class JsonReader;

// A JSON object while its members are read. An absent optional member leaves its destination as it
// is.
struct Object {
  JsonReader& reader;
  Json& json;

  template <typename T>
  void optional(const char* key, T&& to, const char* target = nullptr) const;
  template <typename T>
  void required(const char* key, T&& to, const char* target = nullptr) const;
  bool has(const char* key) const { return json.contains(key); }
  // Records an error about the member `key`.
  void refuse(const char* key, std::string_view what, std::string expected, std::string got) const;
};

template <typename T>
inline constexpr bool kIsVector = false;
template <typename T>
inline constexpr bool kIsVector<std::vector<T>> = true;

// Keeps the first error; after it, every read does nothing.
class JsonReader {
 public:
  // `root` has the arrays that indices point into.
  JsonReader(std::string_view name, const Json& root) : name_(name), root_(root) {}

  Status finish() const { return error_ ? Status(*error_) : Status(); }

  template <typename T>
  void member(Json& object, const char* key, bool is_required, T& to, const char* target) {
    if (error_) return;
    path_.emplace_back(key);
    const auto found = object.find(key);
    if (found != object.end()) {
      read(*found, to, target);
    } else if (is_required) {
      fail("is missing", noun_of<T>(target), "nothing");
    }
    path_.pop_back();
  }

  template <typename T>
  void read(Json& from, T& to, const char* target = nullptr) {
    if constexpr (std::is_same_v<T, bool>) {
      if (!from.is_boolean()) return wrong("true or false", from);
      to = from.get<bool>();
    } else if constexpr (std::is_same_v<T, std::string>) {
      if (!from.is_string()) return wrong("a string", from);
      to = std::move(from.get_ref<std::string&>());
    } else if constexpr (std::is_same_v<T, double>) {
      if (!from.is_number()) return wrong("a number", from);
      to = from.get<double>();
    } else if constexpr (std::is_integral_v<T>) {
      const auto size = size_of(from);
      if (target != nullptr) return read_index(from, size, to, target);
      if (!size) return wrong("an integer from 0 to 2^53", from);
      to = static_cast<T>(std::min(*size, uint64_t{std::numeric_limits<T>::max()}));
    } else if constexpr (kIsVector<T>) {
      read_array(from, to, target);
    } else {
      if (!from.is_object()) return wrong("an object", from);
      if constexpr (std::is_same_v<T, Attributes>) {
        for (const auto& [key, index] : from.items()) {
          path_.emplace_back(key.c_str());
          read(index, to[key], target);
          path_.pop_back();
        }
      } else if constexpr (std::is_invocable_v<T&, Object>) {
        to(Object{*this, from});
      } else {
        members(Object{*this, from}, to);
      }
    }
  }

  void wrong(std::string expected, const Json& got) {
    std::string text = got.type_name();
    if (got.is_string()) text = shown(got.get_ref<const std::string&>());
    if (got.is_number() || got.is_boolean()) text = got.dump();
    fail("wrong value", std::move(expected), std::move(text));
  }
  // `key`: of the member that is wrong; null for the value that is being read.
  void fail(std::string_view what, std::string expected, std::string got,
            const char* key = nullptr) {
    if (error_) return;
    if (key != nullptr) path_.emplace_back(key);
    error_ = malformed_mesh(name_, path(), what, std::move(expected), std::move(got));
  }

  // An integer in [0, 2^53], up to where every JSON writer keeps integers exact; nullopt for other
  // values.
  static std::optional<uint64_t> size_of(const Json& value) {
    constexpr uint64_t kSizeMax = uint64_t{1} << 53;
    if (value.is_number_unsigned()) {
      const auto size = value.get<uint64_t>();
      return size <= kSizeMax ? std::optional(size) : std::nullopt;
    }
    if (!value.is_number()) return std::nullopt;
    const auto number = value.get<double>();
    if (!(number >= 0.0 && number <= static_cast<double>(kSizeMax))) return std::nullopt;
    if (number != std::floor(number)) return std::nullopt;
    return static_cast<uint64_t>(number);
  }

 private:
  // What an absent member should have been.
  template <typename T>
  static const char* noun_of(const char* target) {
    if (kIsVector<T>) return "an array";
    if (std::is_integral_v<T>) return target != nullptr ? "an index" : "an integer";
    return std::is_same_v<T, std::string> ? "a string" : "an object";
  }

  template <typename T>
  void read_index(const Json& from, std::optional<uint64_t> index, T& to, const char* target) {
    const auto array = root_.find(target);
    const size_t count = array != root_.end() && array->is_array() ? array->size() : 0;
    if (count == 0) return wrong(index_text(0, target), from);
    if (!index || *index >= count) {
      return wrong("an index of one of " + std::to_string(count) + " " + target, from);
    }
    to = static_cast<T>(std::min(*index, uint64_t{std::numeric_limits<T>::max()}));
  }

  template <typename T>
  void read_array(Json& from, std::vector<T>& to, const char* target) {
    if (!from.is_array()) return wrong("an array", from);
    if (from.size() > kArrayElementsMax) {
      return fail("elements", "at most " + std::to_string(kArrayElementsMax),
                  std::to_string(from.size()));
    }
    to.reserve(from.size());
    for (size_t i = 0; i < from.size() && !error_; ++i) {
      path_.emplace_back(i);
      read(from[i], to.emplace_back(), target);
      path_.pop_back();
    }
  }

  std::string path() const {
    std::string text;
    for (const auto& step : path_) {
      if (const auto* index = std::get_if<size_t>(&step)) {
        text += "[" + std::to_string(*index) + "]";
      } else {
        const std::string_view key = std::get<const char*>(step);
        text.append(text.empty() ? "" : ".").append(is_word(key) ? std::string(key) : shown(key));
      }
    }
    return text;
  }
  // Whether an attribute name is plain. Only hostile files have others.
  static bool is_word(std::string_view key) {
    return key.size() <= 40 && std::all_of(key.begin(), key.end(), [](char c) {
             return c == '_' || (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') ||
                    (c >= 'a' && c <= 'z');
           });
  }

  std::string_view name_;
  const Json& root_;
  std::vector<std::variant<const char*, size_t>> path_;
  std::optional<Error> error_;
};

template <typename T>
void Object::optional(const char* key, T&& to, const char* target) const {
  reader.member(json, key, false, to, target);
}

template <typename T>
void Object::required(const char* key, T&& to, const char* target) const {
  reader.member(json, key, true, to, target);
}

inline void Object::refuse(const char* key, std::string_view what, std::string expected,
                           std::string got) const {
  reader.fail(what, std::move(expected), std::move(got), key);
}

}  // namespace voxeld::gltf
