#include "db/store/connection.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <limits>
#include <utility>

namespace needlelab {
namespace {

/// Maximum number of cached statements per connection. All stores together use fewer, as does a copy of all
/// tables (store_copy.h), but the SQL of lists varies with each request.
constexpr std::size_t kMaxIdle = 256;

}  // namespace

Result<Connection> Connection::open(const std::filesystem::path& path, const Options& options) {
  ASSIGN_OR_RETURN(auto engine, SqliteConnection::open(path, options));
  return Connection(std::move(engine), path);
}

Connection::Connection(std::unique_ptr<EngineConnection> engine, std::filesystem::path folder_file)
    : path_(std::move(folder_file)), engine_(std::move(engine)) {}

Connection::Connection(Connection&& other) noexcept
    : path_(std::move(other.path_)),
      engine_(std::move(other.engine_)),
      idle_(std::move(other.idle_)),
      uses_(other.uses_) {}

Connection& Connection::operator=(Connection&& other) noexcept {
  if (this != &other) {
    close();
    path_ = std::move(other.path_);
    engine_ = std::move(other.engine_);
    idle_ = std::move(other.idle_);
    uses_ = other.uses_;
  }
  return *this;
}

Connection::~Connection() {
  close();
}

void Connection::close() {
  idle_.clear();
  engine_.reset();
}

Statement Connection::prepare(std::string_view sql) {
  assert(engine_ != nullptr && "the connection was moved away");
  // called five times per incoming chunk: avoids repeated allocations of key and entry
  thread_local std::string key;
  key.assign(sql);
  if (const auto found = idle_.find(key); found != idle_.end() && found->second.statement != nullptr)
    return {this, std::move(found->second.statement)};
  auto prepared = engine_->prepare(key);
  if (!prepared) return {this, prepared.error()};
  return {this, std::move(prepared).value()};
}

void Connection::giveBack(std::unique_ptr<EngineStatement> statement) {
  statement->reset();
  thread_local std::string key;
  key.assign(statement->sql());
  const auto found = idle_.find(key);
  if (found == idle_.end() && idle_.size() >= kMaxIdle) forgetOldest();
  Kept& kept = found != idle_.end() ? found->second : idle_[key];
  kept.used = ++uses_;
  // another statement with the same text may have been in use at the same time: keep one
  if (kept.statement == nullptr) kept.statement = std::move(statement);
}

void Connection::forgetOldest() {
  assert(!idle_.empty());
  // a statement in use still has its previous count; if dropped, it comes back as a new entry
  const auto oldest = std::min_element(idle_.begin(), idle_.end(), [](const auto& one, const auto& other) {
    return one.second.used < other.second.used;
  });
  idle_.erase(oldest);
}

Status Connection::script(const std::string& sql) {
  return engine_->script(sql);
}

std::int64_t Connection::changes() const {
  return engine_->changes();
}

bool Connection::inTransaction() const {
  return engine_->inTransaction();
}

Status Connection::checkpointPassive(WalProgress* progress) {
  if (progress != nullptr) *progress = {};
  return sqlite() != nullptr ? sqlite()->checkpointPassive(progress) : Status();
}

Result<bool> Connection::emptyLog(int patience_ms) {
  if (sqlite() == nullptr) return true;
  return sqlite()->emptyLog(patience_ms);
}

std::uint64_t Connection::walBytes() {
  return sqlite() != nullptr ? sqlite()->walBytes() : 0;
}

void Connection::noteShortRead() {
  if (sqlite() != nullptr) sqlite()->noteShortRead();
}

void Connection::readUntil(std::int64_t until_ns) {
  if (sqlite() != nullptr) sqlite()->readUntil(until_ns);
}

const std::filesystem::path& Connection::origin() const {
  const auto* const sqlite = engine_->sqlite();
  return sqlite != nullptr ? sqlite->origin() : path_;
}

Statement::Statement(Connection* connection, std::unique_ptr<EngineStatement> statement)
    : connection_(connection), statement_(std::move(statement)) {}

Statement::Statement(Connection* connection, Error failed)
    : connection_(connection), failed_(std::move(failed)) {}

Statement::Statement(Statement&& other) noexcept
    : connection_(other.connection_),
      statement_(std::move(other.statement_)),
      failed_(std::move(other.failed_)),
      bound_(other.bound_) {}

Statement::~Statement() {
  if (statement_ != nullptr) connection_->giveBack(std::move(statement_));
}

template <typename Value>
Statement& Statement::bindNext(Value value) {
  if (statement_ == nullptr) return *this;
  if (Status bound = statement_->bind(++bound_, value); !bound && !failed_) failed_ = bound.error();
  return *this;
}

Statement& Statement::bind(std::int64_t value) {
  return bindNext(value);
}

Statement& Statement::bind(std::uint64_t value) {
  constexpr auto kMax = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  if (value > kMax && !failed_) {
    failed_ = Error{ErrorCode::kInvalidInput,
                    fmt::format("the number {} is above {}, the greatest stored", value, kMax)};
  }
  return bind(static_cast<std::int64_t>(value & kMax));
}

Statement& Statement::bind(double value) {
  return bindNext(value);
}

Statement& Statement::bind(std::string_view value) {
  return bindNext(value);
}

Statement& Statement::bind(ByteView value) {
  return bindNext(value);
}

Statement& Statement::bindNull() {
  if (statement_ == nullptr) return *this;
  if (Status bound = statement_->bindNull(++bound_); !bound && !failed_) failed_ = bound.error();
  return *this;
}

template <typename Value>
Statement& Statement::bindNextList(std::span<const Value> values) {
  if (statement_ == nullptr) return *this;
  if (Status bound = statement_->bindList(++bound_, values); !bound && !failed_) failed_ = bound.error();
  return *this;
}

Statement& Statement::bindList(std::span<const std::int64_t> values) {
  return bindNextList(values);
}

Statement& Statement::bindList(std::span<const std::string_view> values) {
  return bindNextList(values);
}

Statement& Statement::bindList(std::span<const ByteView> values) {
  return bindNextList(values);
}

Result<bool> Statement::step() {
  if (failed_) return *failed_;
  auto stepped = statement_->step();
  if (!stepped) failed_ = stepped.error();
  return stepped;
}

Status Statement::run() {
  for (;;) {
    ASSIGN_OR_RETURN(const auto row, step());
    if (!row) return {};
  }
}

Result<std::int64_t> Statement::runReturning() {
  ASSIGN_OR_RETURN(const bool there, step());
  if (!there) return Error{ErrorCode::kFailed, "an INSERT returned no row"};
  const std::int64_t returned = integer(0);
  RETURN_IF_ERROR(run());
  return returned;
}

std::int64_t Statement::integer(int column) const {
  assert(statement_ != nullptr && !failed_);
  return statement_->integer(column);
}

std::uint64_t Statement::natural(int column) const {
  const auto value = integer(column);
  return value < 0 ? 0 : static_cast<std::uint64_t>(value);
}

double Statement::real(int column) const {
  assert(statement_ != nullptr && !failed_);
  return statement_->real(column);
}

std::string Statement::text(int column) const {
  return std::string(textOf(bytes(column)));
}

ByteView Statement::bytes(int column) const {
  assert(statement_ != nullptr && !failed_);
  return statement_->bytes(column);
}

bool Statement::isNull(int column) const {
  assert(statement_ != nullptr && !failed_);
  return statement_->isNull(column);
}

Result<Transaction> Transaction::begin(Connection& connection, Kind kind) {
  using Begin = EngineConnection::Begin;
  RETURN_IF_ERROR(connection.engine_->begin(kind == Kind::kRead    ? Begin::kView
                                            : kind == Kind::kWrite ? Begin::kWrite
                                            : kind == Kind::kSide  ? Begin::kSide
                                                                   : Begin::kWriteSoon));
  return Transaction(connection);
}

Result<std::optional<Transaction>> Transaction::view(Connection& connection) {
  if (connection.inTransaction()) return std::optional<Transaction>();
  ASSIGN_OR_RETURN(auto begun, begin(connection, Kind::kRead));
  return std::optional<Transaction>(std::move(begun));
}

Transaction::Transaction(Transaction&& other) noexcept
    : connection_(std::exchange(other.connection_, nullptr)) {}

Transaction::~Transaction() {
  if (connection_ != nullptr) connection_->engine_->rollback();
}

Status Transaction::commit() {
  assert(connection_ != nullptr && "a transaction commits once");
  RETURN_IF_ERROR(connection_->engine_->commit());
  connection_ = nullptr;
  return {};
}

Result<Savepoint> Savepoint::begin(Connection& connection) {
  RETURN_IF_ERROR(connection.engine_->savepoint());
  return Savepoint(connection);
}

Savepoint::Savepoint(Savepoint&& other) noexcept : connection_(std::exchange(other.connection_, nullptr)) {}

Savepoint::~Savepoint() {
  if (connection_ == nullptr) return;
  // a partly undone item must not be committed with the others
  if (!connection_->engine_->undoSavepoint()) connection_->engine_->setDamaged();
}

Status Savepoint::release() {
  assert(connection_ != nullptr);
  RETURN_IF_ERROR(connection_->engine_->releaseSavepoint());
  connection_ = nullptr;
  return {};
}

}  // namespace needlelab
