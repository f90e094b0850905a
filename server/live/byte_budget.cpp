#include "server/live/byte_budget.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

namespace needlelab {

struct ByteBudget::State {
  Limits limits;
  std::function<void()> freed;
  std::unordered_map<std::string, std::size_t> by_owner;  // without zeros
  std::size_t people = 0, server = 0, most = 0;
  bool full = false;

  void add(const BudgetOwner& owner, std::size_t bytes) {
    if (bytes == 0) return;
    by_owner[owner.name] += bytes;
    if (owner.person) people += bytes;
    server += bytes;
    most = std::max(most, server);
    full = full || server >= limits.server;
  }
  void giveBack(const BudgetOwner& owner, std::size_t bytes) {
    if (bytes == 0) return;
    if (const auto theirs = by_owner.find(owner.name); (theirs->second -= bytes) == 0) by_owner.erase(theirs);
    if (owner.person) people -= bytes;
    server -= bytes;
    full = full && server > limits.server / 2;
    if (freed) freed();
  }
};

ByteBudget::ByteBudget(const Limits& limits, std::function<void()> freed)
    : state_(std::make_shared<State>()) {
  state_->limits = limits;
  state_->freed = std::move(freed);
}

std::size_t ByteBudget::mostBytes(const BudgetOwner& owner) const {
  const Limits& limits = state_->limits;
  return owner.person ? std::min({limits.person, limits.people, limits.server})
                      : std::min(limits.station, limits.server);
}

std::size_t ByteBudget::taken() const {
  return state_->server;
}

std::size_t ByteBudget::mostTaken() const {
  return state_->most;
}

bool ByteBudget::full() const {
  return state_->full;
}

std::size_t ByteBudget::takenBy(const std::string& name) const {
  const auto theirs = state_->by_owner.find(name);
  return theirs == state_->by_owner.end() ? 0 : theirs->second;
}

void ByteBudget::add(const BudgetOwner& owner, std::size_t bytes) {
  state_->add(owner, bytes);
}

void ByteBudget::giveBack(const BudgetOwner& owner, std::size_t bytes) {
  state_->giveBack(owner, bytes);
}

std::optional<ByteBudget::Share> ByteBudget::take(const BudgetOwner& owner, std::size_t bytes) {
  const State& state = *state_;
  const Limits& limits = state.limits;
  const auto room = [bytes](std::size_t used, std::size_t limit) {
    return bytes <= limit && used <= limit - bytes;
  };
  const bool fits = room(takenBy(owner.name), owner.person ? limits.person : limits.station) &&
                    (!owner.person || room(state.people, limits.people)) && room(state.server, limits.server);
  if (!fits) return std::nullopt;
  add(owner, bytes);
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
  if (state_) state_->giveBack(owner_, bytes_);
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
