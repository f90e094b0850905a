#include "db/statement.h"

#include <limits>

#include "db/connection.h"

namespace needlelab {

Statement::Statement(Connection* connection, sqlite3_stmt* handle, std::optional<Error> failed)
    : connection_(connection), handle_(handle), failed_(std::move(failed)) {}

Statement::Statement(Statement&& other) noexcept
    : connection_(other.connection_),
      handle_(std::exchange(other.handle_, nullptr)),
      failed_(std::move(other.failed_)),
      bound_(other.bound_) {}

Statement::~Statement() {
  if (handle_ != nullptr) connection_->giveBack(handle_);
}

void Statement::check(int rc) {
  if (rc != SQLITE_OK && !failed_) failed_ = connection_->errorOf(rc, "bind a value");
}

Statement& Statement::bind(std::int64_t value) {
  if (handle_ != nullptr) check(sqlite3_bind_int64(handle_, ++bound_, value));
  return *this;
}

Statement& Statement::bind(std::uint64_t value) {
  constexpr auto kMax = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  if (value > kMax && !failed_) {
    failed_ = Error{ErrorCode::kInvalidInput, "the number " + std::to_string(value) + " is above " +
                                                  std::to_string(kMax) + ", the greatest stored"};
  }
  return bind(static_cast<std::int64_t>(value & kMax));
}

Statement& Statement::bind(double value) {
  if (handle_ != nullptr) check(sqlite3_bind_double(handle_, ++bound_, value));
  return *this;
}

Statement& Statement::bind(std::string_view value) {
  // an empty view may have no address, which SQLite would take for NULL
  const char* text = value.data() == nullptr ? "" : value.data();
  if (handle_ != nullptr) {
    check(sqlite3_bind_text64(handle_, ++bound_, text, value.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  }
  return *this;
}

Statement& Statement::bind(ByteView value) {
  const void* data = value.data() == nullptr ? static_cast<const void*>("") : value.data();
  if (handle_ != nullptr) check(sqlite3_bind_blob64(handle_, ++bound_, data, value.size(), SQLITE_TRANSIENT));
  return *this;
}

Statement& Statement::bindNull() {
  if (handle_ != nullptr) check(sqlite3_bind_null(handle_, ++bound_));
  return *this;
}

Result<bool> Statement::step() {
  if (failed_) return *failed_;
  const int rc = sqlite3_step(handle_);
  if (rc == SQLITE_ROW) return true;
  if (rc == SQLITE_DONE) return false;
  failed_ = connection_->errorOf(rc, sqlite3_sql(handle_));
  return *failed_;
}

Status Statement::run() {
  for (;;) {
    const auto row = step();
    if (!row) return row.error();
    if (!*row) return {};
  }
}

std::int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(handle_, column);
}

std::uint64_t Statement::natural(int column) const {
  const auto value = integer(column);
  return value < 0 ? 0 : static_cast<std::uint64_t>(value);
}

double Statement::real(int column) const {
  return sqlite3_column_double(handle_, column);
}

std::string Statement::text(int column) const {
  return std::string(textOf(bytes(column)));
}

ByteView Statement::bytes(int column) const {
  // the address first: asking for it may convert the value, and with it the length
  const auto* data = static_cast<const std::uint8_t*>(sqlite3_column_blob(handle_, column));
  const int size = sqlite3_column_bytes(handle_, column);
  return data == nullptr ? ByteView{} : ByteView{data, static_cast<std::size_t>(size)};
}

bool Statement::isNull(int column) const {
  return sqlite3_column_type(handle_, column) == SQLITE_NULL;
}

}  // namespace needlelab
