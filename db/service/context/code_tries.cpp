#include "db/service/context/code_tries.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <optional>

namespace needlelab {
namespace {

/// The database's time at the start of a transaction.
class StandingTime final : public TimeSource {
 public:
  explicit StandingTime(std::int64_t now_ns) : now_ns_(now_ns) {}
  [[nodiscard]] std::int64_t nowNs() noexcept override { return now_ns_; }
  void sleepUntilNs(std::int64_t /*due_ns*/) noexcept override {}

 private:
  const std::int64_t now_ns_;
};

/// Applies `change` to the person's entry in the database, while no other server counts.
template <typename T>
Result<T> changed(SharedLogins& shared, const std::string& name, const std::function<T(CodeGuard&)>& change) {
  return shared.run<T>([&](LoginStore& store, std::int64_t now_ns) -> Result<T> {
    RETURN_IF_ERROR(store.lockAttempts());
    ASSIGN_OR_RETURN(const auto before, store.attempt(LoginRow::Kind::kCode, name, {}));
    StandingTime time(now_ns);
    CodeGuard guard(time);
    // a promoted standby's clock may be hours behind: cap the remaining waits
    const std::int64_t latest_ns =
        now_ns + std::chrono::nanoseconds(CodeGuard::Settings().longest_wait).count();
    if (before)
      guard.setEntry(name, {static_cast<unsigned>(before->failures), std::min(before->at_ns, now_ns),
                            std::min(before->wait_until_ns, latest_ns)});
    T result = change(guard);
    std::optional<LoginRow> after;
    if (const auto entry = guard.entry(name))
      after = {static_cast<double>(entry->wrong), entry->at_ns, entry->wait_until_ns};
    if (after != before) RETURN_IF_ERROR(store.putAttempt(LoginRow::Kind::kCode, name, {}, after));
    return result;
  });
}

}  // namespace

Result<CodeGuard::Try> CodesInStore::begin(const std::string& name) {
  return changed<CodeGuard::Try>(shared_, name, [&](CodeGuard& guard) { return guard.begin(name); });
}

Status CodesInStore::forget(const std::string& name) {
  const auto done = changed<bool>(shared_, name, [&](CodeGuard& guard) {
    guard.forget(name);
    return true;
  });
  return done ? Status() : Status(done.error());
}

Status CodesInStore::giveBack(const std::string& name) {
  const auto done = changed<bool>(shared_, name, [&](CodeGuard& guard) {
    guard.giveBack(name);
    return true;
  });
  return done ? Status() : Status(done.error());
}

}  // namespace needlelab
