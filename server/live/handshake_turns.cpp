#include "server/live/handshake_turns.h"

#include <algorithm>
#include <tuple>

namespace needlelab {

void HandshakeTurns::came(std::uint64_t id, const std::string& address, bool known) {
  Address& here = addresses_[address];
  here.known = known;
  here.waiting.push_back(id);
  address_of_.emplace(id, address);
}

std::optional<std::uint64_t> HandshakeTurns::next(std::int64_t now_ns) {
  freeExpired(now_ns);
  if (turns_ >= settings_.at_once) return std::nullopt;
  for (const bool known : {true, false}) {
    Address* const address = nextAddress(known);
    if (address == nullptr || !makeRoomFor(*address)) continue;
    const std::uint64_t id = address->waiting.back();
    address->waiting.pop_back();
    address->computing.push_back(id);
    ++turns_;
    return id;
  }
  return std::nullopt;
}

void HandshakeTurns::answered(std::uint64_t id, std::int64_t now_ns) {
  const auto found = address_of_.find(id);
  if (found == address_of_.end()) return;
  Address& address = addresses_.at(found->second);
  if (std::erase(address.computing, id) == 0) return;
  --turns_;
  address.answered.push_back({id, now_ns + std::chrono::nanoseconds(settings_.patience).count(), false});
}

void HandshakeTurns::left(std::uint64_t id) {
  const auto found = address_of_.find(id);
  if (found == address_of_.end()) return;
  const auto address = addresses_.find(found->second);
  Address& here = address->second;
  turns_ -= std::erase(here.computing, id);
  std::erase(here.waiting, id);
  const auto place = std::find_if(here.answered.begin(), here.answered.end(),
                                  [id](const Place& one) { return one.id == id; });
  if (place != here.answered.end()) {
    if (place->given_away) --here.given_away;
    here.answered.erase(place);
  }
  address_of_.erase(found);
  if (here.waiting.empty() && here.begun() == 0) addresses_.erase(address);
}

std::optional<std::int64_t> HandshakeTurns::nextAt() const {
  std::optional<std::int64_t> first;
  if (waiting() == 0) return first;
  for (const auto& [name, address] : addresses_) {
    if (address.answered.empty()) continue;
    const std::int64_t until_ns = address.answered.front().until_ns;
    first = std::min(first.value_or(until_ns), until_ns);
  }
  return first;
}

std::size_t HandshakeTurns::waiting() const {
  std::size_t count = 0;
  for (const auto& [name, address] : addresses_) count += address.waiting.size();
  return count;
}

std::size_t HandshakeTurns::places(bool known) const {
  std::size_t count = 0;
  for (const auto& [name, address] : addresses_)
    if (address.known == known) count += address.places();
  return count;
}

void HandshakeTurns::freeExpired(std::int64_t now_ns) {
  for (auto at = addresses_.begin(); at != addresses_.end();) {
    Address& address = at->second;
    while (!address.answered.empty() && address.answered.front().until_ns <= now_ns) {
      address_of_.erase(address.answered.front().id);
      if (address.answered.front().given_away) --address.given_away;
      address.answered.pop_front();
    }
    at = address.waiting.empty() && address.begun() == 0 ? addresses_.erase(at) : std::next(at);
  }
}

/// The address with the fewest places: if there is no room for it, there is none for any other. Of several,
/// the one with the newest connection.
HandshakeTurns::Address* HandshakeTurns::nextAddress(bool known) {
  Address* best = nullptr;
  for (auto& [name, address] : addresses_) {
    if (address.known != known || address.waiting.empty() || address.begun() >= settings_.places_of_address)
      continue;
    if (best == nullptr || std::tuple(address.places(), best->waiting.back()) <
                               std::tuple(best->places(), address.waiting.back()))
      best = &address;
  }
  return best;
}

bool HandshakeTurns::makeRoomFor(const Address& address) {
  if (places(address.known) < (address.known ? settings_.places_of_known : settings_.places)) return true;
  Address* greediest = nullptr;
  std::size_t most = address.places();
  for (auto& [name, other] : addresses_) {
    // what is computed now ends by itself: its place cannot be taken away
    if (other.known != address.known || other.places() <= most || other.places() == other.computing.size())
      continue;
    greediest = &other;
    most = other.places();
  }
  if (greediest == nullptr) return false;
  const auto oldest = std::find_if(greediest->answered.begin(), greediest->answered.end(),
                                   [](const Place& place) { return !place.given_away; });
  oldest->given_away = true;
  ++greediest->given_away;
  return true;
}

}  // namespace needlelab
