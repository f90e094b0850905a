#include "server/live/login_queue.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

namespace needlelab {
namespace {

using LoginLine = LoginQueue::Line;

/// Which line has the next of four turns.
constexpr LoginLine kCycle[] = {LoginLine::kKnownPerson, LoginLine::kKnownAddress, LoginLine::kKnownPerson,
                                LoginLine::kStranger};
/// From the best to the worst.
constexpr LoginLine kLinesInOrder[] = {LoginLine::kKnownPerson, LoginLine::kKnownAddress,
                                       LoginLine::kStranger};

constexpr std::string_view kV6Key = "v6/64 ";  // then the first 8 bytes (Admission::keyOf)
constexpr std::size_t kV6NetworkBytes = 6;

}  // namespace

struct LoginQueue::State {
  /// Network, address, name: each within the one before.
  static constexpr std::size_t kLevels = 3;
  using Path = std::array<std::string, kLevels>;
  struct Waiting {
    std::uint64_t id = 0;
    Line line = Line::kStranger;
    Path path;
    std::uint64_t arrived = 0;  // turns given before
  };

  Settings settings;
  std::function<void()> changed;
  std::vector<Waiting> waiting;  // in order of arrival; without the one whose turn it is
  std::optional<Waiting> turn;
  std::uint64_t next_id = 1, turns = 0;
  std::map<std::string, std::uint64_t> served;  // by key: its last turn; only keys that somebody waits with

  /// The key of a level includes the levels above, with their lengths: different paths have different keys.
  static std::string keyOf(const Path& path, Line line, std::size_t level) {
    std::string key = std::to_string(static_cast<int>(line));
    for (std::size_t i = 0; i <= level; ++i) key += " " + std::to_string(path[i].size()) + " " + path[i];
    return key;
  }

  [[nodiscard]] std::size_t count(Line line) const {
    const auto there = std::count_if(waiting.begin(), waiting.end(),
                                     [line](const Waiting& entry) { return entry.line == line; });
    return static_cast<std::size_t>(there) + (turn && turn->line == line ? 1u : 0u);
  }
  [[nodiscard]] std::size_t size() const { return waiting.size() + (turn ? 1u : 0u); }

  [[nodiscard]] bool isFull(Line line) const {
    const std::size_t unknown = size() - count(Line::kKnownPerson);
    return size() >= settings.places || (line != Line::kKnownPerson && unknown >= settings.places_of_unknown);
  }

  /// The last turn of a level, or the arrival, if it was later: a newcomer begins behind those who have
  /// waited longer, and does not profit from having been away.
  [[nodiscard]] std::uint64_t rank(const Waiting& entry, std::size_t level) const {
    const auto last = served.find(keyOf(entry.path, entry.line, level));
    return std::max(entry.arrived, last == served.end() ? 0 : last->second);
  }

  void giveTurn() {
    if (turn || waiting.empty()) return;
    const auto in = [this](Line line) { return count(line) > 0; };
    Line line = kCycle[turns % std::size(kCycle)];
    if (!in(line)) line = *std::find_if(std::begin(kLinesInOrder), std::end(kLinesInOrder), in);
    const auto order = [this](const Waiting& entry) {
      return std::tuple(rank(entry, 0), rank(entry, 1), rank(entry, 2), entry.id);
    };
    auto next = waiting.end();
    for (auto entry = waiting.begin(); entry != waiting.end(); ++entry) {
      if (entry->line == line && (next == waiting.end() || order(*entry) < order(*next))) next = entry;
    }
    turn = std::move(*next);
    waiting.erase(next);
    ++turns;
    for (std::size_t level = 0; level < kLevels; ++level) served[keyOf(turn->path, line, level)] = turns;
    forgetServed();
  }

  /// A key that nobody waits with is of no use: whoever comes with it next arrives after its last turn.
  void forgetServed() {
    std::map<std::string, std::uint64_t> kept;
    for (const Waiting& entry : waiting) {
      for (std::size_t level = 0; level < kLevels; ++level) {
        const auto found = served.find(keyOf(entry.path, entry.line, level));
        if (found != served.end()) kept.insert(*found);
      }
    }
    served = std::move(kept);
  }

