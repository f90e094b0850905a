#include "db/engine/postgres.h"

#include <fmt/core.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <utility>

namespace needlelab {
namespace {

constexpr int kOldestVersion = 150'000;  // PQserverVersion

using Steady = std::chrono::steady_clock;

ErrorCode codeOfState(std::string_view state) {
  if (state == "23505") return ErrorCode::kAlreadyExists;
  if (state == "23503") return ErrorCode::kNotFound;
  if (state.starts_with("23") || state.starts_with("22")) return ErrorCode::kInvalidInput;
  if (state == "53100") return ErrorCode::kNoRoom;
  // connection, resources, operator intervention, lock, serialization failure, standby
  for (const char* some : {"08", "53", "57", "55P03", "40", "25006", "25P0"})
    if (state.starts_with(some)) return ErrorCode::kUnavailable;
  if (state.starts_with("28")) return ErrorCode::kDenied;
  if (state.starts_with("XX001") || state.starts_with("XX002")) return ErrorCode::kCorrupt;
  return ErrorCode::kFailed;
}

constexpr int kSettingsColumns = 4;  // of kSettingsQuery

/// SQL columns for the fields of LabIdentity, in order.
std::string labQuery() {
  return fmt::format(
      "(SELECT value FROM {0}.meta WHERE key = '{1}'),"
      " (SELECT string_agg(version::text, ', ' ORDER BY version) FROM {0}.schema_version)",
      kPostgresSchema, kLabKey);
}

/// The first line, without its end.
std::string firstLine(const char* text) {
  std::string_view line = text != nullptr ? text : "";
  line = line.substr(0, line.find('\n'));
  return std::string(line);
}

}  // namespace

Result<std::unique_ptr<PostgresConnection>> PostgresConnection::open(const PostgresOptions& options) {
  std::unique_ptr<PostgresConnection> connection(new PostgresConnection(options));
  ASSIGN_OR_RETURN(connection->shown_url_, withoutPassword(options.url));
  RETURN_IF_ERROR(connection->connect());
  return connection;
}

PostgresConnection::~PostgresConnection() = default;

bool PostgresConnection::isConnected() const {
  return connection_ != nullptr && PQstatus(connection_.get()) == CONNECTION_OK;
}

Status PostgresConnection::connect(bool takes_locks) {
  const std::string timeout =
      std::to_string(std::max<std::int64_t>(1, options_.connect_timeout.count() / 1000));
  // Parameters of the URL come first in the list, so these override them. jit=off: the statements are short,
  // and compiling one (which PostgreSQL decides by its estimate) takes longer than running it. The keepalives
  // let PostgreSQL, too, notice a lost connection within about 15 s and release its locks.
  const std::string search = fmt::format(
      "-c search_path={} -c client_min_messages=warning -c idle_in_transaction_session_timeout={} -c jit=off"
      " -c tcp_keepalives_idle=5 -c tcp_keepalives_interval=2 -c tcp_keepalives_count=3"
      " -c tcp_user_timeout=10000 -c client_connection_check_interval=2000{}{}",
      kPostgresSchema, options_.max_idle.count(),
      options_.local_commits ? " -c synchronous_commit=local" : "",
      options_.server.empty() ? "" : " -c needlelab.server=" + options_.server);
  const std::string unheard = std::to_string(options_.tcp_patience.count());
  const char* const names[] = {"dbname",
                               "connect_timeout",
                               "options",
                               "application_name",
                               "keepalives",
                               "keepalives_idle",
                               "keepalives_interval",
                               "keepalives_count",
                               "tcp_user_timeout",
                               "client_encoding",
                               nullptr};
  const char* const values[] = {
      options_.url.c_str(), timeout.c_str(), search.c_str(), "needlelab", "1", "5", "2", "3",
      unheard.c_str(),      "UTF8",          nullptr};
  connection_.reset(PQconnectdbParams(names, values, 1));
  ++epoch_;
  named_ = 0;
  given_up_.clear();
  lacks_resources_ = false;
  in_lost_transaction_ = false;
  if (connection_ == nullptr)
    return Error{ErrorCode::kUnavailable, shown_url_ + ": not enough memory to connect"};
  if (!isConnected()) {
    Error error = cannotConnect(shown_url_, PQerrorMessage(connection_.get()));
    connection_.reset();
    return error;
  }
  PQsetNoticeReceiver(connection_.get(), &PostgresConnection::noteNotice, this);
  if (const int version = PQserverVersion(connection_.get()); version < kOldestVersion) {
    connection_.reset();
    return Error{ErrorCode::kVersion,
                 fmt::format("{}: is PostgreSQL {}, needlelab needs 15 or later: upgrade that server, or "
                             "give the address of a newer one",
                             shown_url_, version / 10'000)};
  }
  if (takes_locks && hasLocks()) RETURN_IF_ERROR(takeLocks());
  RETURN_IF_ERROR(settle());
  if (!options_.read_only) RETURN_IF_ERROR(checkLastAcknowledged());
  // a connection made only to query an outcome is closed before the locks are taken
  if (takes_locks || !hasLocks()) ++times_connected_;
  return {};
}

Status PostgresConnection::settle() {
  const char* const what = lab_ ? "see whether it is this lab's database" : "read its settings";
  // not a connection option: with target_session_attrs=read-write libpq would take every server for a standby
  const std::string ask =
      fmt::format("{}SELECT {}{}", options_.read_only ? "SET default_transaction_read_only = on;" : "",
                  kSettingsQuery, lab_ ? fmt::format(", {}", labQuery()) : std::string());
  if (PQsendQuery(connection_.get(), ask.c_str()) == 0) return lost(what);
  const auto row = wait(what);
  Status settled = row ? Status() : Status(row.error());
  if (row) {
    noteSettings(row->get(), 0);
    if (lab_) settled = requireLab(row->get(), kSettingsColumns);
  } else if (lab_ && row.error().code != ErrorCode::kCorrupt) {
    // no such table, or no right to it: this may be fixed while the program runs
    settled = Error{ErrorCode::kUnavailable, row.error().message};
  }
  if (!settled) connection_.reset();  // the next one checks again
  return settled;
}

Status PostgresConnection::requireLab(const PGresult* row, int column) const {
  const std::string_view lab = PQgetvalue(row, 0, column), version = PQgetvalue(row, 0, column + 1);
  if (lab != lab_->lab)
    return Error{
        ErrorCode::kUnavailable,
        fmt::format("{}: the database that answers here now {}{}, and this server's belongs to the lab {}: "
                    "nothing is read or stored there. Look at the address, and at what was promoted or "
                    "restored",
                    shown_url_, lab.empty() ? "has no lab's id" : "belongs to the lab ", lab, lab_->lab)};
  if (version != std::to_string(lab_->schema_version))
    return Error{
        ErrorCode::kUnavailable,
        fmt::format("{}: the schema of the database that answers here now has the version '{}', and this "
                    "server's has {}: nothing is read or stored there. An older backup was restored, or a "
                    "newer needlelab was at work: end this server, and start the right one",
                    shown_url_, version, lab_->schema_version)};
  return {};
}

void PostgresConnection::noteSettings(const PGresult* row, int column) {
  const auto text = [&](int at) { return PQgetvalue(row, 0, column + at); };
  settings_ = {text(0), text(1), text(2), text(3)};
}

Status PostgresConnection::requireDurable() const {
  if (durability() >= options_.least) return {};
  return Error{
      ErrorCode::kUnavailable,
      fmt::format("{}: nothing is stored: an ack must survive {} (--durability), and would survive {}: {}",
                  shown_url_, durabilityText(options_.least), durabilityText(durability()),
                  settings_.text())};
}

Result<bool> PostgresConnection::tryLock(const std::string& sql) {
  constexpr const char* kWhat = "take the lock of the store";
  if (PQsendQuery(connection_.get(), sql.c_str()) == 0) return lost(kWhat);
  const auto taken = wait(kWhat);
  if (!taken) return taken.error();
  return std::string_view(PQgetvalue(taken->get(), 0, 0)) == "t";
}

Status PostgresConnection::takeLocks() {
  const bool together = options_.others == PostgresOptions::Others::kShared;
  // a connection that is alone does what requires that, and stays alone or fails
  const bool may_be_alone = !together || is_alone_ || times_connected_ == 0;
  const bool may_be_shared = together && !is_alone_;
  bool has_store = false, has_name = options_.only_one_named.empty();
  // PostgreSQL releases a lock a moment after the connection that held it has ended
  constexpr auto kMaxWait = std::chrono::seconds(2);
  for (const auto until = Steady::now() + kMaxWait;;) {
    if (!has_store && may_be_alone) {
      ASSIGN_OR_RETURN(has_store, tryLock(fmt::format("SELECT pg_try_advisory_lock({})", kAloneLock)));
      is_alone_ = is_alone_ || has_store;
    }
    if (!has_store && may_be_shared) {
      ASSIGN_OR_RETURN(has_store, tryLock(fmt::format("SELECT pg_try_advisory_lock_shared({})", kAloneLock)));
    }
    if (has_store && !has_name) {
      ASSIGN_OR_RETURN(has_name, tryLock(fmt::format("SELECT pg_try_advisory_lock({}, hashtext('{}'))",
                                                     kNamedLock, options_.only_one_named)));
    }
    if (has_store && has_name) return {};
    if (Steady::now() >= until) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  connection_.reset();
  if (has_store)
    return Error{
        ErrorCode::kUnavailable,
        fmt::format("{}: a server '{}' works on this database already, or PostgreSQL has not noticed "
                    "yet that it ended (pg_stat_activity): start again in a moment. If it stays so, "
                    "two data folders have this name: make the folder of each further server with "
                    "needlelab-admin server join, not by a copy",
                    shown_url_, options_.only_one_named)};
  return Error{
      ErrorCode::kUnavailable,
      shown_url_ + (together ? ": a needlelab-server without --together, or a needlelab-admin, works "
                               "on this database alone: end it, or start that server with --together"
                             : ": another needlelab-server or needlelab-admin works on this database: "
                               "end it (each, where servers work together), or use needlelab-admin "
                               "--server")};
}

Status PostgresConnection::admitOthers() {
  if (!is_alone_ || options_.others != PostgresOptions::Others::kShared) return {};
  // a connection may hold the lock both ways, so no other connection can become alone in between
  RETURN_IF_ERROR(
      script(fmt::format("SELECT pg_advisory_lock_shared({0}); SELECT pg_advisory_unlock({0})", kAloneLock)));
  is_alone_ = false;
  return {};
}

bool PostgresConnection::endedWhileIdle() {
  // first the server's last messages, then the end of the connection
  constexpr int kMaxLooks = 4;
  for (int n = 0; n < kMaxLooks; ++n) {
    pollfd ready{PQsocket(connection_.get()), POLLIN, 0};
    if (::poll(&ready, 1, 0) <= 0) return false;
    if (PQconsumeInput(connection_.get()) == 0) return true;
  }
  return false;
}

Status PostgresConnection::requireConnected() {
  if (not_begun_) return *not_begun_;
  if (in_lost_transaction_)
    return Error{ErrorCode::kUnavailable,
                 shown_url_ + ": the connection was lost, and the transaction with it"};
  if (isConnected() && (in_transaction_ || !endedWhileIdle())) return {};
  Status connected = connect();
  if (connected) return {};
  // The current caller did nothing wrong, and the server can be fixed while the program runs. kDenied would
  // look like a wrong password at log-in.
  switch (const Error& error = connected.error(); error.code) {
    case ErrorCode::kDenied:
    case ErrorCode::kVersion:
    case ErrorCode::kInvalidInput:
      return Error{ErrorCode::kUnavailable, error.message};
    default:
      return connected;
  }
}

void PostgresConnection::noteNotice(void* self, const PGresult* notice) {
  const char* severity = PQresultErrorField(notice, PG_DIAG_SEVERITY_NONLOCALIZED);
  if (severity == nullptr || std::strcmp(severity, "WARNING") != 0) return;
  static_cast<PostgresConnection*>(self)->warning_ =
      firstLine(PQresultErrorField(notice, PG_DIAG_MESSAGE_PRIMARY));
}

Error PostgresConnection::lost(std::string_view what) {
  connection_.reset();
  dropDue();
  begin_due_ = false;
  in_lost_transaction_ = in_lost_transaction_ || in_transaction_;
  constexpr std::size_t kShown = 120;
  return {ErrorCode::kUnavailable, fmt::format("{}: the connection was lost, or gives no answer ({})",
                                               shown_url_, what.substr(0, kShown))};
}

Error PostgresConnection::errorOf(const PGresult* result, std::string_view what) {
  if (!isConnected()) return lost(what);
  const char* state = result != nullptr ? PQresultErrorField(result, PG_DIAG_SQLSTATE) : nullptr;
  const ErrorCode code = state != nullptr ? codeOfState(state) : ErrorCode::kFailed;
  if (code == ErrorCode::kCorrupt) damaged_ = true;
  if (state != nullptr && std::string_view(state).starts_with("53")) lacks_resources_ = true;
  constexpr std::size_t kShown = 120;
  Error error{code,
              fmt::format("{}: cannot {}{}: {} (PostgreSQL {})", shown_url_, what.substr(0, kShown),
                          what.size() > kShown ? "…" : "",
                          firstLine(result != nullptr ? PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY)
                                                      : PQerrorMessage(connection_.get())),
                          state != nullptr ? state : "?")};
  if (code == ErrorCode::kNoRoom) full_ = error.message;
  return error;
}

Result<PostgresConnection::ResultPtr> PostgresConnection::nextResult(Waiting& waiting,
                                                                     std::string_view what) {
  constexpr int kLook_ms = 50, kFlagPoll_ms = 10;
  const int look_ms = cancelled_ != nullptr ? kFlagPoll_ms : kLook_ms;
  bool has_work = static_cast<bool>(while_waiting_);
  while (PQisBusy(connection_.get()) != 0) {
    pollfd ready{PQsocket(connection_.get()), POLLIN, 0};
    const int found = ::poll(&ready, 1, has_work ? 0 : look_ms);
    if (found < 0 && errno != EINTR) return lost(what);
    if (found > 0 && PQconsumeInput(connection_.get()) == 0) return lost(what);
    if (found == 0 && has_work) has_work = while_waiting_();
    if (!waiting.asked_to_end && cancelled_ != nullptr && cancelled_->load()) {
      waiting.asked_to_end = true;
      const std::unique_ptr<PGcancel, void (*)(PGcancel*)> cancel(PQgetCancel(connection_.get()),
                                                                  &PQfreeCancel);
      char error[256];
      if (cancel == nullptr || PQcancel(cancel.get(), error, sizeof error) == 0) return lost(what);
    }
    if (Steady::now() > waiting.until) return lost(what);
  }
  return ResultPtr(PQgetResult(connection_.get()));
}

Result<PostgresConnection::ResultPtr> PostgresConnection::wait(std::string_view what) {
  Waiting waiting{Steady::now() + options_.answer_timeout};
  ++round_trips_;
  ResultPtr last;
  for (;;) {
    ASSIGN_OR_RETURN(ResultPtr next, nextResult(waiting, what));
    if (next == nullptr) break;
    last = std::move(next);
  }
  return checked(std::move(last), what);
}

Result<PostgresConnection::ResultPtr> PostgresConnection::checked(ResultPtr last, std::string_view what) {
  if (last == nullptr) return errorOf(nullptr, what);
  switch (PQresultStatus(last.get())) {
    case PGRES_COMMAND_OK:
    case PGRES_TUPLES_OK:
    case PGRES_EMPTY_QUERY:
      break;
    default:
      return errorOf(last.get(), what);
  }
  results_.rows += static_cast<std::uint64_t>(PQntuples(last.get()));
  const std::uint64_t bytes = PQresultMemorySize(last.get());
  results_.bytes += bytes;
  results_.largest = std::max(results_.largest, bytes);
  if (const char* rows = PQcmdTuples(last.get()); rows != nullptr && *rows != '\0')
    changes_ = std::strtoll(rows, nullptr, 10);
  return last;
}

bool PostgresConnection::isReusable() const {
  return !damaged_ && !lacks_resources_ && !in_lost_transaction_ && isConnected() &&
         PQtransactionStatus(connection_.get()) == PQTRANS_IDLE;
}

Status PostgresConnection::runText(const char* sql) {
  if (!isConnected() || PQsendQuery(connection_.get(), sql) == 0) return lost(sql);
  const auto done = wait(sql);
  return done ? Status() : Status(done.error());
}

Status PostgresConnection::script(const std::string& sql) {
  RETURN_IF_ERROR(requireConnected());
  notifyBeforeStatement(sql);
  RETURN_IF_ERROR(sendDue());
  return runText(sql.c_str());
}

Status PostgresConnection::listen(const std::string& channel) {
  return script("LISTEN " + channel);
}

Result<std::vector<std::string>> PostgresConnection::waitForNotices(std::chrono::milliseconds patience) {
  constexpr const char* kWhat = "wait for notices";
  const auto until = Steady::now() + patience;
  std::vector<std::string> heard;
  for (;;) {
    if (!isConnected()) return lost(kWhat);
    while (PGnotify* const notice = PQnotifies(connection_.get())) {
      heard.emplace_back(notice->extra);
      PQfreemem(notice);
    }
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Steady::now()).count();
    if (!heard.empty() || left <= 0) return heard;
    pollfd ready{PQsocket(connection_.get()), POLLIN, 0};
    const int found = ::poll(&ready, 1, static_cast<int>(left));
    if (found < 0 && errno != EINTR) return lost(kWhat);
    if (found > 0 && PQconsumeInput(connection_.get()) == 0) return lost(kWhat);
  }
}

void PostgresConnection::setWhileWaiting(std::function<bool()> piece) {
  while_waiting_ = std::move(piece);
}

const std::atomic<bool>* PostgresConnection::setCancelled(const std::atomic<bool>* cancelled) {
  return std::exchange(cancelled_, cancelled);
}

Result<std::unique_ptr<EngineConnection>> openPostgres(const PostgresOptions& options) {
  ASSIGN_OR_RETURN(auto connection, PostgresConnection::open(options));
  return std::unique_ptr<EngineConnection>(std::move(connection));
}

}  // namespace needlelab
