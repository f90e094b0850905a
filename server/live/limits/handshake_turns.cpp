#include "server/live/limits/handshake_turns.h"

#include <chrono>

namespace needlelab {

void HandshakeTurns::came(std::uint64_t id, const std::string& address, bool known) {
  waiting_[known].add(address, id);
}

std::optional<std::uint64_t> HandshakeTurns::next(std::int64_t now_ns) {
  for (; !answered_.empty() && answered_.front().first <= now_ns; answered_.pop_front())
    forget(answered_.front().second);
  if (turns() >= settings_.at_once) return std::nullopt;
  for (const bool known : {true, false}) {
    const std::string* const next = nextAddress(known);
    if (next == nullptr || !makeRoomFor(*next, known)) continue;
    const std::string address = *next;
    const std::uint64_t id = *waiting_[known].newestOf(address);
    waiting_[known].remove(id);
    places_[known].add(address, id);
    begun_.add(address, id);
    computing_.insert(id);
    return id;
  }
  return std::nullopt;
}

void HandshakeTurns::answered(std::uint64_t id, std::int64_t now_ns) {
  if (computing_.erase(id) > 0)
    answered_.emplace_back(now_ns + std::chrono::nanoseconds(settings_.patience).count(), id);
}

void HandshakeTurns::left(std::uint64_t id) {
  if (computing_.erase(id) == 0)
    std::erase_if(answered_, [id](const auto& place) { return place.second == id; });
  forget(id);
}

void HandshakeTurns::forget(std::uint64_t id) {
  for (const bool known : {true, false}) {
    waiting_[known].remove(id);
    places_[known].remove(id);
  }
  begun_.remove(id);
}

std::optional<std::int64_t> HandshakeTurns::nextAt() const {
  if (waiting() == 0 || answered_.empty()) return std::nullopt;
  return answered_.front().first;
}

/// The address with the fewest places; on a tie, the one with the newest connection.
const std::string* HandshakeTurns::nextAddress(bool known) const {
  const std::string* best = nullptr;
  std::pair<std::size_t, std::uint64_t> least;
  for (const auto& [address, ids] : waiting_[known].owners()) {
    if (begun_.of(address) >= settings_.places_of_address) continue;
    const std::pair rank(places_[known].of(address), UINT64_MAX - *waiting_[known].newestOf(address));
    if (best != nullptr && rank >= least) continue;
    best = &address;
    least = rank;
  }
  return best;
}

bool HandshakeTurns::makeRoomFor(const std::string& address, bool known) {
  FairPlaces<std::string>& places = places_[known];
  if (places.size() < (known ? settings_.places_of_known : settings_.places)) return true;
  const auto oldest =
      places.oldestOfTheGreediest(places.of(address), [](const std::string&) { return true; });
  if (oldest) places.remove(*oldest);
  return oldest.has_value();
}

}  // namespace needlelab
