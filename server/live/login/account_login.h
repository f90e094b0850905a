/// Log-in of a person by name and password, for both ports: queueing, lock-outs, audit. Log-in of a station
/// by its key.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "needlelab/session.pb.h"
#include "server/live/context.h"
#include "server/live/login/login_state.h"

namespace needlelab {

struct PersonLogin {
  enum class Answer {
    kWelcome,       ///< `holder` is set
    kMustWait,      ///< too many failures: wait for `wait` from now
    kTooMany,       ///< too many log-ins wait for their check, or the account kept changing during it
    kRefused,       ///< unknown, wrong or disabled, without distinction
    kFailed,        ///< the check failed; the log has the reason
    kDisconnected,  ///< the client has disconnected
  };
  Answer answer = Answer::kRefused;
  std::chrono::milliseconds wait{0};
  Tokens::Holder holder;  ///< password_ns 0: just now
  LoginState::Try tried{};
};

/// Name and password, wiped when the last owner releases them.
struct PersonSecret {
  PersonSecret(std::string name, std::string secret) : user(std::move(name)), password(std::move(secret)) {}
  ~PersonSecret();
  PersonSecret(const PersonSecret&) = delete;
  PersonSecret& operator=(const PersonSecret&) = delete;
  std::string user, password;
};

/// The client; `gone()` is true once it no longer waits for the answer. Thread: the network's.
struct LoginPeer {
  std::uint64_t connection = 0;
  std::string address;  ///< HOST:PORT
  std::function<bool()> gone;
};

/// Checks log-ins one at a time, in order; counts failures and writes them to log and audit log. Thread: the
/// network's; the context must outlive it.
Task<PersonLogin> logInPerson(ServerContext& context, std::shared_ptr<const PersonSecret> secret,
                              LoginPeer peer);

/// "127.0.0.1:4312" → "127.0.0.1".
std::string hostOfAddress(const std::string& address);

/// The message for a result other than kWelcome; empty for kDisconnected.
std::string textOf(const PersonLogin& login);

// --- a station's key, on the log-ins' thread

/// Checks name and key. Until then the name is only claimed, so log-ins take turns by the address
/// (Admission::keyOf) and the name together: no other address can use up a station's turns. Errors: kDenied.
/// Thread: the network's; the context must outlive it.
Task<Result<Principal>> checkStationKey(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                        std::string address);

/// Whether a refused log-in claimed the name of an existing station, for the log. Takes the same turns.
Task<Result<bool>> claimsKnownStation(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                      std::string address);

/// The open sessions of a station whose key was right, from the database: 2 ms for 1,000 of them. Stations
/// take turns, so one that logs in repeatedly only delays itself. Thread: as above.
Task<Result<std::vector<pb::Welcome::OpenSession>>> openSessionsOf(ServerContext& context,
                                                                   std::string station);

}  // namespace needlelab
