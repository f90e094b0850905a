#include "server/live/limits/byte_budget.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace needlelab {

void ByteBudget::State::add(const BudgetOwner& owner, std::size_t bytes) {
  if (bytes == 0) return;
  by_owner[owner.name] += bytes;
  if (owner.person) people += bytes;
  server += bytes;
  most = std::max(most, server);
  full = full || server >= limits.server;
}

void ByteBudget::State::giveBack(const BudgetOwner& owner, std::size_t bytes) {
  if (bytes == 0) return;
  assert(server >= bytes && (!owner.person || people >= bytes));
  assert(by_owner.contains(owner.name) && by_owner.at(owner.name) >= bytes);
  if (const auto theirs = by_owner.find(owner.name); (theirs->second -= bytes) == 0) by_owner.erase(theirs);
  if (owner.person) people -= bytes;
  server -= bytes;
  full = full && server > limits.server / 2;
  if (freed) freed();
}

std::size_t ByteBudget::mostBytes(const BudgetOwner& owner) const {
  const Limits& limits = state_->limits;
  return owner.person ? std::min({limits.person, limits.people, limits.server})
                      : std::min(limits.station, limits.server);
}

std::size_t ByteBudget::takenBy(const std::string& name) const {
  const auto theirs = state_->by_owner.find(name);
  return theirs == state_->by_owner.end() ? 0 : theirs->second;
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
  assert(state_ != nullptr);
  const std::size_t before = std::exchange(bytes_, bytes);
  if (bytes > before)
    state_->add(owner_, bytes - before);
  else
    state_->giveBack(owner_, before - bytes);
}

}  // namespace needlelab
