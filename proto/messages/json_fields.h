// Reading members of JSON objects into plain values, with errors that name the member.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "proto/result.h"

namespace voxeld {

// Reads members one after the other and keeps the first error. An absent member leaves its field
// unchanged.
class JsonFields {
 public:
  JsonFields(const nlohmann::json& object, std::string_view what) : object_(object), what_(what) {
    if (!object.is_object()) fail("", "an object", object.type_name());
  }

  void read(const char* name, std::string& field) {
    if (const auto* value = find(
            name, [](const auto& v) { return v.is_string(); }, "a text")) {
      field = value->template get<std::string>();
    }
  }
  void read(const char* name, int64_t& field) {
    if (const auto* value = find(
            name, [](const auto& v) { return v.is_number_integer(); }, "an integer")) {
      // nlohmann's parser makes an unsigned number above the range of int64_t, and get() would
      // wrap.
      if (value->is_number_unsigned() && !std::in_range<int64_t>(value->template get<uint64_t>())) {
        return fail(name, "an integer of 64 bits", value->dump());
      }
      field = value->template get<int64_t>();
    }
  }
  void read(const char* name, int& field) {
    int64_t wide = field;
    read(name, wide);
    if (!std::in_range<int>(wide)) return fail(name, "an integer of 32 bits", std::to_string(wide));
    field = static_cast<int>(wide);
  }
  void read(const char* name, double& field) {
    if (const auto* value = find(
            name, [](const auto& v) { return v.is_number(); }, "a number")) {
      field = value->template get<double>();
    }
  }
  void read(const char* name, bool& field) {
    if (const auto* value = find(
            name, [](const auto& v) { return v.is_boolean(); }, "true or false")) {
      field = value->template get<bool>();
    }
  }
  // Fails unless the object has these members.
  void require(std::initializer_list<const char*> names) {
    for (const char* name : names) {
      if (!error_ && !object_.contains(name)) fail(name, "it to be there", "nothing");
    }
  }
  // The member, unchecked; null if it is absent.
  const nlohmann::json* member(const char* name) {
    return find(
        name, [](const auto&) { return true; }, "");
  }
  void fail(std::string_view name, std::string_view expected, std::string_view got) {
    if (error_) return;
    error_ = Error{ErrorCode::kBadRequest,
                   std::string(what_) + (name.empty() ? "" : "." + std::string(name)),
                   std::string(expected), std::string(got)};
  }
  Status finish() const { return error_ ? Status(*error_) : Status(); }

 private:
  template <typename Is>
  const nlohmann::json* find(const char* name, Is is, std::string_view expected) {
    if (error_) return nullptr;
    const auto it = object_.find(name);
    if (it == object_.end()) return nullptr;
    if (is(*it)) return &*it;
    fail(name, expected, it->type_name());
    return nullptr;
  }

  const nlohmann::json& object_;
  std::string_view what_;
  std::optional<Error> error_;
};

}  // namespace voxeld
