#include "server/live/person_login.h"

#include <fmt/core.h>
#include <boost/asio/post.hpp>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/clock.h"
#include "common/base/secret.h"
#include "common/base/text.h"
#include "server/base/log.h"

namespace needlelab {
namespace {

using Answer = PersonLogin::Answer;

constexpr std::string_view kUnknownName = "person (unknown)";

PersonLogin waitOf(ServerContext& context, const std::string& name, const std::string& host,
                   const LoginPeer& peer) {
  PersonLogin login;
  login.wait = context.guard.mustWait(name, host, steadyNowNs());
  if (login.wait.count() <= 0) return login;
  login.answer = Answer::kMustWait;
  ++context.counters.logins_refused;
  // without the name: the lines of the failures before have it, if it is somebody's
  logEvent(LogLevel::kWarning, "login_rate_limited", {{"conn", peer.connection}, {"peer", peer.address}});
  return login;
}

// a password check is expensive in time and memory by design: few at a time, in a bounded queue with places
// that strangers cannot take
bool roomToWait(const ServerContext& context, bool known, const std::string& host) {
  const ConnectionBounds& bounds = context.bounds;
  if (context.logins_waiting >= (known ? bounds.logins_waiting : bounds.logins_waiting_of_strangers))
    return false;
  const auto here = context.logins_waiting_at.find(host);
  return known || here == context.logins_waiting_at.end() || here->second < bounds.logins_waiting_at_address;
}

/// `shown`: the name, for the logs.
void noteLocked(ServerContext& context, const std::string& name, const std::string& shown,
                const std::string& host, const LoginPeer& peer) {
  const auto wait = context.guard.mustWait(name, host, steadyNowNs());
  const std::string text = fmt::format("too many failed log-ins from {}: waits {} s",
                                       hostOfAddress(peer.address), wait.count() / 1000 + 1);
  logEvent(LogLevel::kWarning, "login_locked", {{"conn", peer.connection}, {"name", shown}, {"text", text}});
  asio::post(context.workers,
             [&service = context.store.service(), subject = printable(shown.substr(0, 100)), text] {
               const Status noted = service.note("server", "log-in locked", subject, text);
               if (!noted.ok()) logEvent(LogLevel::kError, "audit_failed", {{"text", noted.error().message}});
             });
}

/// One check when its turn comes.
Task<PersonLogin> checkOnce(ServerContext& context, std::shared_ptr<const PersonSecret> secret,
                            std::string name, std::string host, LoginPeer peer) {
  const bool known = context.guard.knows(name, host);
  ++context.logins_waiting;
  if (!known) ++context.logins_waiting_at[host];
  // One at a time, and each checks the lock-out again: of many simultaneous guesses, those beyond the limit
  // are never tried.
  const std::uint64_t turn = context.password_turns++;
  while (context.password_turn != turn) co_await context.password_done.wait();
  PersonLogin login;
  login.answer = Answer::kGone;
  if (!peer.gone()) {
    login = waitOf(context, name, host, peer);
    if (login.answer != Answer::kMustWait) {
      std::function<Result<Principal>()> check = [&service = context.store.service(), secret] {
        return service.loginPerson(secret->user, secret->password);
      };
      auto who = co_await offload(context.passwords, std::move(check));
      if (who.ok()) {
        login.answer = Answer::kWelcome;
        login.holder = {std::move(*who), steadyNowNs()};
      } else {
        const bool denied = who.error().code == ErrorCode::kDenied;
        login.answer = denied ? Answer::kRefused : Answer::kFailed;
        ++context.counters.logins_refused;
        // a password that was typed as the name must not be read in the log
        std::function<Result<bool>()> look = [&service = context.store.service(), secret] {
          return service.isKnownName(secret->user, false);
        };
        const auto is_known = co_await offload(context.passwords, std::move(look));
        const std::string shown = is_known.ok() && *is_known ? name : std::string(kUnknownName);
        logEvent(LogLevel::kWarning, "login_refused",
                 {{"conn", peer.connection},
                  {"name", shown},
                  {"peer", peer.address},
                  {"text", who.error().message}});
        if (denied && context.guard.failed(name, host, steadyNowNs()))
          noteLocked(context, name, shown, host, peer);
      }
    }
  }
  ++context.password_turn;
  context.password_done.notify();
  --context.logins_waiting;
  if (const auto here = context.logins_waiting_at.find(host); !known && --here->second == 0)
    context.logins_waiting_at.erase(here);
  co_return login;
}

}  // namespace

PersonSecret::~PersonSecret() {
  wipe(password);
}

std::string hostOfAddress(const std::string& address) {
  return address.substr(0, address.rfind(':'));
}

std::string textOf(const PersonLogin& login) {
  switch (login.answer) {
    case Answer::kMustWait:
      return fmt::format("too many failed log-ins; try again in {} s", login.wait.count() / 1000 + 1);
    case Answer::kTooMany:
      return "too many log-ins at once; try again in some seconds";
    case Answer::kRefused:
      // one text for unknown, wrong and disabled
      return "log-in refused: unknown name, wrong password or key, or disabled";
    case Answer::kFailed:
      return "the log-in could not be checked; see the server's log";
    case Answer::kWelcome:
    case Answer::kGone:
      break;
  }
  return {};
}

Task<PersonLogin> logInPerson(ServerContext& context, std::shared_ptr<const PersonSecret> secret,
                              LoginPeer peer) {
  const std::string host = Admission::keyOf(hostOfAddress(peer.address)), name = "person " + secret->user;
  if (auto wait = waitOf(context, name, host, peer); wait.answer == Answer::kMustWait) co_return wait;
  if (!roomToWait(context, context.guard.knows(name, host), host)) {
    ++context.counters.logins_refused;
    PersonLogin login;
    login.answer = Answer::kTooMany;
    co_return login;
  }
  PersonLogin login;
  std::uint64_t seen = 0;
  do {
    // an account may be disabled while its password is checked: then check again
    seen = context.access_changes;
    login = co_await checkOnce(context, secret, name, host, peer);
  } while (login.answer == Answer::kWelcome && seen != context.access_changes && !peer.gone());
  if (login.answer == Answer::kWelcome) context.guard.succeeded(name, host, steadyNowNs());
  co_return login;
}

}  // namespace needlelab
