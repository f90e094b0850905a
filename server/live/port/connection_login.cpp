// Greeting and log-in of a connection.
#include <fmt/core.h>
#include <algorithm>
#include <utility>

#include "common/base/program.h"
#include "common/base/secret.h"
#include "common/base/time/clock.h"
#include "common/wire/protocol.h"
#include "server/base/log.h"
#include "server/live/counters.h"
#include "server/live/hub/hub.h"
#include "server/live/limits/server_limits.h"
#include "server/live/login/account_login.h"
#include "server/live/login/login_state.h"
#include "server/live/port/connection.h"
#include "server/live/work/server_work.h"
#include "server/together/server_together.h"

namespace needlelab {
namespace {

/// Longer program names in a peer's Hello are cut. Ours have some 30 bytes.
constexpr std::size_t kMaxProgramBytes = 100;

/// A log-in's name for the log; a key typed as a name must not appear there.
std::string nameOf(const pb::Login& login, bool is_known) {
  if (!login.has_station()) return "token";
  return "station " + (is_known ? login.station().station() : std::string("(unknown)"));
}

/// Shares the log-in; wipes its secrets when the last owner releases it.
std::shared_ptr<const pb::Login> secretOf(pb::Login login) {
  return {new pb::Login(std::move(login)), [](pb::Login* held) {
            if (held->has_person()) wipe(*held->mutable_person()->mutable_password());
            if (held->has_station()) wipe(*held->mutable_station()->mutable_key());
            if (held->has_token()) wipe(*held->mutable_token());
            delete held;
          }};
}

Error tokenRefused() {
  return {ErrorCode::kDenied, "log-in refused"};
}

Task<Result<Tokens::Holder>> checkToken(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                        std::string address) {
  auto holder = co_await context.logins.state->find(login->token(), std::move(address));
  if (!holder.ok()) co_return holder.error();
  if (!*holder) co_return tokenRefused();
  const Principal& who = (*holder)->who;
  std::function<Result<bool>()> check = context.logins.state->check(login->token(), who);
  const auto allowed = co_await offload(*context.work.login_pool, turnNameOf(who), std::move(check));
  if (!allowed.ok()) co_return allowed.error();
  if (!*allowed) co_return tokenRefused();
  co_return std::move(**holder);
}

}  // namespace

void PeerConnection::greet(const pb::Hello& hello) {
  program_ = hello.program().substr(0, kMaxProgramBytes);
  const pb::Version ours = ourVersion();
  if (const Status fits = checkVersion(ours, hello.version()); !fits.ok()) {
    note(PeerLine::kVersionRefused, {{"conn", id_},
                                     {"program", program_},
                                     {"theirs", versionText(hello.version())},
                                     {"ours", versionText(ours)}});
    pb::Refusal refusal = makeRefusal(pb::Refusal::VERSION, fits.error().message, true);
    *refusal.mutable_ours() = ours;
    *refusal.mutable_theirs() = hello.version();
    refuseAndClose(std::move(refusal));
    return;
  }
  pb::Envelope envelope;
  *envelope.mutable_hello()->mutable_version() = ours;
  envelope.mutable_hello()->set_program(programText("server"));
  setState(ConnectionState::kLoggingIn);
  sendControl(envelope);
}

Task<> PeerConnection::logIn(pb::Login given) {
  auto self = shared_from_this();
  const std::shared_ptr<const pb::Login> login = secretOf(std::move(given));
  if (login->has_person()) {
    auto secret = std::make_shared<const PersonSecret>(login->person().user(), login->person().password());
    LoginPeer peer{id_, address(), [this] { return over() || channel_->closing(); }};
    const PersonLogin known = co_await logInPerson(context_, std::move(secret), std::move(peer));
    if (over() || channel_->closing()) co_return;
    if (known.answer != PersonLogin::Answer::kWelcome) {
      using Answer = PersonLogin::Answer;
      const bool limited = known.answer == Answer::kMustWait || known.answer == Answer::kTooMany;
      const auto reason = limited                            ? pb::Refusal::RATE_LIMITED
                          : known.answer == Answer::kRefused ? pb::Refusal::LOGIN
                                                             : pb::Refusal::INTERNAL;
      refuseAndClose(makeRefusal(reason, textOf(known)));
      co_return;
    }
    who_ = known.holder.who;
    co_await welcome(known.holder.password_ns);
    co_return;
  }
  const Result<Tokens::Holder> result = co_await checkLogin(login);
  if (over() || channel_->closing()) co_return;

  if (!result.ok()) {
    ++context_.counters.logins_refused;
    const bool denied = result.error().code == ErrorCode::kDenied;
    const auto is_known = co_await claimsKnownStation(context_, login, address_key_);
    if (over() || channel_->closing()) co_return;
    note(PeerLine::kLoginRefused, {{"conn", id_},
                                   {"name", nameOf(*login, is_known.ok() && *is_known)},
                                   {"peer", address()},
                                   {"text", result.error().message}});
    PersonLogin refused;
    refused.answer = denied ? PersonLogin::Answer::kRefused : PersonLogin::Answer::kFailed;
    refuseAndClose(makeRefusal(denied ? pb::Refusal::LOGIN : pb::Refusal::INTERNAL, textOf(refused)));
    co_return;
  }
  who_ = result->who;
  co_await welcome(result->password_ns);
}

Task<Result<Tokens::Holder>> PeerConnection::checkLogin(std::shared_ptr<const pb::Login> login) {
  auto self = shared_from_this();
  if (login->has_station()) {
    std::function<Task<Result<Principal>>()> check = [&context = context_, login, address = address_key_] {
      return checkStationKey(context, login, address);
    };
    auto who =
        co_await checkUnchanged(context_.logins.access, login->station().station(), true, std::move(check));
    if (!who.ok()) co_return who.error();
    co_return Tokens::Holder{std::move(*who), 0};
  }
  if (!login->has_token()) co_return tokenRefused();
  const auto holder = co_await context_.logins.state->find(login->token(), address_key_);
  if (!holder.ok()) co_return holder.error();
  if (!*holder) co_return tokenRefused();
  std::function<Task<Result<Tokens::Holder>>()> check = [&context = context_, login, address = address_key_] {
    return checkToken(context, login, address);
  };
  const Principal& who = (*holder)->who;
  co_return co_await checkUnchanged(context_.logins.access, who.name, who.role == pb::STATION,
                                    std::move(check));
}

/// Takes a place among logged-in connections, possibly from another connection. False: no place.
bool PeerConnection::takePlace() {
  const auto arrival =
      context_.limits.admission.loggedIn(id_, {who_.name, who_.role == pb::STATION}, steadyNowNs());
  if (arrival.answer != Admission::Answer::kWelcome) {
    ++context_.counters.connections_refused;
    refuseAndClose(makeRefusal(pb::Refusal::RATE_LIMITED,
                               "all places of the server are taken, and nobody has more connections than "
                               "you: try again in a minute"));
    return false;
  }
  if (!arrival.displaced) return true;
  if (const auto found = context_.connections.find(*arrival.displaced); found != context_.connections.end()) {
    LivePeer& other = *found->second;
    note(PeerLine::kConnectionDisplaced,
         {{"conn", other.id()}, {"who", other.who().name}, {"to", who_.name}});
    other.refuseAndClose(
        makeRefusal(pb::Refusal::RATE_LIMITED,
                    fmt::format("all places of the server are taken and {} has the most connections: the one "
                                "that was not used for longest gave way",
                                other.who().name)));
  }
  return true;
}

/// A slow log-in may finish late: the station has given this connection up and uses a newer one, which must
/// not be replaced. Then it is refused.
bool PeerConnection::isLateLogin() {
  auto* const there = dynamic_cast<PeerConnection*>(context_.hub.stationPeer(who_.name));
  std::uint64_t newest = there != nullptr ? there->id() : 0;
  if (const auto found = context_.together.newest_logins.find(who_.name);
      found != context_.together.newest_logins.end())
    newest = std::max(newest, found->second);
  if (newest <= id_) return false;
  note(PeerLine::kLateLogin, {{"conn", id_}, {"newer", newest}, {"station", who_.name}});
  refuseAndClose(makeRefusal(pb::Refusal::CONFLICT,
                             "station " + who_.name + " is logged in by a later connection" +
                                 (there != nullptr ? ", from " + there->address() : std::string())));
  return true;
}

/// With several servers, from this commit on the station belongs to this one, and older connections cannot
/// store anything for it. False: the claim failed, and the connection ends.
Task<bool> PeerConnection::claimStation() {
  if (context_.together.claims_as.empty()) co_return true;
  auto self = shared_from_this();
  // if this program or the database stalls from here on, it does not take the station from another server
  using Seen = std::optional<StationClaim>;
  std::function<Result<Seen>()> look = [&store = context_.store, station = who_.name]() -> Result<Seen> {
    ASSIGN_OR_RETURN(auto reader, store.readers().borrow());
    return StationClaims(*reader).newest(station);
  };
  const auto seen = co_await offload(*context_.work.login_pool, turnNameOf(who_), std::move(look));
  if (over() || channel_->closing()) co_return false;
  if (!seen.ok()) {
    refuseClaim(seen.error());
    co_return false;
  }
  // a station that has hung up may already use another server, which must not lose it
  if (isLateLogin() || channel_->peerHungUp()) {
    if (!over()) cut("the station has gone before its log-in was done");
    co_return false;
  }
  context_.together.newest_logins[who_.name] = id_;
  auto claim = std::make_shared<StationClaim>();
  DbWriter::Work work = [claim, gone = gone_, seen = *seen, station = who_.name,
                         server = context_.together.claims_as](Connection& writer) -> Status {
    if (gone->load()) return Error{ErrorCode::kUnavailable, "the station has gone"};
    ASSIGN_OR_RETURN(*claim, StationClaims(writer).raiseSince(seen, station, server, wallNowNs()));
    return {};
  };
  const Status claimed = co_await commit(context_.store.writer(), std::move(work));
  if (over() || channel_->closing()) co_return false;
  if (claimed.ok()) {
    claim_ = std::move(claim);
    co_return true;
  }
  refuseClaim(claimed.error());
  co_return false;
}

void PeerConnection::refuseClaim(const Error& why) {
  const bool is_late = why.code == ErrorCode::kDeposed;
  logEvent(is_late ? LogLevel::kInfo : LogLevel::kError, "station_not_claimed",
           {{"conn", id_}, {"station", who_.name}, {"text", why.message}});
  const auto reason = is_late                          ? pb::Refusal::DEPOSED
                      : why.code == ErrorCode::kNoRoom ? pb::Refusal::NO_ROOM
                                                       : pb::Refusal::INTERNAL;
  refuseAndClose(makeRefusal(
      reason,
      is_late ? why.message
              : "the log-in could not be stored: the server can store nothing at the moment; see its log"));
}

Task<> PeerConnection::welcome(std::int64_t password_ns) {
  auto self = shared_from_this();
  turn_name_ = turnNameOf(who_);
  pb::Envelope envelope;
  pb::Welcome& welcome = *envelope.mutable_welcome();
  if (who_.role == pb::STATION) {
    // before its sessions are read: from here on no other connection adds to them
    const bool claimed = co_await claimStation();
    if (!claimed) co_return;
    // from the database, not from memory, because a station's spool relies on it
    auto open = co_await openSessionsOf(context_, who_.name);
    if (over() || channel_->closing()) co_return;
    if (!open.ok()) {
      logEvent(LogLevel::kError, "read_failed", {{"conn", id_}, {"text", open.error().message}});
      refuseAndClose(
          makeRefusal(pb::Refusal::INTERNAL, "the station's sessions cannot be read; see the server's log"));
      co_return;
    }
    for (auto& session : *open) {
      Watermarks& marks = watermarks(session.session_id());
      marks.committed = session.next_seq();
      marks.open = true;
      *welcome.add_open_sessions() = std::move(session);
    }
  } else {
    const auto mine =
        std::count_if(context_.connections.begin(), context_.connections.end(), [this](const auto& entry) {
          const LivePeer& other = *entry.second;
          return &other != this && other.who().name == who_.name && other.who().role == who_.role;
        });
    if (static_cast<std::size_t>(mine) >= context_.limits.bounds.connections_of_person) {
      refuseAndClose(
          makeRefusal(pb::Refusal::RATE_LIMITED,
                      fmt::format("{} has {} connections already, the most that a person may have: "
                                  "close one of them first",
                                  who_.name, mine)));
      co_return;
    }
  }
  if (who_.role == pb::STATION && isLateLogin()) co_return;
  if (!takePlace()) co_return;
  if (who_.role != pb::STATION) {
    // also after a log-in by token, so that a running program need not ask for the password again
    const auto issued = co_await context_.logins.state->issue({who_, password_ns});
    if (over() || channel_->closing()) co_return;
    if (!issued.ok()) {
      const bool changed = issued.error().code == ErrorCode::kConflict;
      if (!changed)
        logEvent(LogLevel::kError, "token_not_stored", {{"conn", id_}, {"text", issued.error().message}});
      PersonLogin refused;
      refused.answer = changed ? PersonLogin::Answer::kTooMany : PersonLogin::Answer::kFailed;
      refuseAndClose(
          makeRefusal(changed ? pb::Refusal::RATE_LIMITED : pb::Refusal::INTERNAL, textOf(refused)));
      co_return;
    }
    welcome.set_token(issued->token);
    welcome.set_token_expires_unix_ns(wallNowNs() + issued->left.count());
  }
  welcome.set_name(who_.shown());
  welcome.set_role(who_.role);
  welcome.set_server_unix_ns(wallNowNs());
  welcome.set_server_version(programVersion());
  welcome.set_keepalive_ms(static_cast<std::uint32_t>(channel_->limits().keepalive.count()));

  channel_->established();
  setState(ConnectionState::kAuthenticated);
  if (!sessions_.empty()) setState(ConnectionState::kInSession);
  ++context_.counters.logins;
  note(PeerLine::kLogin, {{"conn", id_},
                          {"who", who_.name},
                          {"role", pb::Role_Name(who_.role)},
                          {"peer", address()},
                          {"program", program_}});
  sendControl(envelope);

  if (who_.role != pb::STATION) co_return;
  // one connection per station, the newest; the older one is often dead but undetected
  if (HubPeer* const older = context_.hub.attachStation(
          who_.name, *this, claim_ ? static_cast<std::uint64_t>(claim_->epoch) : 0);
      older != nullptr) {
    // null: it represented a connection to another server
    auto* const connection = dynamic_cast<PeerConnection*>(older);
    if (connection == nullptr) co_return;
    note(PeerLine::kStationReplaced, {{"conn", connection->id()}, {"by", id_}, {"station", who_.name}});
    connection->refuseAndClose(
        makeRefusal(pb::Refusal::CONFLICT, "station " + who_.name + " logged in again from " + address()));
  }
}

}  // namespace needlelab
