#include "server/live/byte_budget.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

namespace needlelab {

struct ByteBudget::State {
  Limits limits;
  std::function<void()> freed;
  // without zero entries
  std::unordered_map<std::string, std::size_t> by_connection, by_owner;
  std::size_t people = 0, server = 0, most = 0;

  void add(const BudgetOwner& owner, std::size_t bytes) {
    by_connection[owner.connection] += bytes;
    by_owner[owner.name] += bytes;
    if (owner.person) people += bytes;
    server += bytes;
    most = std::max(most, server);
  }
  void giveBack(const BudgetOwner& owner, std::size_t bytes) {
    const auto less = [bytes](auto& entries, const std::string& key) {
      if (const auto entry = entries.find(key); (entry->second -= bytes) == 0) entries.erase(entry);
    };
    less(by_connection, owner.connection);
    less(by_owner, owner.name);
    if (owner.person) people -= bytes;
    server -= bytes;
    if (freed) freed();
  }
};

ByteBudget::ByteBudget(Limits limits, std::function<void()> freed) : state_(std::make_shared<State>()) {
  state_->limits = limits;
  state_->freed = std::move(freed);
}

std::size_t ByteBudget::mostBytes(const BudgetOwner& owner) const {
  const Limits& limits = state_->limits;
  return owner.person ? std::min({limits.connection, limits.person, limits.people, limits.server})
                      : std::min({limits.connection, limits.station, limits.server});
}

std::size_t ByteBudget::taken() const {
  return state_->server;
}

std::size_t ByteBudget::mostTaken() const {
  return state_->most;
}

std::optional<ByteBudget::Share> ByteBudget::take(const BudgetOwner& owner, std::size_t bytes) {
  State& state = *state_;
  const Limits& limits = state.limits;
  const auto room = [bytes](std::size_t used, std::size_t limit) {
    return bytes <= limit && used <= limit - bytes;
  };
  const auto used = [](const auto& entries, const std::string& key) {
    const auto entry = entries.find(key);
    return entry == entries.end() ? std::size_t{0} : entry->second;
  };
  const bool fits = room(used(state.by_connection, owner.connection), limits.connection) &&
                    room(used(state.by_owner, owner.name), owner.person ? limits.person : limits.station) &&
                    (!owner.person || room(state.people, limits.people)) && room(state.server, limits.server);
  if (!fits) return std::nullopt;
  if (bytes > 0) state.add(owner, bytes);
  return Share(state_, owner, bytes);
}

ByteBudget::Share::Share(std::shared_ptr<State> state, BudgetOwner owner, std::size_t bytes)
    : state_(std::move(state)), owner_(std::move(owner)), bytes_(bytes) {}

ByteBudget::Share& ByteBudget::Share::operator=(Share&& other) noexcept {
  std::swap(state_, other.state_);
  std::swap(owner_, other.owner_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

ByteBudget::Share::~Share() {
  if (state_ && bytes_ > 0) state_->giveBack(owner_, bytes_);
}

void ByteBudget::Share::become(std::size_t bytes) {
  lower(bytes);
  if (!state_ || bytes <= bytes_) return;
  state_->add(owner_, bytes - bytes_);
  bytes_ = bytes;
}

void ByteBudget::Share::lower(std::size_t bytes) {
  if (!state_ || bytes >= bytes_) return;
  const std::size_t less = bytes_ - bytes;
  bytes_ = bytes;
  state_->giveBack(owner_, less);
}

}  // namespace needlelab
