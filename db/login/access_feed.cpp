#include "db/login/access_feed.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "common/base/text/uuid.h"
#include "db/store/connection.h"

namespace needlelab {
namespace {

using Milliseconds = std::chrono::milliseconds;

/// The connection's own notice returns with the answer; a proxy in between may delay it.
constexpr Milliseconds kEchoPatience{1'000};
constexpr std::uint64_t kMostChangesAtOnce = 512;

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
    address_.beside_writer = true;
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
    return hearOneself();
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
      ASSIGN_OR_RETURN(auto some, AccessNumberStore(*connection_).after(number, kMostChangesAtOnce));
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
  Status hearOneself() {
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
