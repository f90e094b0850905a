/// Tells log-ins and downloads in progress that the access of their account has changed.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "common/base/result.h"
#include "common/wire/asio.h"

namespace needlelab {

/// An account, watched from a moment on. Thread: changed() on the network's.
class AccessWatch {
 public:
  /// Whether the account was disabled or erased, or got another role, password or key, since the watch began.
  [[nodiscard]] bool changed() const { return *changed_; }

 private:
  friend class AccessChanges;
  explicit AccessWatch(std::shared_ptr<const bool> changed) : changed_(std::move(changed)) {}
  std::shared_ptr<const bool> changed_;
};

/// Knows a change only by the account's name: what happens to one account says nothing to those who watch
/// others. Holds the names that are watched, and at most as many again. A watch may end later. Thread: the
/// network's.
class AccessChanges {
 public:
  /// Names need not exist. A station and a person of one name are two.
  [[nodiscard]] AccessWatch watch(const std::string& name, bool station);
  void changed(const std::string& name, bool station);
  /// Names that are held.
  [[nodiscard]] std::size_t size() const { return watched_.size(); }

 private:
  static constexpr std::size_t kFewNames = 64;
  std::map<std::pair<std::string, bool>, std::weak_ptr<bool>> watched_;
  std::size_t sweep_at_ = kFewNames;  // names
};

/// The result of `check` on an account that did not change while it ran. When a check that succeeded may be
/// of the account as it was before, it is made once more and not again, so that nobody can have hashes
/// computed without end by changing an account. kConflict: it changed in the second one, too. Thread: the
/// network's; `changes` must outlive it.
template <typename T>
Task<Result<T>> checkUnchanged(AccessChanges& changes, std::string name, bool station,
                               std::function<Task<Result<T>>()> check) {
  constexpr int kMostChecks = 2;
  for (int n = 0; n < kMostChecks; ++n) {
    const AccessWatch watch = changes.watch(name, station);
    auto result = co_await check();
    if (!result.ok() || !watch.changed()) co_return result;
  }
  co_return Error{ErrorCode::kConflict, "the account was changed while its log-in was checked: try again"};
}

}  // namespace needlelab
