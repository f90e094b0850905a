/// Log-in state of several servers on one database, stored there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "common/base/time/time_source.h"
#include "common/wire/asio.h"
#include "db/login/shared_logins.h"
#include "db/store/store_address.h"
#include "server/live/login/login_state.h"
#include "server/live/work/fair_queue.h"

namespace needlelab {

/// A lock-out at one server applies at all; together they allow no more attempts than one; and a token issued
/// by one is valid at the others. Uses the database's clock, so the servers' own clocks may differ by hours.
///
/// Caches tokens for live pages and downloads, which continue without database look-ups until the token
/// expires, its account's access changes, or one of the account's tokens is ended at any server
/// (AccessListener then causes forget()). Each request looks into the database itself (check()).
class LoginsInStore final : public LoginState {
 public:
  struct Settings {
    LoginGuard::Settings guard{};
    std::chrono::nanoseconds lifetime = TokenLimits{}.lifetime;
    std::chrono::nanoseconds longest = TokenLimits{}.longest;
    LoginStore::Bounds bounds{};
  };
  struct Uses {
    asio::io_context& io;
    FairPool& turns;      ///< on the log-ins' thread
    ReaderPool& readers;  ///< for check()
    SharedLogins& shared;
  };
  /// What it uses must outlive it. `time`: for the cache.
  LoginsInStore(Uses uses, Settings settings, TimeSource& time = machineTime());

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
  [[nodiscard]] std::optional<std::array<unsigned char, 32>> formKey() const override;
  void tidy() override;

  [[nodiscard]] std::vector<Principal> holders() const override { return kept_.holders(); }

 private:
  struct Found {
    std::optional<Holder> holder;
    std::chrono::nanoseconds left{0};
    bool is_current = false;  ///< no access has changed meanwhile
  };

  template <typename T>
  Task<Result<T>> runQueued(std::string turn,
                            std::function<Result<T>(LoginStore&, std::int64_t now_ns)> work);
  Task<Status> changeQueued(std::string turn, std::function<Status(LoginStore&, std::int64_t now_ns)> change);
  /// Queries the database.
  Task<Result<Found>> read(std::string token, std::string asker);
  void keep(const std::string& token, const Holder& holder, std::chrono::nanoseconds left);
  static Task<> renewNow(LoginsInStore& self, std::string token, std::string turn);
  Task<Status> takeBack(Try tried, bool is_success);

  asio::io_context& io_;
  FairPool& turns_;
  ReaderPool& readers_;
  SharedLogins& shared_;
  const Settings settings_;
  TimeSource& time_;
  Tokens kept_;  ///< expiry times are those of time_
  std::set<LoginKey::Hash> being_renewed_;
  std::uint64_t forgotten_ = 0;  ///< calls of forget(): what was read before one may be outdated
  bool is_tidying_ = false;
};

}  // namespace needlelab
