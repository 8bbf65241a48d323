// Field lists of messages. A struct that crosses a process as JSON has one list of its members:
//
//   void visit_fields(IsA<TaskPart> auto& part, auto& visit) {
//     visit.type("part");
//     visit(kRequired, "task", part.task);
//     visit(kOptional, "position", part.position, within(0, kPartsMax - 1));
//   }
//
// Writing (fields_json), reading (read_fields) and checking (check_fields) follow from the list:
// each is a visitor of it. type() gives the text of the member "type", name() the name of a struct
// without one; both begin the errors. A rule (field_rules.h) bounds the value. A list is read in
// its order, so a rule may use a member that stands before its own.
//
// Members are texts, numbers, true or false, lists, structs with a list of their own, std::optional
// (absent if unset), enums with enum_words(), and values with a form of their own: a wrapper with
// `Status read(const nlohmann::json&)` and `Tree tree<Tree>()`.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "proto/messages/job.h"
#include "proto/result.h"

namespace voxeld {

// When a member is in the JSON. Reading leaves an absent one that is not required as it was.
enum class Need {
  kRequired,
  kOptional,
  kUnlessDefault,  // written unless it is 0 or empty
};
using enum Need;

// The struct of a list, const when it is written or checked.
template <typename T, typename Struct>
concept IsA = std::same_as<std::remove_const_t<T>, Struct>;

struct AnyValue {
  Status operator()(const auto&) const { return {}; }
};

// An error about a value; the visitors put the names of its members before it. Text from outside is
// cut and has no control characters.
inline Error unfit(std::string expected, std::string_view got) {
  std::string shown(got.substr(0, 80));
  std::ranges::replace_if(
      shown, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  return {ErrorCode::kBadRequest, "", std::move(expected), std::move(shown)};
}
inline Error within_member(std::string_view member, Error error) {
  error.detail.insert(0, member);
  return error;
}
inline std::string list_index(size_t index) {
  return "[" + std::to_string(index) + "]";
}

template <typename T>
inline constexpr bool kIsList = false;
template <typename T>
inline constexpr bool kIsList<std::vector<T>> = true;
template <typename T>
inline constexpr bool kIsOptional = false;
template <typename T>
inline constexpr bool kIsOptional<std::optional<T>> = true;
template <typename T>
concept HasWords = std::is_enum_v<T> && requires(T value) {
  enum_words(value);
};
template <typename T>
concept HasOwnForm = requires(T& value, const nlohmann::json& json) {
  { value.read(json) } -> std::same_as<Status>;
};

template <HasWords Enum>
std::string_view word_of(Enum value) {
  return enum_words(value)[static_cast<size_t>(value)];
}
template <HasWords Enum>
std::optional<Enum> enum_from_word(std::string_view word) {
  const auto words = enum_words(Enum{});
  const auto it = std::ranges::find(words, word);
  if (it == words.end()) return std::nullopt;
  return static_cast<Enum>(it - words.begin());
}

// Whether the member is not written.
template <typename T>
bool is_absent(Need need, const T& value) {
  if constexpr (kIsOptional<T>) return !value.has_value();
  if constexpr (std::is_arithmetic_v<T> || std::same_as<T, std::string>) {
    return need == kUnlessDefault && value == T{};
  }
  return false;
}

// ---- Writing ------------------------------------------------------------------------------------

// A struct as a tree of values: nlohmann::json, or ordered_json, which keeps the list's order.
template <typename Tree, typename Struct>
Tree fields_json(const Struct& value);

template <typename Tree, typename T>
Tree value_json(const T& value) {
  if constexpr (HasOwnForm<T>) {
    return value.template tree<Tree>();
  } else if constexpr (HasWords<T>) {
    return word_of(value);
  } else if constexpr (kIsOptional<T>) {
    return value_json<Tree>(*value);
  } else if constexpr (std::same_as<T, StageTimes>) {
    Tree list = Tree::array();  // [["parse", 1.5], …]: the order matters
    for (const auto& [stage, ms] : value) list.push_back(Tree::array({stage, ms}));
    return list;
  } else if constexpr (kIsList<T>) {
    Tree list = Tree::array();
    for (const auto& entry : value) list.push_back(value_json<Tree>(entry));
    return list;
  } else if constexpr (std::is_arithmetic_v<T> || std::convertible_to<T, std::string_view>) {
    return value;
  } else {
    return fields_json<Tree>(value);
  }
}

template <typename Tree>
class TreeWriter {
 public:
  void type(std::string_view type) { object_["type"] = type; }
  void name(std::string_view) {}
  template <typename T, typename Rule = AnyValue>
  void operator()(Need need, const char* name, const T& value, const Rule& = {}) {
    if (!is_absent(need, value)) object_[name] = value_json<Tree>(value);
  }
  Tree take() { return std::move(object_); }

 private:
  Tree object_ = Tree::object();
};

template <typename Tree, typename Struct>
Tree fields_json(const Struct& value) {
  TreeWriter<Tree> writer;
  visit_fields(value, writer);
  return writer.take();
}

// ---- Reading ------------------------------------------------------------------------------------

// Reading either ignores or refuses members that are not in the list.
enum class Unlisted { kIgnore, kRefuse };

// Reads an object into `value`. Errors: bad-request, "task.fence: expected an integer, got string".
template <typename Struct>
Status read_fields(const nlohmann::json& object, Struct& value,
                   Unlisted unlisted = Unlisted::kIgnore);

// Each reads a value of its type. Errors: bad-request without a name.
Status read_value(const nlohmann::json& json, std::string& value);
Status read_value(const nlohmann::json& json, int64_t& value);
Status read_value(const nlohmann::json& json, uint64_t& value);  // up to INT64_MAX
Status read_value(const nlohmann::json& json, int& value);
Status read_value(const nlohmann::json& json, double& value);
Status read_value(const nlohmann::json& json, bool& value);
Status read_value(const nlohmann::json& json, std::vector<std::string>& value);
Status read_value(const nlohmann::json& json, StageTimes& value);
// Never fails: what is no problem document becomes `internal` with its text.
Status read_value(const nlohmann::json& json, Error& value);

template <typename T>
Status read_member(const nlohmann::json& from, T& value, Unlisted unlisted) {
  if constexpr (HasOwnForm<T>) {
    return value.read(from);
  } else if constexpr (HasWords<T>) {
    std::string word;
    VOXELD_TRY(read_value(from, word));
    if (const auto known = enum_from_word<T>(word)) {
      value = *known;
      return {};
    }
    std::string words;
    for (const std::string_view one : enum_words(value)) {
      words += (words.empty() ? "" : " | ") + std::string(one);
    }
    return unfit(words, "\"" + word.substr(0, 40) + "\"");
  } else if constexpr (kIsOptional<T>) {
    return read_member(from, value.emplace(), unlisted);
  } else if constexpr (requires { read_value(from, value); }) {
    return read_value(from, value);
  } else if constexpr (kIsList<T>) {
    if (!from.is_array()) return unfit("a list", from.type_name());
    value.clear();
    for (const auto& entry : from) {
      if (const Status status = read_member(entry, value.emplace_back(), unlisted); !status) {
        return within_member(list_index(value.size() - 1), status.error());
      }
    }
    return {};
  } else {
    return read_fields(from, value, unlisted);
  }
}

// Keeps the first error; a member that is not in the list counts before one that is missing, since
// it is most likely that one misspelt.
class FieldReader {
 public:
  FieldReader(const nlohmann::json& object, Unlisted unlisted)
      : object_(object), unlisted_(unlisted) {
    if (!object.is_object()) error_ = unfit("an object", object.type_name());
  }
  void type(std::string_view type);
  void name(std::string_view name) { name_ = name; }
  template <typename T, typename Rule = AnyValue>
  void operator()(Need need, const char* name, T&& value, const Rule& rule = {}) {
    if (unlisted_ == Unlisted::kRefuse) names_.emplace_back(name);
    if (error_) return;
    const auto it = object_.find(name);
    if (it == object_.end()) {
      if (need == kRequired) {
        fail(name, unfit("a value", "nothing"));
        is_missing_ = true;
      }
      return;
    }
    Status status = read_member(*it, value, unlisted_);
    if (status) status = rule(value);
    if (!status) fail(name, std::move(status).error());
  }
  Status finish();

 private:
  void fail(const char* member, Error error) {
    error_ = within_member("." + std::string(member), std::move(error));
  }

  const nlohmann::json& object_;
  const Unlisted unlisted_;
  std::string_view name_;
  std::vector<std::string_view> names_;
  std::optional<Error> error_;
  bool is_missing_ = false;  // error_ is a member that is required and not there
};

template <typename Struct>
Status read_fields(const nlohmann::json& object, Struct& value, Unlisted unlisted) {
  FieldReader reader(object, unlisted);
  visit_fields(value, reader);
  return reader.finish();
}

// ---- Checking -----------------------------------------------------------------------------------

// Applies the rules of the list, as reading does.
template <typename Struct>
Status check_fields(const Struct& value);

class FieldChecker {
 public:
  void type(std::string_view type) { name_ = type; }
  void name(std::string_view name) { name_ = name; }
  template <typename T, typename Rule = AnyValue>
  void operator()(Need, const char* name, const T& value, const Rule& rule = {}) {
    if (!status_) return;
    status_ = check_value(value);
    if (status_) status_ = rule(value);
    if (!status_) status_.error() = within_member("." + std::string(name), status_.error());
  }
  Status finish() {
    if (!status_) status_.error() = within_member(name_, status_.error());
    return status_;
  }

 private:
  template <typename T>
  static Status check_value(const T& value) {
    if constexpr (kIsList<T> && !std::same_as<T, StageTimes>) {
      for (size_t i = 0; i < value.size(); ++i) {
        if (const Status status = check_value(value[i]); !status) {
          return within_member(list_index(i), status.error());
        }
      }
    } else if constexpr (requires(FieldChecker & checker) { visit_fields(value, checker); }) {
      return check_fields(value);
    }
    return {};
  }

  std::string_view name_;
  Status status_;
};

template <typename Struct>
Status check_fields(const Struct& value) {
  FieldChecker checker;
  visit_fields(value, checker);
  return checker.finish();
}

}  // namespace voxeld
