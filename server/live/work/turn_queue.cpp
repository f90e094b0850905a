#include "server/live/work/turn_queue.h"

#include <algorithm>
#include <cassert>
#include <vector>

namespace needlelab {

std::string turnNameOf(const Principal& who) {
  return (who.role == pb::STATION ? "station " : "person ") + who.name;
}

struct TurnQueue::State {
  Settings settings;
  Signal changed;
  FairQueue<Place*> waiting;
  std::vector<Place*> with_turn = {};

  [[nodiscard]] std::size_t size() const { return waiting.size() + with_turn.size(); }
  [[nodiscard]] bool isFull(std::size_t line) const {
    const auto first = std::count_if(with_turn.begin(), with_turn.end(),
                                     [](const Place* place) { return place->line_ == 0; });
    const std::size_t later = size() - waiting.waitingIn(0) - static_cast<std::size_t>(first);
    return size() >= settings.places || (line > 0 && later >= settings.places_of_later_lines);
  }
  void grantTurns() {
    const auto may = [this](const std::string& who) {
      return std::none_of(with_turn.begin(), with_turn.end(),
                          [&](const Place* place) { return place->who_ == who; });
    };
    while (with_turn.size() < settings.at_once) {
      const auto next = waiting.take(may);
      if (!next) return;
      assert(!next->item->has_turn_ && !next->item->is_displaced_);
      next->item->has_turn_ = true;
      with_turn.push_back(next->item);
    }
  }
};

TurnQueue::TurnQueue(asio::any_io_executor executor, Settings settings)
    : state_(new State{settings, Signal(std::move(executor)), FairQueue<Place*>(settings.lines)}) {}

std::size_t TurnQueue::size() const {
  return state_->size();
}

std::size_t TurnQueue::waiting() const {
  return state_->waiting.size();
}

std::unique_ptr<TurnQueue::Place> TurnQueue::join(const std::string& who, std::size_t line) {
  if (state_->isFull(line)) {
    const auto displaced = state_->waiting.makeRoomFor(who, line);
    if (!displaced) return nullptr;
    (*displaced)->is_displaced_ = true;
    state_->changed.notify();
  }
  std::unique_ptr<Place> place(new Place(state_, who, line));
  state_->waiting.put(who, place.get(), line);
  state_->grantTurns();
  return place;
}

TurnQueue::Place::~Place() {
  if (is_displaced_) return;
  if (!has_turn_) {
    state_->waiting.remove(who_, line_, this);
    return;
  }
  std::erase(state_->with_turn, this);
  state_->grantTurns();
  state_->changed.notify();
}

std::string LoginQueue::ownerOf(std::string_view address) {
  constexpr std::string_view kV6Key = "v6/64 ";  // then the first 8 bytes (Admission::keyOf)
  constexpr std::size_t kV6OwnerBytes = 6;
  return std::string(address.starts_with(kV6Key) ? address.substr(0, kV6Key.size() + kV6OwnerBytes)
                                                 : address);
}

Task<> TurnQueue::Place::changed() const {
  return state_->changed.wait();
}

Task<std::unique_ptr<TurnQueue::Place>> TurnQueue::untilTurn(std::unique_ptr<Place> place) {
  while (!place->hasTurn()) co_await place->changed();
  co_return place;
}

}  // namespace needlelab
