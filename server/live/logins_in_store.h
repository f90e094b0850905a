/// Log-in state of several servers on one database: in it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "common/base/time_source.h"
#include "common/wire/asio.h"
#include "db/reader_pool.h"
#include "db/shared_logins.h"
#include "server/live/fair_queue.h"
#include "server/live/login_state.h"

namespace needlelab {

/// A lock-out at one server holds at each, all together let pass as many tries as one, and a token of one is
/// valid at the others. Compared are times of the database's clock; so servers' own may be hours apart.
///
/// Tokens that were found are kept here for live pages and downloads, which go on without a look into the
/// database: up to their ends, and until their account's access changes or one of its tokens is ended,
/// anywhere (forget(), which AccessListener has called). Each request looks there itself (check()).
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
  /// What it uses must outlive it. `time`: of what is kept here.
  LoginsInStore(Uses uses, Settings settings, TimeSource& time = machineTime());

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
  [[nodiscard]] std::optional<std::array<unsigned char, 32>> formKey() const override;
  void tidy() override;

  [[nodiscard]] std::vector<Principal> holders() const override { return kept_.holders(); }

 private:
  struct Found {
    std::optional<Holder> holder;
    std::chrono::nanoseconds left{0};
    bool is_current = false;  ///< nobody's access has changed meanwhile
  };

  template <typename T>
  Task<Result<T>> inTurn(std::string turn, std::function<Result<T>(LoginStore&, std::int64_t now_ns)> work);
  Task<Status> changeInTurn(std::string turn, std::function<Status(LoginStore&, std::int64_t now_ns)> change);
  /// Asks the database.
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
  Tokens kept_;  ///< up to times of time_
  std::set<LoginKey::Hash> being_renewed_;
  std::uint64_t forgotten_ = 0;  ///< calls of forget(): what was read before one may have changed since
  bool is_tidying_ = false;
};

}  // namespace needlelab
