/// A prepared SQL statement with its values bound. See connection.h.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

class Connection;

/// One execution of a prepared statement, borrowed from its connection's cache and given back on destruction.
/// A failure to prepare or to bind is kept and reported by the next step(), so that callers check one place
/// only. Thread: not thread-safe; used by the thread that uses its Connection, and destroyed before it.
class Statement {
 public:
  Statement(Statement&& other) noexcept;
  Statement& operator=(Statement&&) = delete;
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  ~Statement();

  /// Binds the next parameter ("?"), left to right. Texts and bytes are copied.
  Statement& bind(std::int64_t value);
  Statement& bind(std::uint64_t value);  ///< above 2^63 − 1: an error, SQLite has no such integers
  Statement& bind(std::int32_t value) { return bind(static_cast<std::int64_t>(value)); }
  Statement& bind(std::uint32_t value) { return bind(static_cast<std::int64_t>(value)); }
  Statement& bind(bool value) { return bind(static_cast<std::int64_t>(value ? 1 : 0)); }
  Statement& bind(double value);
  Statement& bind(std::string_view value);
  Statement& bind(const std::string& value) { return bind(std::string_view(value)); }
  Statement& bind(const char* value) { return bind(std::string_view(value)); }
  Statement& bind(ByteView value);
  Statement& bindNull();
  template <typename T>
  Statement& bind(const std::optional<T>& value) {
    return value ? bind(*value) : bindNull();
  }

  /// True: a row is there to be read. False: done.
  Result<bool> step();
  /// Steps to the end, rows are dropped.
  Status run();

  /// Columns of the present row, from 0. Views live until the next step().
  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] std::uint64_t natural(int column) const;  ///< negative reads as 0: the schema forbids it
  [[nodiscard]] double real(int column) const;
  [[nodiscard]] std::string text(int column) const;
  [[nodiscard]] ByteView bytes(int column) const;
  [[nodiscard]] bool isNull(int column) const;

 private:
  friend class Connection;
  Statement(Connection* connection, sqlite3_stmt* handle, std::optional<Error> failed);
  void check(int rc);

  Connection* connection_;
  sqlite3_stmt* handle_;  ///< null when preparing failed
  std::optional<Error> failed_;
  int bound_ = 0;
};

}  // namespace needlelab
