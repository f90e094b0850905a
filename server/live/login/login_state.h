/// What a server knows about log-ins beyond the accounts: failures and lock-outs, addresses with earlier
/// log-ins, tokens. Kept in memory or, for several servers on one database, in the database. Notifies log-ins
/// and downloads in progress when their account's access has changed.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "common/wire/asio.h"
#include "db/service/service.h"
#include "server/live/limits/limits.h"
#include "server/live/login/login_guard.h"
#include "server/live/login/tokens.h"
#include "server/live/work/turn_queue.h"

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
  virtual Task<Status> abandoned(Try tried) = 0;
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
  Task<Status> abandoned(Try tried) override;
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

// --- changes of access while log-ins and downloads are in progress

/// Watches an account from the moment of its creation. Thread: changed() on the network's.
class AccessWatch {
 public:
  /// Whether the account was disabled or erased, or its role, password or key changed, since the watch began.
  [[nodiscard]] bool changed() const { return *changed_; }

 private:
  friend class AccessChanges;
  explicit AccessWatch(std::shared_ptr<const bool> changed) : changed_(std::move(changed)) {}
  std::shared_ptr<const bool> changed_;
};

/// Reports changes by account name, so a change is seen only by watches of that account. Holds at most twice
/// as many names as are watched. A watch may outlive it. Thread: the network's.
class AccessChanges {
 public:
  /// Names need not exist. A station and a person of the same name are different accounts.
  [[nodiscard]] AccessWatch watch(const std::string& name, bool station);
  void changed(const std::string& name, bool station);
  /// Number of names held.
  [[nodiscard]] std::size_t size() const { return watched_.size(); }

 private:
  static constexpr std::size_t kFewNames = 64;
  std::map<std::pair<std::string, bool>, std::weak_ptr<bool>> watched_;
  std::size_t sweep_at_ = kFewNames;  // names
};

/// The result of `check` on an account that did not change while it ran. If the account changed during a
/// successful check, the check is repeated, but only once, so that changing an account cannot cause endless
/// hashing. kConflict: it changed during the second check, too. Thread: the network's; `changes` must outlive
/// it.
template <typename T>
Task<Result<T>> checkUnchanged(AccessChanges& changes, std::string name, bool station,
                               std::function<Task<Result<T>>()> check) {
  constexpr int kMaxChecks = 2;
  for (int n = 0; n < kMaxChecks; ++n) {
    const AccessWatch watch = changes.watch(name, station);
    auto result = co_await check();
    if (!result.ok() || !watch.changed()) co_return result;
  }
  co_return Error{ErrorCode::kConflict, "the account was changed while its log-in was checked: try again"};
}

/// Log-ins of one server: their state, the queue for password checks, concurrent changes of access.
struct ServerLogins {
  asio::io_context& io;
  const LoginQueueLimits& bounds;
  std::unique_ptr<LoginState> state{};  ///< lock-outs and tokens
  LoginQueue waiting{io.get_executor(), bounds};
  AccessChanges access{};  ///< accounts disabled, keys revoked, passwords changed
};

}  // namespace needlelab
