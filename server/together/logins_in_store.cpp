#include "server/together/logins_in_store.h"

#include <algorithm>
#include <utility>

#include "common/base/planted_bug.h"
#include "server/base/log.h"
#include "server/live/work/turn_queue.h"

namespace needlelab {
namespace {

using Kind = LoginGuard::Kind;
using Nanoseconds = std::chrono::nanoseconds;

std::string turnOfAddress(const std::string& address) {
  return "log-in from " + address;
}

/// The database's entries for a name at an address, for counting as in memory.
struct LoadedGuard {
  using Entries = std::array<std::optional<LoginGuard::Entry>, 8>;  // by Kind

  static Result<LoadedGuard> load(LoginStore& store, const LoginGuard::Settings& settings,
                                  const std::string& name, const std::string& address, std::int64_t now_ns) {
    LoadedGuard loaded{LoginGuard(settings)};
    ASSIGN_OR_RETURN(const auto rows, store.attempts(LoginGuard::countedName(name), address));
    for (const auto& [kind, row] : rows) {
      // a promoted standby's clock may be hours behind: do not make anyone wait for that
      const LoginGuard::Entry entry{row.failures, std::min(row.at_ns, now_ns)};
      loaded.guard.setEntry(kind, name, address, entry);
      loaded.before[static_cast<std::size_t>(kind)] = entry;
    }
    return loaded;
  }

  /// Stores the entries that have changed since.
  Status store(LoginStore& store, const std::string& name, const std::string& address) const {
    for (const Kind kind : LoginGuard::kKinds) {
      const auto now = guard.entry(kind, name, address);
      if (now == before[static_cast<std::size_t>(kind)]) continue;
      std::optional<LoginRow> row;
      if (now) row = LoginRow{now->failures, now->at_ns, 0};
      RETURN_IF_ERROR(store.putAttempt(kind, LoginGuard::countedName(name), address, row));
    }
    return {};
  }

