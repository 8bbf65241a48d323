// Expected failures as values: Result<T> carries either a T or an Error of the closed ErrorCode
// set. The daemon and the client share it, so it is in proto.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "proto/error_code.h"

namespace voxeld {

// A failure, in the words that the user sees. `detail` is one sentence with the cause and the place
// ("bob.md5mesh line 41: weight index out of range"). `expected` and `got` complete it and stay
// empty if they do not apply.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string detail;
  std::string expected;
  std::string got;

  // "detail: expected E, got G"
  std::string message() const;
};

// A T or an Error. Reading the wrong one is a bug and aborts.
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }

  T& value() & { return std::get<0>(state_); }
  const T& value() const& { return std::get<0>(state_); }
  T&& value() && { return std::get<0>(std::move(state_)); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

  Error& error() & { return std::get<1>(state_); }
  const Error& error() const& { return std::get<1>(state_); }
  Error&& error() && { return std::get<1>(std::move(state_)); }

 private:
  std::variant<T, Error> state_;
};

// The result of an operation without a value: ok, or an Error.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(Error error) : error_(std::move(error)) {}

  bool ok() const { return !error_.has_value(); }
  explicit operator bool() const { return ok(); }
  Error& error() & { return *error_; }
  const Error& error() const& { return *error_; }
  Error&& error() && { return *std::move(error_); }

 private:
  std::optional<Error> error_;
};

}  // namespace voxeld

// Returns the error of a Result or Status expression from the enclosing function.
#define VOXELD_TRY(expression)                                       \
  do {                                                               \
    if (auto voxeld_try_status = (expression); !voxeld_try_status) { \
      return std::move(voxeld_try_status).error();                   \
    }                                                                \
  } while (false)

#define VOXELD_CONCAT_INNER(a, b) a##b
#define VOXELD_CONCAT(a, b) VOXELD_CONCAT_INNER(a, b)
// VOXELD_ASSIGN(auto mesh, load(path)); declares `mesh`, or returns the error.
#define VOXELD_ASSIGN(declaration, expression) \
  VOXELD_ASSIGN_INNER(VOXELD_CONCAT(voxeld_result_, __LINE__), declaration, expression)
// A declaration cannot be put in parentheses.
// NOLINTBEGIN(bugprone-macro-parentheses)
#define VOXELD_ASSIGN_INNER(temporary, declaration, expression) \
  auto temporary = (expression);                                \
  if (!temporary) return std::move(temporary).error();          \
  declaration = std::move(temporary).value()
// NOLINTEND(bugprone-macro-parentheses)
