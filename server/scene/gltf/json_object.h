// Reads a JSON tree into structs and checks it on the way. Each struct has a function
//
//   void members(JsonObject o, T& to);
//
// that lists its members: key, destination, and for an index the top-level array that it points
// into. The type of the destination is the rule, so the check and the conversion are one line.
//
//   bool, double, std::string   that type; strings are moved out of the tree
//   uint64_t, int               an integer from 0 to 2^53; 1.0 is one. An int keeps at most INT_MAX
//   int with a target           an index of an existing element of that array
//   std::vector<T>              an array of at most kArrayElementsMax elements of that rule
//   Attributes                  an object whose members are indices
//   a struct, a lambda          an object with the members that the function lists
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "proto/text/number_text.h"
#include "server/base/cancel_point.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/gltf/document.h"

namespace voxeld::gltf {

// The state of reading one document.
struct JsonReading {
  std::string_view name;
  const nlohmann::json& root;  // has the arrays that indices point into
  std::vector<std::variant<const char*, size_t>> path = {};  // of the value that is being read
  std::optional<Error> error = {};  // the first one; after it, every read does nothing
};

// A JSON object while its members are read.
class JsonObject {
 public:
  using Json = nlohmann::json;

  JsonObject(JsonReading& reading, Json& json) : reading_(reading), json_(json) {}

  bool has(const char* key) const { return json_.contains(key); }
  const Json& json() const { return json_; }

  // An absent member leaves its destination as it is.
  template <typename T>
  void optional(const char* key, T&& to, const char* target = nullptr) {
    read_member(key, false, to, target);
  }
  template <typename T>
  void required(const char* key, T&& to, const char* target = nullptr) {
    read_member(key, true, to, target);
  }
  // Records an error about the member `key`.
  void refuse(const char* key, std::string_view what, std::string expected, std::string got) {
    if (reading_.error) return;
    reading_.path.emplace_back(key);
    fail(what, std::move(expected), std::move(got));
  }

 private:
  template <typename T>
  static constexpr bool kIsVector = requires(T& to) {
    to.emplace_back();
  };

  template <typename T>
  void read_member(const char* key, bool is_required, T& to, const char* target) {
    if (reading_.error) return;
    reading_.path.emplace_back(key);
    const auto found = json_.find(key);
    if (found != json_.end()) {
      read(*found, to, target);
    } else if (is_required) {
      fail("is missing",
           kIsVector<T>                     ? "an array"
           : std::is_same_v<T, std::string> ? "a string"
           : !std::is_integral_v<T>         ? "an object"
           : target != nullptr              ? "an index"
                                            : "an integer",
           "nothing");
    }
    reading_.path.pop_back();
  }

  template <typename T>
  void read(Json& from, T& to, const char* target) {
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
      const std::optional<uint64_t> size = size_of(from);
      if (target != nullptr && !is_index(from, size, target)) return;
      if (!size) return wrong("an integer from 0 to 2^53", from);
      to = static_cast<T>(std::min(*size, uint64_t{std::numeric_limits<T>::max()}));
    } else if constexpr (kIsVector<T>) {
      if (!from.is_array()) return wrong("an array", from);
      if (from.size() > kArrayElementsMax) {
        return fail("elements", "at most " + std::to_string(kArrayElementsMax),
                    std::to_string(from.size()));
      }
      to.reserve(from.size());
      for (size_t i = 0; i < from.size(); ++i) {
        cancel_point();
        read_at(i, from[i], to.emplace_back(), target);
      }
    } else if (!from.is_object()) {
      wrong("an object", from);
    } else if constexpr (std::is_same_v<T, Attributes>) {
      for (const auto& [key, index] : from.items()) read_at(key.c_str(), index, to[key], target);
    } else if constexpr (std::is_invocable_v<T&, JsonObject>) {
      to(JsonObject(reading_, from));
    } else {
      members(JsonObject(reading_, from), to);
    }
  }

  template <typename Step, typename T>
  void read_at(Step step, Json& from, T& to, const char* target) {
    if (reading_.error) return;
    reading_.path.emplace_back(step);
    read(from, to, target);
    reading_.path.pop_back();
  }

  // An integer in [0, 2^53], up to where every JSON writer keeps integers exact; nullopt for other
  // values.
  static std::optional<uint64_t> size_of(const Json& value) {
    constexpr uint64_t kSizeMax = uint64_t{1} << 53;
    if (!value.is_number()) return std::nullopt;
    const auto number = value.get<double>();
    if (!(number >= 0.0 && number <= static_cast<double>(kSizeMax))) return std::nullopt;
    if (number != std::floor(number)) return std::nullopt;
    return static_cast<uint64_t>(number);
  }

  bool is_index(const Json& from, std::optional<uint64_t> index, const char* target) {
    const auto array = reading_.root.find(target);
    const size_t count =
        array != reading_.root.end() && array->is_array() ? array->size() : size_t{0};
    if (index && *index < count) return true;
    wrong(count == 0 ? index_text(0, target)
                     : "an index of one of " + std::to_string(count) + " " + target,
          from);
    return false;
  }

  void wrong(std::string expected, const Json& got) {
    std::string text = got.type_name();
    if (got.is_string()) text = shown(got.get_ref<const std::string&>());
    if (got.is_number() || got.is_boolean()) text = got.dump();
    fail("wrong value", std::move(expected), std::move(text));
  }

  void fail(std::string_view what, std::string expected, std::string got) {
    std::string where;
    for (const auto& step : reading_.path) {
      if (const auto* index = std::get_if<size_t>(&step)) {
        where += "[" + std::to_string(*index) + "]";
      } else {
        const std::string_view key = std::get<const char*>(step);
        where.append(where.empty() ? "" : ".").append(is_word(key) ? std::string(key) : shown(key));
      }
    }
    reading_.error =
        malformed_mesh(reading_.name, where, what, std::move(expected), std::move(got));
  }
  // Whether an attribute name is plain. Only hostile files have others.
  static bool is_word(std::string_view key) {
    return key.size() <= 40 && std::all_of(key.begin(), key.end(), [](char c) {
             return c == '_' || (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') ||
                    (c >= 'a' && c <= 'z');
           });
  }

  JsonReading& reading_;
  Json& json_;
};

}  // namespace voxeld::gltf
