/// What a server knows about log-ins beyond the accounts: failures and lock-outs, addresses with earlier
/// log-ins, tokens. Kept in memory or, for several servers on one database, in the database.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "common/wire/asio.h"
#include "db/service/service.h"
#include "server/live/login/login_guard.h"
#include "server/live/login/tokens.h"

namespace needlelab {

/// Names and addresses are keys: "person NAME", Admission::keyOf(). With state in memory, calls complete at
/// once, without interleaving; otherwise they wait on the log-ins' thread, where addresses and people take
/// turns. Errors: kUnavailable if the database is unreachable. Thread: the network's.
class LoginState {
 public:
  using Milliseconds = std::chrono::milliseconds;
  using Holder = Tokens::Holder;

  virtual ~LoginState() = default;
  LoginState() = default;
  LoginState(const LoginState&) = delete;
  LoginState& operator=(const LoginState&) = delete;

  // --- password attempts: call standing(), then begin() when the turn comes, then exactly one of the others

  struct Standing {
    Milliseconds wait{0};        ///< above 0: too many failures
    bool knows_person = false;   ///< the name has logged in at this address before
    bool knows_address = false;  ///< any log-in has come from this address before
  };
  virtual Task<Result<Standing>> standing(std::string name, std::string address) = 0;

  /// An attempt whose turn has come. From here on it counts as a failure for other servers, so that together
  /// they allow no more attempts than one server.
  struct Try {
    std::string name, address;
    Milliseconds wait{0};             ///< above 0: not allowed, the attempt has ended
    Milliseconds then_wait{0};        ///< above 0: a failure starts this wait
    LoginGuard::Entry pair_before{};  ///< for LoginGuard::takeBack()
  };
  virtual Task<Result<Try>> begin(std::string name, std::string address) = 0;
  /// Returns the new waiting time if this failure started a wait; log it in the audit log.
  virtual Task<Result<std::optional<Milliseconds>>> failed(Try tried) = 0;
  /// The password could not be checked.
  virtual Task<Status> gaveUp(Try tried) = 0;
  virtual Task<Status> succeeded(Try tried) = 0;

  // --- tokens; also used for browser sessions

  struct Issued {
    std::string token;  ///< 32 bytes
    std::chrono::nanoseconds left{0};
  };
  /// `holder`: password_ns is 0 directly after a log-in with the password. kConflict: the account has changed
  /// since the log-in.
  virtual Task<Result<Issued>> issue(Holder holder) = 0;
  /// The holder of a valid token. `asker`: an address; database look-ups take turns by it.
  virtual Task<Result<std::optional<Holder>>> find(std::string token, std::string asker) = 0;
  /// A function for another thread: whether the holder's token, and thus the account's access, is valid in
  /// the database now.
  [[nodiscard]] virtual std::function<Result<bool>()> check(const std::string& token,
                                                            const Principal& who) = 0;
  /// Remaining validity for ongoing uses; 0: expired. If the database is unreachable, the last known state
  /// counts.
  virtual Task<std::chrono::nanoseconds> left(std::string token) = 0;
  /// Extends a token that was just used, now or soon.
  virtual void renew(const std::string& token) = 0;
  /// Logs out.
  virtual Task<Status> end(std::string token) = 0;
  /// The person's access has changed. Returns how many tokens were revoked; nothing: the database did it.
  virtual std::optional<std::size_t> forget(const std::string& name) = 0;
  /// Without a database look-up: false if it cannot be a token.
  [[nodiscard]] virtual bool mayBeToken(std::string_view token) const = 0;
  /// The key against request forgery (WebSessions); nothing: use a random one, no other server needs it.
  [[nodiscard]] virtual std::optional<std::array<unsigned char, 32>> formKey() const { return std::nullopt; }
  /// Accounts with tokens that are cached here although the database owns them; may contain repeats.
  [[nodiscard]] virtual std::vector<Principal> holders() const { return {}; }
  /// Call it about once a minute.
  virtual void tidy() {}
};

/// For a server that runs alone. All state is lost when it ends.
class LoginsInMemory final : public LoginState {
 public:
  /// Whether an access is still valid: Logins::stillAllowed(). Thread: any.
  using Holds = std::function<Result<bool>(const Principal&)>;
  /// `time`: the clock for token expiry; must outlive this.
  LoginsInMemory(Holds holds, LoginGuard failures, Tokens given, TimeSource& time = machineTime())
      : guard(std::move(failures)), tokens(std::move(given)), holds_(std::move(holds)), time_(time) {}

  Task<Result<Standing>> standing(std::string name, std::string address) override;
  Task<Result<Try>> begin(std::string name, std::string address) override;
  Task<Result<std::optional<Milliseconds>>> failed(Try tried) override;
  Task<Status> gaveUp(Try tried) override;
  Task<Status> succeeded(Try tried) override;
  Task<Result<Issued>> issue(Holder holder) override;
  Task<Result<std::optional<Holder>>> find(std::string token, std::string asker) override;
  [[nodiscard]] std::function<Result<bool>()> check(const std::string& token, const Principal& who) override;
  Task<std::chrono::nanoseconds> left(std::string token) override;
  void renew(const std::string& token) override;
  Task<Status> end(std::string token) override;
  std::optional<std::size_t> forget(const std::string& name) override;
  [[nodiscard]] bool mayBeToken(std::string_view token) const override;
  void tidy() override { tokens.tidy(time_.nowNs()); }

  LoginGuard guard;
  Tokens tokens;

 private:
  const Holds holds_;
  TimeSource& time_;
};

}  // namespace needlelab
