#include "server/live/login/access_changes.h"

#include <algorithm>

namespace needlelab {

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