  /// Of `entries`, those whose key of the level is the most frequent one.
  static std::vector<const Waiting*> greediest(const std::vector<const Waiting*>& entries,
                                               std::size_t level) {
    std::map<std::string, std::vector<const Waiting*>> groups;
    for (const Waiting* entry : entries) groups[keyOf(entry->path, entry->line, level)].push_back(entry);
    const auto most = std::max_element(groups.begin(), groups.end(), [](const auto& a, const auto& b) {
      return a.second.size() < b.second.size();
    });
    return most == groups.end() ? std::vector<const Waiting*>() : most->second;
  }

  /// The log-in that gives its place to a newcomer; nothing: the newcomer has no better claim than any.
  [[nodiscard]] std::optional<std::uint64_t> givesWay(Line line, const Path& path) const {
    std::vector<const Waiting*> entries;
    for (auto worse = std::rbegin(kLinesInOrder); *worse != line; ++worse) {
      for (const Waiting& entry : waiting)
        if (entry.line == *worse) entries.push_back(&entry);
      if (!entries.empty()) return newestOf(std::move(entries), 0);
    }
    for (const Waiting& entry : waiting)
      if (entry.line == line) entries.push_back(&entry);
    for (std::size_t level = 0; level < kLevels; ++level) {
      std::vector<const Waiting*> mine;
      const std::string key = keyOf(path, line, level);
      std::copy_if(entries.begin(), entries.end(), std::back_inserter(mine),
                   [&](const Waiting* entry) { return keyOf(entry->path, entry->line, level) == key; });
      if (auto most = greediest(entries, level); mine.size() + 1 < most.size())
        return newestOf(std::move(most), level + 1);
      entries = std::move(mine);
    }
    return std::nullopt;
  }

  static std::uint64_t newestOf(std::vector<const Waiting*> entries, std::size_t level) {
    for (; level < kLevels; ++level) entries = greediest(entries, level);
    return entries.back()->id;
  }

  bool remove(std::uint64_t id) {
    return std::erase_if(waiting, [id](const Waiting& entry) { return entry.id == id; }) > 0;
  }

  void leave(std::uint64_t id) {
    const bool had_turn = turn && turn->id == id;
    if (had_turn) {
      turn.reset();
      giveTurn();
    } else if (remove(id)) {
      forgetServed();
    }
    if (had_turn && changed) changed();
  }
};

LoginQueue::LoginQueue(Settings settings, std::function<void()> changed) : state_(std::make_shared<State>()) {
  state_->settings = settings;
  state_->changed = std::move(changed);
}

std::string LoginQueue::networkOf(std::string_view address) {
  if (address.starts_with(kV6Key)) return std::string(address.substr(0, kV6Key.size() + kV6NetworkBytes));
  const bool v4 = address.find(':') == std::string_view::npos;
  const std::size_t dot = v4 ? address.rfind('.') : std::string_view::npos;
  return std::string(address.substr(0, dot));
}

std::size_t LoginQueue::size() const {
  return state_->size();
}

std::optional<LoginQueue::Place> LoginQueue::join(Line line, const std::string& address,
                                                  const std::string& name) {
  State& state = *state_;
  const State::Path path = {networkOf(address), address, name};
  if (state.isFull(line)) {
    const auto gone = state.givesWay(line, path);
    if (!gone) return std::nullopt;
    state.remove(*gone);
    if (state.changed) state.changed();
  }
  const std::uint64_t id = state.next_id++;
  state.waiting.push_back({id, line, path, state.turns});
  state.giveTurn();
  return Place(state_, id);
}

LoginQueue::Place::Place(std::shared_ptr<State> state, std::uint64_t id)
    : state_(std::move(state)), id_(id) {}

LoginQueue::Place::Place(Place&& other) noexcept = default;

LoginQueue::Place::~Place() {
  if (state_) state_->leave(id_);
}

bool LoginQueue::Place::hasTurn() const {
  return state_->turn && state_->turn->id == id_;
}

bool LoginQueue::Place::gaveWay() const {
  return !hasTurn() && std::none_of(state_->waiting.begin(), state_->waiting.end(),
                                    [this](const State::Waiting& entry) { return entry.id == id_; });
}

}  // namespace needlelab
