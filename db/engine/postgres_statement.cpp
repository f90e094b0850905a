// PostgreSQL's prepared statements: their values, their rows, and the names that the connection keeps for
// them.
#include <algorithm>
#include <iterator>
#include <map>
#include <span>
#include <utility>

#include "common/base/bytes.h"
#include "db/engine/postgres.h"
#include "db/engine/postgres_values.h"

namespace needlelab {
namespace {

constexpr int kBinary = 1;
constexpr std::size_t kMaxSigns = 8;  // combinations of parameter types per statement, see PostgresStatement

class PostgresStatement final : public EngineStatement {
 public:
  PostgresStatement(PostgresConnection& connection, const std::string& sql)
      : connection_(connection), sql_(sql), own_(forPostgres(sql)) {}
  ~PostgresStatement() override {
    std::vector<std::string> names;
    for (auto& [types, name] : names_) names.push_back(std::move(name));
    connection_.releaseStatements(std::move(names), epoch_);
  }

  [[nodiscard]] std::string_view sql() const override { return sql_; }
  Status bind(int parameter, std::int64_t value) override {
    return put(parameter, PostgresType::kInt8, postgresInteger(value));
  }
  Status bind(int parameter, double value) override {
    return put(parameter, PostgresType::kFloat8, postgresReal(value));
  }
  Status bind(int parameter, std::string_view value) override {
    if (value.find('\0') != std::string_view::npos) return byteZero();
    return put(parameter, PostgresType::kText, std::string(value));
  }
  Status bind(int parameter, ByteView value) override {
    return put(parameter, PostgresType::kBytes, std::string(needlelab::textOf(value)));
  }
  Status bindNull(int parameter) override {
    at(parameter) = {};
    return {};
  }
  Status bindList(int parameter, std::span<const std::int64_t> values) override {
    return putList(parameter, PostgresType::kInt8List, postgresList(values));
  }
  Status bindList(int parameter, std::span<const std::string_view> values) override {
    for (const std::string_view value : values)
      if (value.find('\0') != std::string_view::npos) return byteZero();
    return putList(parameter, PostgresType::kTextList, postgresList(values));
  }
  Status bindList(int parameter, std::span<const ByteView> values) override {
    return putList(parameter, PostgresType::kBytesList, postgresList(values));
  }

  Result<bool> step() override {
    if (!result_) {
      RETURN_IF_ERROR(connection_.requireConnected());
      values_.resize(static_cast<std::size_t>(own_.parameters));  // unbound ones are NULL
      ASSIGN_OR_RETURN(const std::string name, prepared());
      ASSIGN_OR_RETURN(result_, connection_.execute(name, values_, sql_));
      rows_ = PQntuples(result_.get());
      row_ = -1;
    }
    if (row_ + 1 >= rows_) return false;
    ++row_;
    texts_.clear();
    return true;
  }
  void reset() override {
    result_.reset();
    values_.clear();
    texts_.clear();
    rows_ = 0;
    row_ = -1;
  }

  [[nodiscard]] std::int64_t integer(int column) const override {
    return isNull(column) ? 0 : integerOfPostgres(type(column), raw(column));
  }
  [[nodiscard]] double real(int column) const override {
    return isNull(column) ? 0 : realOfPostgres(type(column), raw(column));
  }
  [[nodiscard]] ByteView bytes(int column) const override {
    if (isNull(column)) return {};
    auto text = textOfPostgres(type(column), raw(column));
    if (!text) return raw(column);
    std::string& kept = texts_[column];
    kept = *std::move(text);
    return viewOf(kept);
  }
  [[nodiscard]] bool isNull(int column) const override {
    return !isThere(column) || PQgetisnull(result_.get(), row_, column) != 0;
  }