  LoginGuard guard;
  Entries before{};
};

Principal principalOf(const TokenRow& row) {
  return {row.name, static_cast<pb::Role>(row.role), true, row.access_number, row.called};
}

}  // namespace

LoginsInStore::LoginsInStore(Uses uses, Settings settings, TimeSource& time)
    : io_(uses.io),
      turns_(uses.turns),
      readers_(uses.readers),
      shared_(uses.shared),
      settings_(settings),
      time_(time) {}

template <typename T>
Task<Result<T>> LoginsInStore::runQueued(std::string turn,
                                         std::function<Result<T>(LoginStore&, std::int64_t)> work) {
  std::function<Result<T>()> run = [&shared = shared_, work = std::move(work)] {
    return shared.run<T>(work);
  };
  return offload(turns_, std::move(turn), std::move(run));
}

Task<Status> LoginsInStore::changeQueued(std::string turn,
                                         std::function<Status(LoginStore&, std::int64_t)> change) {
  std::function<Result<bool>(LoginStore&, std::int64_t)> work =
      [change = std::move(change)](LoginStore& store, std::int64_t now_ns) -> Result<bool> {
    RETURN_IF_ERROR(change(store, now_ns));
    return true;
  };
  const auto done = co_await runQueued<bool>(std::move(turn), std::move(work));
  co_return done.ok() ? Status() : Status(done.error());
}

Task<Result<LoginState::Standing>> LoginsInStore::standing(std::string name, std::string address) {
  std::string turn = turnOfAddress(address);
  return runQueued<Standing>(
      std::move(turn),
      [settings = settings_.guard, name = std::move(name), address = std::move(address)](
          LoginStore& store, std::int64_t now_ns) -> Result<Standing> {
        ASSIGN_OR_RETURN(const auto loaded, LoadedGuard::load(store, settings, name, address, now_ns));
        return Standing{loaded.guard.mustWait(name, address, now_ns), loaded.guard.knows(name, address),
                        loaded.guard.knowsAddress(address)};
      });
}

Task<Result<LoginState::Try>> LoginsInStore::begin(std::string name, std::string address) {
  std::string turn = turnOfAddress(address);
  return runQueued<Try>(
      std::move(turn),
      [settings = settings_.guard, name = std::move(name), address = std::move(address)](
          LoginStore& store, std::int64_t now_ns) -> Result<Try> {
        RETURN_IF_ERROR(store.lockAttempts());
        ASSIGN_OR_RETURN(auto loaded, LoadedGuard::load(store, settings, name, address, now_ns));
        Try tried{name, address};
        tried.wait = loaded.guard.mustWait(name, address, now_ns);
        if (tried.wait.count() > 0) return tried;
        tried.pair_before = loaded.guard.entry(Kind::kPair, name, address).value_or(LoginGuard::Entry{});
        // a concurrent attempt for the same name at another server sees it counted
        if (loaded.guard.failed(name, address, now_ns))
          tried.then_wait = loaded.guard.mustWait(name, address, now_ns);
        RETURN_IF_ERROR(loaded.store(store, name, address));
        return tried;
      });
}

// begin() has already counted it.
Task<Result<std::optional<LoginState::Milliseconds>>> LoginsInStore::failed(Try tried) {
  if (tried.then_wait.count() == 0) co_return std::optional<Milliseconds>();
  co_return std::optional(tried.then_wait);
}

Task<Status> LoginsInStore::abandoned(Try tried) {
  return takeBack(std::move(tried), false);
}

Task<Status> LoginsInStore::succeeded(Try tried) {
  return takeBack(std::move(tried), true);
}

Task<Status> LoginsInStore::takeBack(Try tried, bool is_success) {
  std::string turn = turnOfAddress(tried.address);
  return changeQueued(
      std::move(turn),
      [settings = settings_.guard, tried = std::move(tried), is_success](LoginStore& store,
                                                                         std::int64_t now_ns) -> Status {
        RETURN_IF_ERROR(store.lockAttempts());
        ASSIGN_OR_RETURN(auto loaded, LoadedGuard::load(store, settings, tried.name, tried.address, now_ns));
        loaded.guard.takeBack(tried.name, tried.address, tried.pair_before, now_ns);
        if (is_success) loaded.guard.succeeded(tried.name, tried.address, now_ns);
        return loaded.store(store, tried.name, tried.address);
      });
}

Task<Result<LoginState::Issued>> LoginsInStore::issue(Holder holder) {
  Issued issued;
  issued.token = shared_.key().makeToken();
  std::function<Result<Found>(LoginStore&, std::int64_t)> work =
      [settings = settings_, holder, token = issued.token](LoginStore& store,
                                                           std::int64_t now_ns) -> Result<Found> {
    TokenRow row{holder.who.name, static_cast<int>(holder.who.role), holder.who.access_number.value_or(0)};
    // a clock that is behind, e.g. of a promoted standby, must not extend the time
    row.password_ns = holder.password_ns == 0 ? now_ns : std::min(holder.password_ns, now_ns);
    row.expires_ns = std::min(now_ns + settings.lifetime.count(), row.password_ns + settings.longest.count());
    ASSIGN_OR_RETURN(const bool is_stored, store.addToken(token, row, TokenLimits{}.max_of_person));
    if (!is_stored && !planted(PlantedBug::kRevokedTokenHonoured))
      return Error{ErrorCode::kConflict, holder.who.name + ": the account was changed during its log-in"};
    return Found{Holder{holder.who, row.password_ns}, Nanoseconds(row.expires_ns - now_ns)};
  };
  const std::uint64_t before = forgotten_;
  std::string turn = turnNameOf(holder.who);
  const auto stored = co_await runQueued<Found>(std::move(turn), std::move(work));
  if (!stored.ok()) co_return stored.error();
  issued.left = stored->left;
  if (before == forgotten_) keep(issued.token, *stored->holder, issued.left);
  co_return issued;
}

Task<Result<std::optional<LoginState::Holder>>> LoginsInStore::find(std::string token, std::string asker) {
  if (!shared_.key().madeToken(token)) co_return std::optional<Holder>();
  if (auto kept = kept_.find(token, time_.nowNs())) co_return kept;
  const auto found = co_await read(token, std::move(asker));
  if (!found.ok()) co_return found.error();
  if (!found->holder) co_return std::optional<Holder>();
  if (found->is_current) keep(token, *found->holder, found->left);
  co_return found->holder;
}

Task<Result<LoginsInStore::Found>> LoginsInStore::read(std::string token, std::string asker) {
  std::function<Result<Found>(LoginStore&, std::int64_t)> work =
      [lifetime = settings_.lifetime, token = std::move(token)](LoginStore& store,
                                                                std::int64_t now_ns) -> Result<Found> {
    ASSIGN_OR_RETURN(const auto row, store.token(token, now_ns));
    if (!row) return Found{};
    return Found{Holder{principalOf(*row), row->password_ns},
                 std::min(Nanoseconds(row->expires_ns - now_ns), lifetime)};
  };
  const std::uint64_t before = forgotten_;
  std::string turn = turnOfAddress(asker);
  auto found = co_await runQueued<Found>(std::move(turn), std::move(work));
  if (found.ok()) found->is_current = before == forgotten_;
  co_return found;
}

std::function<Result<bool>()> LoginsInStore::check(const std::string& token, const Principal& /*who*/) {
  if (planted(PlantedBug::kRevokedTokenHonoured) && kept_.find(token, time_.nowNs()))
    return [] { return true; };
  return [&readers = readers_, &key = shared_.key(), token]() -> Result<bool> {
    ASSIGN_OR_RETURN(auto reader, readers.borrow());
    return LoginStore(*reader, key).isTokenValid(token);
  };
}

Task<Nanoseconds> LoginsInStore::left(std::string token) {
  const std::int64_t now_ns = time_.nowNs();
  if (const auto end_ns = kept_.endOf(token, now_ns)) co_return Nanoseconds(*end_ns - now_ns);
  // read again if an account changed meanwhile: the result may be from before
  constexpr int kMaxReads = 10;
  for (int n = 0; n < kMaxReads; ++n) {
    const auto found = co_await read(token, "a live page");
    if (!found.ok() || !found->holder) break;
    if (!found->is_current) continue;
    keep(token, *found->holder, found->left);
    co_return found->left;
  }
  co_return Nanoseconds(0);
}

void LoginsInStore::renew(const std::string& token) {
  const std::int64_t now_ns = time_.nowNs();
  const auto holder = kept_.find(token, now_ns);
  if (!holder) return;
  // a token in constant use is written only a few times per lifetime
  constexpr int kWritesOfLifetime = 15;
  const std::int64_t gained_ns = now_ns + settings_.lifetime.count() - *kept_.endOf(token, now_ns);
  if (gained_ns < settings_.lifetime.count() / kWritesOfLifetime) return;
  if (!being_renewed_.insert(LoginKey::hashOfToken(token)).second) return;
  asio::co_spawn(io_, renewNow(*this, token, turnNameOf(holder->who)), rethrow);
}

Task<> LoginsInStore::renewNow(LoginsInStore& self, std::string token, std::string turn) {
  std::function<Result<Nanoseconds>(LoginStore&, std::int64_t)> work =
      [settings = self.settings_, token](LoginStore& store, std::int64_t now_ns) -> Result<Nanoseconds> {
    ASSIGN_OR_RETURN(const auto end_ns, store.renewToken(token, now_ns, settings.lifetime, settings.longest));
    return end_ns ? Nanoseconds(*end_ns - now_ns) : Nanoseconds(0);
  };
  const auto left = co_await self.runQueued<Nanoseconds>(std::move(turn), std::move(work));
  self.being_renewed_.erase(LoginKey::hashOfToken(token));
  // if the database is unreachable, the token expires as before
  const auto holder = self.kept_.find(token, self.time_.nowNs());
  if (holder && left.ok()) self.keep(token, *holder, *left);
}

Task<Status> LoginsInStore::end(std::string token) {
  kept_.end(token);
  return changeQueued(
      "log-outs", [&shared = shared_, token = std::move(token)](LoginStore& store, std::int64_t /*now_ns*/) {
        return store.endToken(token, shared.server());
      });
}

std::optional<std::size_t> LoginsInStore::forget(const std::string& name) {
  if (planted(PlantedBug::kRevokedTokenHonoured)) return std::nullopt;
  ++forgotten_;
  kept_.forget(name);
  return std::nullopt;
}

bool LoginsInStore::mayBeToken(std::string_view token) const {
  return shared_.key().madeToken(token);
}

std::optional<std::array<unsigned char, 32>> LoginsInStore::formKey() const {
  return shared_.key().of("forms", "");
}

void LoginsInStore::tidy() {
  kept_.tidy(time_.nowNs());
  if (std::exchange(is_tidying_, true)) return;
  const auto tidied = [](LoginsInStore& self) -> Task<> {
    std::function<Status(LoginStore&, std::int64_t)> change = [bounds = self.settings_.bounds](
                                                                  LoginStore& store, std::int64_t now_ns) {
      return store.tidy(now_ns, bounds);
    };
    std::string turn = "tidying";
    const Status done = co_await self.changeQueued(std::move(turn), std::move(change));
    self.is_tidying_ = false;
    if (!done.ok()) logEvent(LogLevel::kWarning, "logins_not_tidied", {{"text", done.error().message}});
  };
  asio::co_spawn(io_, tidied(*this), rethrow);
}

void LoginsInStore::keep(const std::string& token, const Holder& holder, Nanoseconds left) {
  const std::int64_t now_ns = time_.nowNs();
  kept_.keep(token, holder, now_ns + left.count(), now_ns);
}

}  // namespace needlelab
