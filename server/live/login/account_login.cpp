#include "server/live/login/account_login.h"

#include <fmt/core.h>

#include <boost/asio/post.hpp>
#include <exception>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/secret.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "db/people/person_name.h"
#include "db/sessions/session_store.h"
#include "server/base/log.h"
#include "server/live/counters.h"
#include "server/live/limits/server_limits.h"
#include "server/live/login/login_state.h"
#include "server/live/work/server_work.h"
#include "server/live/work/turn_queue.h"

namespace needlelab {
namespace {

using Answer = PersonLogin::Answer;

constexpr std::string_view kUnknownName = "person (unknown)";

PersonLogin refusedAs(ServerContext& context, Answer answer) {
  ++context.counters.logins_refused;
  PersonLogin login;
  login.answer = answer;
  return login;
}

/// A log-in that must wait.
PersonLogin waitOf(ServerContext& context, std::chrono::milliseconds wait, const LoginPeer& peer) {
  // without the name: earlier lines for the failures have it, if it exists
  context.limits.lines.write(PeerLines::kStrangers, PeerLine::kLoginRateLimited, steadyNowNs(),
                             {{"conn", peer.connection}, {"peer", peer.address}});
  PersonLogin login = refusedAs(context, Answer::kMustWait);
  login.wait = wait;
  return login;
}

/// A log-in that could not be checked. `shown`: the account's ref, for the log.
PersonLogin notChecked(ServerContext& context, const std::string& shown, const Error& why,
                       const LoginPeer& peer) {
  logEvent(LogLevel::kError, "login_not_checked",
           {{"conn", peer.connection}, {"name", shown}, {"peer", peer.address}, {"text", why.message}});
  return refusedAs(context, Answer::kFailed);
}

LoginQueue::Line lineOf(const LoginState::Standing& standing) {
  if (standing.knows_person) return LoginQueue::Line::kKnownPerson;
  return standing.knows_address ? LoginQueue::Line::kKnownAddress : LoginQueue::Line::kStranger;
}

/// Logs a lock-out. `shown`: the account's ref.
void noteLocked(ServerContext& context, std::chrono::milliseconds wait, const std::string& shown,
                const LoginPeer& peer) {
  const std::string text = fmt::format("too many failed log-ins from {}: waits {} s",
                                       hostOfAddress(peer.address), wait.count() / 1000 + 1);
  logEvent(LogLevel::kWarning, "login_locked", {{"conn", peer.connection}, {"name", shown}, {"text", text}});
  postLogged(context.work.workers, "audit_failed",
             [&service = context.store.service(), subject = printable(shown.substr(0, 100)), text] {
               return service.notes().note("server", "log-in locked", subject, text);
             });
}

/// Log-ins do not wait for their audit line, so that people can log in on a full disk.
void noteWelcome(ServerContext& context, const Principal& who, const std::string& host) {
  postLogged(context.work.workers, "audit_failed", [&service = context.store.service(), who, host] {
    return service.notes().noteLogin(who, host);
  });
}

/// On the passwords' thread.
Task<Result<Principal>> checkPassword(ServerContext& context, std::shared_ptr<const PersonSecret> secret) {
  std::function<Result<Principal>()> check = [&service = context.store.service(), secret] {
    return service.logins().loginPerson(secret->user, secret->password);
  };
  co_return co_await offload(*context.work.password_pool, secret->user, std::move(check), kLoginLine);
}

/// The ref of the account whose name was typed; empty: there is no such account.
Task<Result<std::string>> refOfTyped(ServerContext& context, std::shared_ptr<const PersonSecret> secret) {
  std::function<Result<std::string>()> look = [&service = context.store.service(),
                                               secret]() -> Result<std::string> {
    ASSIGN_OR_RETURN(const auto person, service.logins().principalOf(secret->user));
    return person ? person->name : std::string();
  };
  co_return co_await offload(context.work.logins, std::move(look));
}

/// The outcome of an attempt whose password was wrong or could not be checked.
Task<PersonLogin> refuseTry(ServerContext& context, std::shared_ptr<const PersonSecret> secret,
                            LoginState::Try tried, Error why, LoginPeer peer) {
  if (why.code == ErrorCode::kConflict) {
    // same answer as for a full queue, so that it does not reveal that the password was right
    (void)co_await context.logins.state->abandoned(std::move(tried));
    co_return refusedAs(context, Answer::kTooMany);
  }
  // a password typed into the name field must not appear in the log
  const auto ref = co_await refOfTyped(context, secret);
  const std::string shown = ref.ok() && !ref->empty() ? *ref : std::string(kUnknownName);
  // only a wrong password counts as a guess, not a failed check
  if (why.code != ErrorCode::kDenied) {
    (void)co_await context.logins.state->abandoned(std::move(tried));
    co_return notChecked(context, shown, why, peer);
  }
  context.limits.lines.write(
      PeerLines::kStrangers, PeerLine::kLoginRefused, steadyNowNs(),
      {{"conn", peer.connection}, {"name", shown}, {"peer", peer.address}, {"text", why.message}});
  const auto locked = co_await context.logins.state->failed(std::move(tried));
  if (locked.ok() && *locked) noteLocked(context, **locked, shown, peer);
  co_return refusedAs(context, Answer::kRefused);
}

/// Checks the password when the turn comes; if the account changes meanwhile, once more in the same turn.
Task<PersonLogin> checkQueued(ServerContext& context, std::shared_ptr<const PersonSecret> secret,
                              std::string name, std::string host, LoginState::Standing standing,
                              LoginPeer peer) {
  PersonLogin login;
  // One at a time, and each checks the lock-out again, so of many simultaneous guesses those beyond the limit
  // are never tried. The place passes the turn on when destroyed.
  const auto place = context.logins.waiting.join(lineOf(standing), host);
  while (place && !place->hasTurn() && !place->isDisplaced() && !peer.gone()) co_await place->changed();
  if (peer.gone()) {
    login.answer = Answer::kDisconnected;
    co_return login;
  }
  if (!place || place->isDisplaced()) co_return refusedAs(context, Answer::kTooMany);
  auto tried = co_await context.logins.state->begin(nameKey(trimmedName(name)), host);
  if (!tried.ok()) co_return notChecked(context, std::string(kUnknownName), tried.error(), peer);
  if (tried->wait.count() > 0) co_return waitOf(context, tried->wait, peer);
  // changes of access are reported by ref
  const auto ref = co_await refOfTyped(context, secret);
  if (!ref.ok()) co_return notChecked(context, std::string(kUnknownName), ref.error(), peer);
  std::function<Task<Result<Principal>>()> check = [&context, secret] {
    return checkPassword(context, secret);
  };
  auto who = co_await checkUnchanged(context.logins.access, *ref, false, std::move(check));
  if (!who.ok()) co_return co_await refuseTry(context, secret, std::move(*tried), who.error(), peer);
  login.answer = Answer::kWelcome;
  login.holder = {std::move(*who), 0};
  login.tried = std::move(*tried);
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
      // same text for unknown, wrong and disabled
      return "log-in refused: unknown name, wrong password or key, or disabled";
    case Answer::kFailed:
      return "the log-in could not be checked; see the server's log";
    case Answer::kWelcome:
    case Answer::kDisconnected:
      break;
  }
  return {};
}

Task<PersonLogin> logInPerson(ServerContext& context, std::shared_ptr<const PersonSecret> secret,
                              LoginPeer peer) {
  const std::string host = Admission::keyOf(hostOfAddress(peer.address)), name = "person " + secret->user;
  const auto standing = co_await context.logins.state->standing(name, host);
  if (!standing.ok()) co_return notChecked(context, std::string(kUnknownName), standing.error(), peer);
  if (standing->wait.count() > 0) co_return waitOf(context, standing->wait, peer);
  PersonLogin login = co_await checkQueued(context, secret, name, host, *standing, peer);
  if (login.answer != Answer::kWelcome) co_return login;
  // if this cannot be stored, the person is still logged in, and the attempt counts as a failure
  (void)co_await context.logins.state->succeeded(std::move(login.tried));
  noteWelcome(context, login.holder.who, hostOfAddress(peer.address));
  co_return login;
}

namespace {

std::string claimedTurnOf(const pb::Login& login, const std::string& address) {
  return "log-in of station " + login.station().station() + " from " + address;
}

}  // namespace

Task<Result<Principal>> checkStationKey(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                        std::string address) {
  std::function<Result<Principal>()> check = [&service = context.store.service(), login] {
    return service.logins().loginStation(login->station().station(), login->station().key());
  };
  return offload(*context.work.login_pool, claimedTurnOf(*login, address), std::move(check));
}

Task<Result<bool>> claimsKnownStation(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                      std::string address) {
  std::function<Result<bool>()> look = [&service = context.store.service(), login] {
    return service.logins().isKnownStation(login->station().station());
  };
  return offload(*context.work.login_pool, claimedTurnOf(*login, address), std::move(look));
}

Task<Result<std::vector<pb::Welcome::OpenSession>>> openSessionsOf(ServerContext& context,
                                                                   std::string station) {
  using Open = std::vector<pb::Welcome::OpenSession>;
  std::string turn = turnNameOf({station, pb::STATION});
  std::function<Result<Open>()> read = [&store = context.store, station]() -> Result<Open> {
    ASSIGN_OR_RETURN(auto reader, store.readers().borrow());
    return SessionStore(*reader).openSessions(station);
  };
  return offload(*context.work.login_pool, std::move(turn), std::move(read));
}

}  // namespace needlelab
