/// Expected failures as values. Programmer errors are asserts. The haptic loop uses neither.
#pragma once

#include <cassert>
#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace needlelab {

/// Why an operation failed; decides the exit code of a program and the reason of a refusal on the wire.
enum class ErrorCode {
  kInvalidInput,   ///< the caller's data is wrong: file, field, value, range are in the message (exit code 2)
  kNotFound,       ///< a named thing does not exist
  kAlreadyExists,  ///< a named thing exists and differs
  kConflict,       ///< an edit is based on an old revision
  kDenied,         ///< not allowed: role, key, password
  kCode,           ///< a trainee's code is missing or wrong, or is locked after wrong attempts (exit code 1)
  kUnavailable,    ///< a peer, device or file system does not answer now; trying again may help
  kDeposed,        ///< the station has since logged in again, perhaps at another server: connect again
  kNoRoom,         ///< the disk or a quota of it is full: trying later may help (exit code 1)
  kCorrupt,        ///< stored or received bytes fail their check
  kVersion,        ///< a format, schema or protocol version that this program does not know
  kFailed,         ///< anything else that went wrong
};

struct [[nodiscard]] Error {
  ErrorCode code = ErrorCode::kFailed;
  std::string message;            ///< for the user: what was tried, what happened, the remedy
  unsigned current_revision = 0;  ///< for kConflict: the newest revision
};

/// A value or an error. Call `ok()` before `value()` (asserted).
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : data_(std::move(value)) {}      // NOLINT(google-explicit-constructor): as std::expected
  Result(Error error) : data_(std::move(error)) {}  // NOLINT(google-explicit-constructor)

  [[nodiscard]] bool ok() const { return data_.index() == 0; }
  explicit operator bool() const { return ok(); }
  [[nodiscard]] T& value() & { return assert(ok()), *std::get_if<0>(&data_); }
  [[nodiscard]] const T& value() const& { return assert(ok()), *std::get_if<0>(&data_); }
  [[nodiscard]] T&& value() && { return assert(ok()), std::move(*std::get_if<0>(&data_)); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  T& operator*() { return value(); }
  const T& operator*() const { return value(); }
  [[nodiscard]] const Error& error() const { return assert(!ok()), *std::get_if<1>(&data_); }

 private:
  std::variant<T, Error> data_;
};

/// Success or an error.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(Error error) : error_(std::move(error)) {}  // NOLINT(google-explicit-constructor)
  [[nodiscard]] bool ok() const { return !error_.has_value(); }
  explicit operator bool() const { return ok(); }
  [[nodiscard]] const Error& error() const { return assert(!ok()), *error_; }

 private:
  std::optional<Error> error_;
};

}  // namespace needlelab

/// Returns from the function with the error of `expression`, a Status or Result, if it has one.
#define RETURN_IF_ERROR(expression)                                           \
  do {                                                                        \
    if (auto status_of_expression = (expression); !status_of_expression.ok()) \
      return status_of_expression.error();                                    \
  } while (false)

/// ASSIGN_OR_RETURN(const auto row, store.find(id)): declares or sets the first argument from the value of a
/// Result, or returns its error from the function. Do not use it in an `if` without braces: it expands to two
/// statements.
#define ASSIGN_OR_RETURN(target, expression) \
  ASSIGN_OR_RETURN_AS(NEEDLELAB_JOIN(result_of_line_, __LINE__), target, expression)
#define ASSIGN_OR_RETURN_AS(result, target, expression) \
  auto result = (expression);                           \
  if (!result.ok()) return result.error();              \
  target = std::move(result).value()
#define NEEDLELAB_JOIN(a, b) NEEDLELAB_JOIN_EXPANDED(a, b)
#define NEEDLELAB_JOIN_EXPANDED(a, b) a##b
