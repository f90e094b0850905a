#include "server/live/turn_queue.h"

#include <unordered_map>

namespace needlelab {
namespace {

constexpr std::string_view kV6Key = "v6/64 ";  // then the first 8 bytes (Admission::keyOf)
constexpr std::size_t kV6NetworkBytes = 6;

}  // namespace

struct TurnQueue::Member {
  FairQueue::Path path;
  std::size_t line = 0;
  std::uint64_t number = 0;  // in the queue
  bool has_turn = false;
};

struct TurnQueue::State {
  Settings settings;
  std::function<void()> changed;
  FairQueue waiting;  // its work owns the member that waits
  std::unordered_map<std::string, std::shared_ptr<const Member>> with_turn = {};  // by the first name

  [[nodiscard]] std::size_t size() const { return waiting.size() + with_turn.size(); }
  [[nodiscard]] bool isFull(std::size_t line) const {
    std::size_t first = waiting.waitingIn(0);
    for (const auto& [name, member] : with_turn) first += member->line == 0 ? 1 : 0;
    return size() >= settings.places || (line > 0 && size() - first >= settings.places_of_later_lines);
  }
  void giveTurns() {
    while (with_turn.size() < settings.at_once) {
      const auto next = waiting.takeOf([this](const std::string& who) { return !with_turn.contains(who); });
      if (!next.work) return;
      next.work();
    }
  }
  void tell() const {
    if (changed) changed();
  }
};

TurnQueue::TurnQueue(Settings settings, std::function<void()> changed)
    : state_(std::make_shared<State>(State{settings, std::move(changed), FairQueue(settings.cycle)})) {}

std::size_t TurnQueue::size() const {
  return state_->size();
}

std::size_t TurnQueue::waiting() const {
  return state_->waiting.size();
}

std::optional<TurnQueue::Place> TurnQueue::join(FairQueue::Path path, std::size_t line) {
  State& state = *state_;
  if (state.isFull(line)) {
    if (!state.waiting.makeRoomFor(path, line)) return std::nullopt;
    state.tell();
  }
  const auto member = std::make_shared<Member>(Member{std::move(path), line});
  FairQueue::Work turn = [&state, member] {
    member->has_turn = true;
    state.with_turn.emplace(member->path.front(), member);
  };
  member->number = state.waiting.put(member->path, std::move(turn), line);
  state.giveTurns();
  return Place(state_, member);
}

TurnQueue::Place::~Place() {
  const auto member = member_.lock();
  if (!member) return;
  if (!member->has_turn) {
    state_->waiting.remove(member->path, member->line, member->number);
    return;
  }
  state_->with_turn.erase(member->path.front());
  state_->giveTurns();
  state_->tell();
}

bool TurnQueue::Place::hasTurn() const {
  const auto member = member_.lock();
  return member && member->has_turn;
}

std::string LoginQueue::networkOf(std::string_view address) {
  if (address.starts_with(kV6Key)) return std::string(address.substr(0, kV6Key.size() + kV6NetworkBytes));
  const bool v4 = address.find(':') == std::string_view::npos;
  const std::size_t dot = v4 ? address.rfind('.') : std::string_view::npos;
  return std::string(address.substr(0, dot));
}

Task<PlacesInTurn::Place> PlacesInTurn::takeOf(TurnQueue queue, std::shared_ptr<Signal> given,
                                               std::string who) {
  auto place = std::make_shared<TurnQueue::Place>(*queue.join({std::move(who)}));
  while (!place->hasTurn()) co_await given->wait();
  co_return place;
}

}  // namespace needlelab