 private:
  PostgresConnection::Value& at(int parameter) {
    const auto index = static_cast<std::size_t>(parameter - 1);
    if (values_.size() <= index) values_.resize(index + 1);
    return values_[index];
  }
  Status put(int parameter, PostgresType type, std::string bytes) {
    at(parameter) = {static_cast<std::uint32_t>(type), false, std::move(bytes)};
    return {};
  }
  Status putList(int parameter, PostgresType type, std::optional<std::string> bytes) {
    if (!bytes)
      return Error{ErrorCode::kInvalidInput, "a list of 1 GiB or more, which PostgreSQL does not take"};
    return put(parameter, type, *std::move(bytes));
  }
  static Error byteZero() {
    return {ErrorCode::kInvalidInput, "a text has a byte 0, which PostgreSQL does not store"};
  }
  [[nodiscard]] bool isThere(int column) const {
    return result_ != nullptr && row_ >= 0 && column >= 0 && column < PQnfields(result_.get());
  }
  [[nodiscard]] PostgresType type(int column) const {
    return static_cast<PostgresType>(PQftype(result_.get(), column));
  }
  [[nodiscard]] ByteView raw(int column) const {
    return {reinterpret_cast<const std::uint8_t*>(PQgetvalue(result_.get(), row_, column)),
            static_cast<std::size_t>(PQgetlength(result_.get(), row_, column))};
  }
  /// The name under which it is prepared for values of these types. Otherwise PostgreSQL would guess the
  /// types and take a number in a SELECT for a text.
  Result<std::string> prepared() {
    if (epoch_ != connection_.epoch()) names_.clear();
    epoch_ = connection_.epoch();
    std::vector<std::uint32_t> types;
    types.reserve(values_.size());
    for (const auto& value : values_) types.push_back(value.type);
    if (const auto found = names_.find(types); found != names_.end()) return found->second;
    const bool kept = names_.empty() || (names_.size() < kMaxSigns && connection_.mayNameMore());
    ASSIGN_OR_RETURN(std::string name, connection_.prepareNow(own_.text, values_, kept));
    if (kept) names_.emplace(std::move(types), name);
    return name;
  }

  PostgresConnection& connection_;
  const std::string sql_;
  const PostgresSql own_;
  std::vector<PostgresConnection::Value> values_;
  std::map<std::vector<std::uint32_t>, std::string> names_;
  std::uint64_t epoch_ = 0;
  PostgresConnection::ResultPtr result_;
  int rows_ = 0, row_ = -1;
  mutable std::map<int, std::string> texts_;  ///< texts of numbers in the current row
};

}  // namespace

Result<std::string> PostgresConnection::prepareNow(const std::string& sql, const std::vector<Value>& values,
                                                   bool kept) {
  std::string name = kept ? "n" + std::to_string(++prepared_) : "";
  std::vector<Oid> types;
  types.reserve(values.size());
  for (const Value& value : values) types.push_back(value.type);
  // in the same round trip, and so in the same transaction, which would refuse both if it had failed
  std::vector<std::string> forgets;
  for (const std::string& one : given_up_) forgets.push_back("DEALLOCATE " + one);
  std::vector<const char*> first;  // the savepoint comes last in due_
  for (const std::string& one : forgets) first.push_back(one.c_str());
  due_.insert(due_.begin(), first.begin(), first.end());
  const auto prepared = behindDue(
      [&] {
        return PQsendPrepare(connection_.get(), name.c_str(), sql.c_str(), static_cast<int>(types.size()),
                             types.data());
      },
      sql);
  if (!prepared && !isConnected()) return prepared.error();  // the next connection has no names
  const std::size_t forgotten = std::min(due_done_, forgets.size());
  given_up_.erase(given_up_.begin(), given_up_.begin() + static_cast<std::ptrdiff_t>(forgotten));
  named_ -= forgotten;
  if (!prepared) return prepared.error();
  if (kept) ++named_;
  return name;
}

void PostgresConnection::releaseStatements(std::vector<std::string> names, std::uint64_t epoch) {
  if (epoch != epoch_) return;  // the names were lost with that connection
  std::move(names.begin(), names.end(), std::back_inserter(given_up_));
}

Result<PostgresConnection::ResultPtr> PostgresConnection::execute(const std::string& prepared,
                                                                  const std::vector<Value>& values,
                                                                  std::string_view what) {
  notifyBeforeStatement(what);
  std::vector<const char*> texts;
  std::vector<int> lengths, forms(values.size(), kBinary);
  texts.reserve(values.size());
  lengths.reserve(values.size());
  for (const Value& value : values) {
    texts.push_back(value.is_null ? nullptr : value.bytes.data());
    lengths.push_back(static_cast<int>(value.bytes.size()));
  }
  return behindDue(
      [&] {
        return PQsendQueryPrepared(connection_.get(), prepared.c_str(), static_cast<int>(values.size()),
                                   texts.data(), lengths.data(), forms.data(), kBinary);
      },
      what);
}

Result<std::unique_ptr<EngineStatement>> PostgresConnection::prepare(const std::string& sql) {
  return std::unique_ptr<EngineStatement>(std::make_unique<PostgresStatement>(*this, sql));
}

}  // namespace needlelab
