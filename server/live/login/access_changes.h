/// Notifies log-ins and downloads in progress when their account's access has changed.
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
  constexpr int kMostChecks = 2;
  for (int n = 0; n < kMostChecks; ++n) {
    const AccessWatch watch = changes.watch(name, station);
    auto result = co_await check();
    if (!result.ok() || !watch.changed()) co_return result;
  }
  co_return Error{ErrorCode::kConflict, "the account was changed while its log-in was checked: try again"};
}

}  // namespace needlelab
