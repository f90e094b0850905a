// Log-in state in memory.
#include "server/live/login/login_state.h"

#include <algorithm>
#include <utility>

#include "common/base/time/clock.h"

namespace needlelab {

using Nanoseconds = std::chrono::nanoseconds;

Task<Result<LoginState::Standing>> LoginsInMemory::standing(std::string name, std::string address) {
  co_return Standing{guard.mustWait(name, address, steadyNowNs()), guard.knows(name, address),
                     guard.knowsAddress(address)};
}

// Log-ins take turns one at a time, so no other attempt happens between this and the outcome.
Task<Result<LoginState::Try>> LoginsInMemory::begin(std::string name, std::string address) {
  Try tried;
  tried.wait = guard.mustWait(name, address, steadyNowNs());
  tried.name = std::move(name);
  tried.address = std::move(address);
  co_return tried;
}

Task<Result<std::optional<LoginState::Milliseconds>>> LoginsInMemory::failed(Try tried) {
  const std::int64_t now_ns = steadyNowNs();
  if (!guard.failed(tried.name, tried.address, now_ns)) co_return std::optional<Milliseconds>();
  co_return std::optional(guard.mustWait(tried.name, tried.address, now_ns));
}

Task<Status> LoginsInMemory::abandoned(Try /*tried*/) {
  co_return Status();
}

Task<Status> LoginsInMemory::succeeded(Try tried) {
  guard.succeeded(tried.name, tried.address, steadyNowNs());
  co_return Status();
}

Task<Result<LoginState::Issued>> LoginsInMemory::issue(Holder holder) {
  const std::int64_t now_ns = time_.nowNs();
  if (holder.password_ns == 0) holder.password_ns = now_ns;
  auto issued = tokens.issue(holder, now_ns);
  co_return Issued{std::move(issued.token), Nanoseconds(issued.expires_ns - now_ns)};
}

Task<Result<std::optional<LoginState::Holder>>> LoginsInMemory::find(std::string token,
                                                                     std::string /*asker*/) {
  co_return tokens.find(token, time_.nowNs());
}

std::function<Result<bool>()> LoginsInMemory::check(const std::string& /*token*/, const Principal& who) {
  return [holds = holds_, who] { return holds(who); };
}

Task<Nanoseconds> LoginsInMemory::left(std::string token) {
  const std::int64_t now_ns = time_.nowNs();
  co_return Nanoseconds(tokens.endOf(token, now_ns).value_or(now_ns) - now_ns);
}

void LoginsInMemory::renew(const std::string& token) {
  (void)tokens.renew(token, time_.nowNs());
}

Task<Status> LoginsInMemory::end(std::string token) {
  tokens.end(token);
  co_return Status();
}

std::optional<std::size_t> LoginsInMemory::forget(const std::string& name) {
  return tokens.forget(name);
}

bool LoginsInMemory::mayBeToken(std::string_view token) const {
  return tokens.endOf(token, time_.nowNs()).has_value();
}

AccessWatch AccessChanges::watch(const std::string& name, bool station) {
  if (watched_.size() >= sweep_at_) {
    std::erase_if(watched_, [](const auto& entry) { return entry.second.expired(); });
    sweep_at_ = std::max(kFewNames, 2 * watched_.size());
  }
  std::weak_ptr<bool>& held = watched_[{name, station}];
  auto flag = held.lock();
  if (!flag) {
    flag = std::make_shared<bool>(false);
    held = flag;
  }
  return AccessWatch(std::move(flag));
}

void AccessChanges::changed(const std::string& name, bool station) {
  const auto found = watched_.find({name, station});
  if (found == watched_.end()) return;
  if (const auto flag = found->second.lock()) *flag = true;
  // a later watch starts with the account as it is now
  watched_.erase(found);
}

}  // namespace needlelab
