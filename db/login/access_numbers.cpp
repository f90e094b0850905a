#include "db/login/access_numbers.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "common/base/text/uuid.h"
#include "db/store/connection.h"
#include "db/store/rows.h"

namespace needlelab {

Result<std::int64_t> AccessNumberStore::last() {
  ASSIGN_OR_RETURN(const auto number, connection_.prepare("SELECT number FROM access_numbers WHERE what = 0")
                                          .first([](const Statement& row) { return row.integer(0); }));
  return number.value_or(0);
}

Result<std::vector<AccessChange>> AccessNumberStore::after(std::int64_t number, std::uint64_t most) {
  return connection_
      .query(
          "SELECT number, what, name, how, server FROM access_numbers WHERE number > ? AND what <> 0"
          " ORDER BY number LIMIT ?",
          number, most)
      .all([](const Statement& row) {
        return AccessChange{row.integer(0), static_cast<AccessKind>(row.integer(1)), row.text(2), row.text(3),
                            row.text(4)};
      });
}

Result<std::int64_t> AccessNumberStore::of(AccessKind what, std::string_view name) {
  ASSIGN_OR_RETURN(const auto number,
                   connection_
                       .query("SELECT number FROM access_numbers WHERE what = ? AND name = ?",
                              static_cast<int>(what), name)
                       .first([](const Statement& row) { return row.integer(0); }));
  return number.value_or(0);
}

Result<std::map<std::string, std::int64_t>> AccessNumberStore::numbersOf(AccessKind what,
                                                                         std::span<const std::string> names) {
  Statement rows = connection_.query(
      "SELECT name, number FROM access_numbers WHERE what = ?1 AND name" + amongTexts(connection_, 2),
      static_cast<int>(what));
  bindTexts(connection_, rows, names);
  ASSIGN_OR_RETURN(const auto found,
                   rows.all([](const Statement& row) { return std::pair(row.text(0), row.integer(1)); }));
  return std::map<std::string, std::int64_t>(found.begin(), found.end());
}

Status AccessNumberStore::raise(AccessKind what, std::string_view name, std::string_view how,
                                std::string_view server) {
  RETURN_IF_ERROR(connection_.run(
      "INSERT INTO access_numbers AS a (what, name, number, how, server) VALUES (0, '', 1, '', '')"
      " ON CONFLICT (what, name) DO UPDATE SET number = a.number + 1"));
  return connection_.run(
      "INSERT INTO access_numbers (what, name, number, how, server)"
      " SELECT ?, ?, number, ?, ? FROM access_numbers WHERE what = 0"
      " ON CONFLICT (what, name) DO UPDATE SET number = excluded.number, how = excluded.how,"
      " server = excluded.server",
      static_cast<int>(what), name, how, server);
}

namespace {

using Milliseconds = std::chrono::milliseconds;

/// The connection's own notice returns with the answer; a proxy in between may delay it.
constexpr Milliseconds kEchoPatience{1'000};
constexpr std::uint64_t kMaxChangesAtOnce = 512;

/// The triggers that write and announce numbers, and how many there are.
constexpr const char* kTriggers =
    "SELECT count(*) FROM pg_trigger t JOIN pg_class c ON c.oid = t.tgrelid"
    " JOIN pg_namespace n ON n.oid = c.relnamespace WHERE n.nspname = 'needlelab' AND t.tgenabled = 'O'"
    " AND t.tgname IN ('people_access', 'stations_access', 'access_told')";
constexpr std::int64_t kTriggerCount = 3;

class PostgresAccessFeed final : public AccessFeed {
 public:
  explicit PostgresAccessFeed(StoreAddress address) : address_(std::move(address)) {
    // waits for no standby, and only briefly for an answer
    address_.is_side_connection = true;
  }

  Status connect() override {
    connection_.reset();
    auto opened = openAt(address_, Connection::Mode::kReader);
    if (!opened) return storeAway(opened.error());
    connection_.emplace(std::move(*opened));
    times_connected_ = connection_->timesConnected();
    // identifies it for technicians in pg_stat_activity
    RETURN_IF_ERROR(connection_->script("SET application_name = 'needlelab access'"));
    RETURN_IF_ERROR(connection_->listen(kAccessChannel));
    return checkOwnNotice();
  }

  Result<std::string> fault() override {
    ASSIGN_OR_RETURN(const auto triggers, connection_->prepare(kTriggers).first(
                                              [](const Statement& row) { return row.integer(0); }));
    RETURN_IF_ERROR(sameConnection());
    if (triggers.value_or(0) < kTriggerCount)
      return std::string(
          "a trigger of the tables people, stations or access_numbers is missing or off: servers do not hear "
          "who was disabled or got another password; see needlelab-admin check, and put it back "
          "(db/migrations/postgres/0001_first.sql)");
    return echo_fault_;
  }

  Result<bool> wait(Milliseconds patience) override {
    RETURN_IF_ERROR(sameConnection());
    ASSIGN_OR_RETURN(const auto heard, connection_->waitForNotices(patience));
    // other servers' test notices to themselves are not changes
    return std::any_of(heard.begin(), heard.end(), [](const std::string& text) { return text.empty(); });
  }

  Result<std::int64_t> last() override {
    ASSIGN_OR_RETURN(const std::int64_t number, AccessNumberStore(*connection_).last());
    RETURN_IF_ERROR(sameConnection());
    return number;
  }

  Result<std::vector<AccessChange>> after(std::int64_t number) override {
    std::vector<AccessChange> all;
    for (;;) {
      ASSIGN_OR_RETURN(auto some, AccessNumberStore(*connection_).after(number, kMaxChangesAtOnce));
      RETURN_IF_ERROR(sameConnection());
      if (some.empty()) return all;
      number = some.back().number;
      std::move(some.begin(), some.end(), std::back_inserter(all));
    }
  }

 private:
  /// A statement reconnects by itself, after which LISTEN is no longer active.
  Status sameConnection() {
    if (connection_ && connection_->timesConnected() == times_connected_) return {};
    connection_.reset();
    return Error{ErrorCode::kUnavailable, "the connection on which changes of access are heard was lost"};
  }

  /// Something in between may accept a LISTEN but deliver nothing, such as a pooler that lends out
  /// connections.
  Status checkOwnNotice() {
    const std::string own = "to " + uuidText(makeUuidV7());
    auto told = connection_->query("SELECT pg_notify(?, ?)", kAccessChannel, own);
    RETURN_IF_ERROR(told.run());
    echo_fault_.clear();
    for (Milliseconds left = kEchoPatience; left.count() > 0; left -= Milliseconds(100)) {
      ASSIGN_OR_RETURN(const auto heard, connection_->waitForNotices(Milliseconds(100)));
      if (std::find(heard.begin(), heard.end(), own) != heard.end()) return {};
    }
    echo_fault_ =
        "NOTIFY does not come through to this server: the address must lead to PostgreSQL itself, or to a "
        "pooler that gives each connection its own (session mode). Changes of access are looked for each "
        "second meanwhile";
    return {};
  }

  StoreAddress address_;
  std::optional<Connection> connection_;
  std::uint64_t times_connected_ = 0;
  std::string echo_fault_;
};

}  // namespace

std::unique_ptr<AccessFeed> makeAccessFeed(StoreAddress address) {
  return std::make_unique<PostgresAccessFeed>(std::move(address));
}

}  // namespace needlelab
