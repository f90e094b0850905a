// Greeting and log-in of a connection.
#include <utility>

#include "base/clock.h"
#include "db/session_store.h"
#include "server/connection.h"
#include "server/log.h"
#include "wire/refusal.h"
#include "wire/version.h"

namespace needlelab {
namespace {

std::string hostOf(const std::string& address) {
  return address.substr(0, address.rfind(':'));
}

/// Under which name a log-in is counted when it fails. A password may be guessed from many addresses; keys
/// and tokens cannot be guessed, so strangers elsewhere must not be able to lock a station out.
std::string guardedName(const pb::Login& login, const std::string& host) {
  if (login.has_person()) return "person " + login.person().user();
  return (login.has_station() ? "station " + login.station().station() : "token") + " at " + host;
}

}  // namespace

void PeerConnection::greet(const pb::Hello& hello) {
  program_ = hello.program();
  const pb::Version ours = ourVersion();
  if (const Status fits = checkVersion(ours, hello.version()); !fits.ok()) {
    logEvent(LogLevel::kWarning, "version_refused",
             {{"conn", id_},
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

Task<> PeerConnection::logIn(pb::Login login) {
  auto self = shared_from_this();
  const std::string host = hostOf(address()), name = guardedName(login, host);
  if (const auto wait = context_.guard.mustWait(name, host, steadyNowNs()); wait.count() > 0) {
    ++context_.counters.logins_refused;
    logEvent(LogLevel::kWarning, "login_rate_limited", {{"conn", id_}, {"name", name}, {"peer", address()}});
    refuseAndClose(makeRefusal(
        pb::Refusal::RATE_LIMITED,
        "too many failed log-ins; try again in " + std::to_string(wait.count() / 1000 + 1) + " s"));
    co_return;
  }

  // a password costs time and memory by design: few at a time, and a queue that ends
  if (login.has_person() && context_.logins_waiting >= context_.bounds.logins_waiting) {
    refuseAndClose(
        makeRefusal(pb::Refusal::RATE_LIMITED, "too many log-ins at once; try again in some seconds"));
    co_return;
  }
  Service& service = context_.store.service();
  Result<Principal> result = Error{ErrorCode::kDenied, "log-in refused"};
  if (login.has_station()) {
    std::function<Result<Principal>()> check = [&service, station = login.station()] {
      return service.loginStation(station.station(), station.key());
    };
    result = co_await offload(context_.workers, std::move(check));
  } else if (login.has_person()) {
    std::function<Result<Principal>()> check = [&service, person = login.person()] {
      return service.loginPerson(person.user(), person.password());
    };
    ++context_.logins_waiting;
    result = co_await offload(context_.passwords, std::move(check));
    --context_.logins_waiting;
  } else if (auto holder = context_.tokens.find(login.token(), steadyNowNs()); login.has_token() && holder) {
    std::function<Result<Principal>()> check = [&service, who = *holder]() -> Result<Principal> {
      auto allowed = service.stillAllowed(who);
      if (!allowed.ok()) return allowed.error();
      if (!*allowed) return Error{ErrorCode::kDenied, "log-in refused"};
      return who;
    };
    result = co_await offload(context_.workers, std::move(check));
  }
  if (over() || channel_->closing()) co_return;

  if (!result.ok()) {
    ++context_.counters.logins_refused;
    const bool denied = result.error().code == ErrorCode::kDenied;
    logEvent(LogLevel::kWarning, "login_refused",
             {{"conn", id_}, {"name", name}, {"peer", address()}, {"text", result.error().message}});
    if (denied) {
      context_.guard.failed(name, host, steadyNowNs());
      // one text for unknown, wrong and disabled
      refuseAndClose(makeRefusal(pb::Refusal::LOGIN,
                                 "log-in refused: unknown name, wrong password or key, or disabled"));
    } else {
      refuseAndClose(
          makeRefusal(pb::Refusal::INTERNAL, "the log-in could not be checked; see the server's log"));
    }
    co_return;
  }
  who_ = std::move(*result);
  co_await welcome();
}

Task<> PeerConnection::welcome() {
  auto self = shared_from_this();
  pb::Envelope envelope;
  pb::Welcome& welcome = *envelope.mutable_welcome();
  if (who_.role == pb::STATION) {
    // from the database, not from memory: it is what a station's spool relies on
    using Open = std::vector<pb::Welcome::OpenSession>;
    std::function<Result<Open>()> read = [&store = context_.store, name = who_.name]() -> Result<Open> {
      auto reader = store.readers().borrow();
      if (!reader.ok()) return reader.error();
      return SessionStore(**reader).openSessions(name);
    };
    auto open = co_await offload(context_.workers, std::move(read));
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
    // also after a log-in by token, so that a program that goes on working need not ask for the password
    // again
    const std::int64_t now = steadyNowNs();
    const auto issued = context_.tokens.issue(who_, now);
    welcome.set_token(issued.token);
    welcome.set_token_expires_unix_ns(wallNowNs() + (issued.expires_ns - now));
  }
  // A log-in that was under way for long comes late: the station has given this connection up and is here by
  // a newer one, which it must not lose.
  if (auto* const there = dynamic_cast<PeerConnection*>(
          who_.role == pb::STATION ? context_.hub.stationPeer(who_.name) : nullptr);
      there != nullptr && there->id() > id_) {
    logEvent(LogLevel::kWarning, "late_login",
             {{"conn", id_}, {"newer", there->id()}, {"station", who_.name}});
    refuseAndClose(makeRefusal(
        pb::Refusal::CONFLICT,
        "station " + who_.name + " is logged in by a later connection, from " + there->address()));
    co_return;
  }
  welcome.set_name(who_.name);
  welcome.set_role(who_.role);
  welcome.set_server_unix_ns(wallNowNs());
  welcome.set_server_version(NEEDLELAB_VERSION);

  channel_->established();
  setState(ConnectionState::kAuthenticated);
  if (!sessions_.empty()) setState(ConnectionState::kInSession);
  ++context_.counters.logins;
  logEvent(LogLevel::kInfo, "login_ok",
           {{"conn", id_}, {"who", who_.name}, {"role", pb::Role_Name(who_.role)}, {"program", program_}});
  sendControl(envelope);

  if (who_.role != pb::STATION) co_return;
  // one connection for a station: the newest, because the older one is often dead without knowing it
  if (HubPeer* const older = context_.hub.attachStation(who_.name, *this); older != nullptr) {
    auto& connection = dynamic_cast<PeerConnection&>(*older);
    logEvent(LogLevel::kWarning, "station_replaced",
             {{"conn", connection.id()}, {"by", id_}, {"station", who_.name}});
    connection.refuseAndClose(
        makeRefusal(pb::Refusal::CONFLICT, "station " + who_.name + " logged in again from " + address()));
  }
}

}  // namespace needlelab
