/// What a server knows of log-ins beyond the accounts: failures and lock-outs, addresses where somebody has
/// logged in, tokens. In its memory, or, for several servers on one database, there.
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
#include "common/base/time_source.h"
#include "common/wire/asio.h"
#include "db/service/service.h"
#include "server/live/login_guard.h"
#include "server/live/tokens.h"

namespace needlelab {

/// Names and addresses are keys: "person NAME", Admission::keyOf(). Where its answer is in memory a call is
/// done at once, and nothing comes between; else it waits on the log-ins' thread, each address or person in
/// turn. Errors: kUnavailable, where the database is away. Thread: the network's.
class LoginState {
 public:
  using Milliseconds = std::chrono::milliseconds;
  using Holder = Tokens::Holder;

  virtual ~LoginState() = default;
  LoginState() = default;
  LoginState(const LoginState&) = delete;
  LoginState& operator=(const LoginState&) = delete;

  // --- tries of passwords: standing(), and when the turn has come begin(); then exactly one of the others

  struct Standing {
    Milliseconds wait{0};        ///< above 0: too many failures
    bool knows_person = false;   ///< the name has logged in at this address before
    bool knows_address = false;  ///< somebody has
  };
  virtual Task<Result<Standing>> standing(std::string name, std::string address) = 0;

  /// A try whose turn has come. From here on it counts as a failure for other servers, so that all of them
  /// together let pass as many as one.
  struct Try {
    std::string name, address;
    Milliseconds wait{0};             ///< above 0: it is not allowed, and has ended
    Milliseconds then_wait{0};        ///< above 0: if it fails, a wait begins
    LoginGuard::Entry pair_before{};  ///< for LoginGuard::takeBack()
  };
  virtual Task<Result<Try>> begin(std::string name, std::string address) = 0;
  /// Returns how long the name or address waits now, if a wait has begun: worth a line of the audit log.
  virtual Task<Result<std::optional<Milliseconds>>> failed(Try tried) = 0;
  /// It could not be checked.
  virtual Task<Status> gaveUp(Try tried) = 0;
  virtual Task<Status> succeeded(Try tried) = 0;

  // --- tokens, also the sessions of browsers

  struct Issued {
    std::string token;  ///< 32 bytes
    std::chrono::nanoseconds left{0};
  };
  /// `holder`: with password_ns 0 of a log-in with the password just now. kConflict: the account is not as it
  /// was at the log-in any more.
  virtual Task<Result<Issued>> issue(Holder holder) = 0;
  /// The holder of a valid token. `asker`: whose turn a look into the database takes, an address.
  virtual Task<Result<std::optional<Holder>>> find(std::string token, std::string asker) = 0;
  /// For another thread: whether the holder's token, and with it the account's access, is valid in the
  /// database now.
  [[nodiscard]] virtual std::function<Result<bool>()> check(const std::string& token,
                                                            const Principal& who) = 0;
  /// How long it is valid, for what goes on: 0: no more. Where the database is away, what has been heard
  /// counts.
  virtual Task<std::chrono::nanoseconds> left(std::string token) = 0;
  /// Lengthens a token that was just used, at once or soon.
  virtual void renew(const std::string& token) = 0;
  /// Logs out.
  virtual Task<Status> end(std::string token) = 0;
  /// The person's access has changed: returns how many tokens it had; nothing: the database has ended them.
  virtual std::optional<std::size_t> forget(const std::string& name) = 0;
  /// Without looking at the database: false for what was never a token.
  [[nodiscard]] virtual bool mayBeToken(std::string_view token) const = 0;
  /// The key of the texts against forged requests (WebSessions); nothing: any that no other server has.
  [[nodiscard]] virtual std::optional<std::array<unsigned char, 32>> formKey() const { return std::nullopt; }
  /// Accounts with tokens that are kept here though they are the database's; each perhaps several times.
  [[nodiscard]] virtual std::vector<Principal> holders() const { return {}; }
  /// Call it about once a minute.
  virtual void tidy() {}
};

/// Of a server that is alone. Its end forgets everything.
class LoginsInMemory final : public LoginState {
 public:
  /// Whether an access still holds: Service::stillAllowed(). Thread: any.
  using Holds = std::function<Result<bool>(const Principal&)>;
  /// `time`: by which tokens end; must outlive it.
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
