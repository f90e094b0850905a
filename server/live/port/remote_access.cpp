#include "server/live/port/remote_access.h"

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <tuple>
#include <utility>

#include "common/base/bytes.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "db/people/person_name.h"
#include "server/base/log.h"
#include "server/live/hub/hub.h"
#include "server/live/login/login_state.h"
#include "server/live/port/live_peer.h"
#include "server/live/port/request_effects.h"
#include "server/live/work/server_work.h"
#include "server/together/server_together.h"

namespace needlelab {
namespace {

/// Length of one statement's list.
constexpr std::size_t kMaxAtOnce = 256;

std::string textOfChange(const AccessChange& change) {
  if (change.how == "disabled") return "the account was disabled";
  if (change.how == "revoked" || change.how == "key") return "the station's key was revoked";
  if (change.how == "password") return "the password was changed: log in again";
  return "the account was changed: log in again";
}

using AccountKey = std::tuple<std::string, int, std::int64_t>;
AccountKey keyOfAccount(const Principal& who) {
  return {who.name, static_cast<int>(who.role), who.access_number.value_or(-1)};
}

/// Accounts in use here, each once.
std::vector<Principal> localAccounts(ServerContext& context) {
  std::map<AccountKey, Principal> all;
  for (const auto& [id, peer] : context.connections)
    if (const Principal& who = peer->who(); who.logged_in && !peer->over()) all[keyOfAccount(who)] = who;
  for (Principal& who : context.logins.state->holders()) all[keyOfAccount(who)] = std::move(who);
  std::vector<Principal> accounts;
  for (auto& [key, who] : all) accounts.push_back(std::move(who));
  return accounts;
}

Task<> lookAtAll(ServerContext& context) {
  do {
    context.together.access_recheck.is_due = false;
    const std::vector<Principal> accounts = localAccounts(context);
    for (std::size_t from = 0; from < accounts.size() && !context.stopping; from += kMaxAtOnce) {
      const std::size_t end = std::min(from + kMaxAtOnce, accounts.size());
      const std::vector<Principal> some(accounts.begin() + static_cast<std::ptrdiff_t>(from),
                                        accounts.begin() + static_cast<std::ptrdiff_t>(end));
      std::function<Result<std::vector<bool>>()> look = [&service = context.store.service(), some] {
        return service.logins().stillAllowed(some);
      };
      const auto hold = co_await offload(*context.work.login_pool, "access of all", std::move(look));
      std::int64_t& unanswered_ns = context.together.access_recheck.unanswered_since_ns;
      if (!hold.ok()) {
        if (unanswered_ns == 0) unanswered_ns = steadyNowNs();
        break;  // the next check will retry
      }
      unanswered_ns = 0;
      for (std::size_t i = 0; i < some.size(); ++i)
        if (!(*hold)[i]) endAccessOf(context, some[i]);
    }
  } while (context.together.access_recheck.is_due && !context.stopping);
  context.together.access_recheck.is_under_way = false;
}

/// Which of the refs are erased.
Result<std::vector<std::string>> erasedOf(Store& store, const std::vector<std::string>& refs) {
  ASSIGN_OR_RETURN(auto reader, store.readers().borrow());
  std::vector<std::string> erased;
  for (const std::string& ref : refs) {
    ASSIGN_OR_RETURN(const auto found,
                     reader->query("SELECT ref FROM people WHERE ref = ? AND erased_unix_ns IS NOT NULL", ref)
                         .first(firstText));
    if (found) erased.push_back(ref);
  }
  return erased;
}

/// A person was erased at another server, but stations of this one still send the name.
Task<> forgetErasedNames(ServerContext& context) {
  std::function<Result<std::vector<std::string>>()> read =
      [&store = context.store, shown = context.hub.shownTrainees()] { return erasedOf(store, shown); };
  const auto gone = co_await offload(context.work.workers, std::move(read));
  if (!gone.ok()) {
    logEvent(LogLevel::kWarning, "erased_names_not_looked_up", {{"text", gone.error().message}});
    co_return;
  }
  for (const std::string& ref : *gone) context.hub.forgetTrainee(ref);
}

}  // namespace

void onRemoteAccessChanges(ServerContext& context, const std::vector<AccessChange>& changes) {
  for (const AccessChange& change : changes) {
    switch (change.what) {
      case AccessKind::kPerson:
      case AccessKind::kStation: {
        EndedAccess ended{.name = change.name, .is_station = change.what == AccessKind::kStation};
        ended.text = textOfChange(change);
        ended.before_number = change.number;
        endAccess(context, ended, {std::string(kServerName)});
        break;
      }
      case AccessKind::kLogOut:
        (void)context.logins.state->forget(change.name);
        break;
      case AccessKind::kErased:
        // forget the name and what was learned from the recordings
        context.store.service().scoring().forgetRecordings();
        recheckAllAccess(context);
        asio::co_spawn(context.io, forgetErasedNames(context), rethrow);
        break;
    }
  }
}

void recheckAllAccess(ServerContext& context) {
  context.together.access_recheck.is_due = true;
  if (context.stopping || std::exchange(context.together.access_recheck.is_under_way, true)) return;
  asio::co_spawn(context.io, lookAtAll(context), rethrow);
}

std::optional<pb::Refusal> accessUnknown(const ServerContext& context) {
  const std::int64_t since_ns = context.together.access_recheck.unanswered_since_ns;
  if (since_ns == 0 || !context.together.access_listener) return std::nullopt;
  const std::chrono::nanoseconds bearable = context.together.access_listener->settings().watch_refused_after;
  if (steadyNowNs() - since_ns < bearable.count()) return std::nullopt;
  return makeRefusal(pb::Refusal::INTERNAL,
                     "this server does not reach its database, so it cannot check whether your account is "
                     "still valid: try another server, or try again in a moment");
}

void stepUnheardAccess(ServerContext& context, std::chrono::nanoseconds most) {
  const bool is_deaf = context.together.access_listener->hearing().is_deaf;
  const std::int64_t since_ns = context.together.access_recheck.unanswered_since_ns;
  if (!is_deaf)
    context.together.access_recheck.unanswered_since_ns = 0;
  else
    recheckAllAccess(context);
  if (!is_deaf || since_ns == 0 || steadyNowNs() - since_ns < most.count()) return;
  const auto all = context.connections;
  for (const auto& [id, connection] : all) {
    if (!connection->who().logged_in || connection->who().role == pb::STATION || connection->over()) continue;
    connection->refuseAndClose(
        makeRefusal(pb::Refusal::LOGIN,
                    "this server has not reached its database for longer than a log-in lasts: log in again"));
  }
}

}  // namespace needlelab
