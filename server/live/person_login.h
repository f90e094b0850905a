/// A person's log-in by name and password, the same for both ports: turns, lock-outs, audit.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "server/live/context.h"
#include "server/live/tokens.h"

namespace needlelab {

struct PersonLogin {
  enum class Answer {
    kWelcome,   ///< `holder` is set
    kMustWait,  ///< too many failures: `wait` from now on
    kTooMany,   ///< too many wait for their check
    kRefused,   ///< unknown, wrong or disabled: not told apart
    kFailed,    ///< it could not be checked; the log says why
    kGone,      ///< the asker went away meanwhile
  };
  Answer answer = Answer::kRefused;
  std::chrono::milliseconds wait{0};
  Tokens::Holder holder;
};

/// Name and password; wiped at the end, whoever holds them last.
struct PersonSecret {
  PersonSecret(std::string name, std::string secret) : user(std::move(name)), password(std::move(secret)) {}
  ~PersonSecret();
  PersonSecret(const PersonSecret&) = delete;
  PersonSecret& operator=(const PersonSecret&) = delete;
  std::string user, password;
};

/// The peer that logs in; `gone()` is true when nobody waits for the answer any more.
struct LoginPeer {
  std::uint64_t connection = 0;
  std::string address;  ///< HOST:PORT
  std::function<bool()> gone;
};

/// Checks one after the other, each after its turn; counts failures and says them in log and audit. Thread:
/// the network's; the context must outlive it.
Task<PersonLogin> logInPerson(ServerContext& context, std::shared_ptr<const PersonSecret> secret,
                              LoginPeer peer);

/// "127.0.0.1:4312" → "127.0.0.1".
std::string hostOfAddress(const std::string& address);

/// Words for an answer that is not kWelcome; empty for kGone.
std::string textOf(const PersonLogin& login);

}  // namespace needlelab
