#include "client/net/link/server_choice.h"

#include <algorithm>
#include <cassert>
#include <tuple>
#include <utility>

namespace needlelab {

ServerChoice::ServerChoice(const Endpoints& servers, std::uint64_t seed, TimeSource& time)
    : time_(time), random_(seed) {
  assert(!servers.empty());
  for (const Endpoint& endpoint : servers) servers_.push_back({endpoint, {Place{}}});
}

void ServerChoice::beginRound() {
  over_ = false;
  for (Server& server : servers_)
    for (Place& place : server.places) place.tried = false;
}

// the best place not tried yet
std::optional<ServerChoice::Spot> ServerChoice::best(std::optional<std::size_t> of_server) const {
  std::optional<Spot> found;
  const auto rank = [this](const Spot& spot) {
    return std::tuple(servers_[spot.server].places[spot.place].failed, good_ != spot, spot.server,
                      spot.place);
  };
  for (std::size_t s = 0; s < servers_.size(); ++s) {
    if (of_server && *of_server != s) continue;
    for (std::size_t p = 0; p < servers_[s].places.size(); ++p) {
      if (servers_[s].places[p].tried) continue;
      if (const Spot spot{s, p}; !found || rank(spot) < rank(*found)) found = spot;
    }
  }
  return found;
}

const Endpoint* ServerChoice::next() {
  now_.reset();
  const auto found = over_ ? std::nullopt : best(std::nullopt);
  if (!found) return nullptr;
  server_ = found->server;
  return &servers_[server_].endpoint;
}

// keeps what is known about addresses that still exist; appends new ones, shuffled within their family
void ServerChoice::learn(std::size_t server, const std::vector<Address>& found) {
  std::vector<Place>& known = servers_[server].places;
  const bool is_first = !known.front().address;
  const Place of_name = known.front();
  const std::optional<Address> good =
      good_ && good_->server == server ? known[good_->place].address : std::nullopt;
  std::vector<Place> places;
  const auto has = [](const std::vector<Place>& all, const Address& address) {
    return std::any_of(all.begin(), all.end(), [&](const Place& place) { return place.address == address; });
  };
  for (Place& place : known)
    if (place.address && std::find(found.begin(), found.end(), *place.address) != found.end())
      places.push_back(place);
  const std::size_t old = places.size();
  for (const Address& address : found) {
    if (places.size() == kMaxAddresses) break;
    if (has(places, address)) continue;
    // what happened while the name was unresolved counts for all of its addresses
    Place place = is_first ? of_name : Place{};
    place.address = address;
    places.push_back(place);
  }
  // std::shuffle differs between libraries
  for (std::size_t i = old; i < places.size(); ++i) {
    std::size_t end = i + 1;
    while (end < places.size() && places[end].address->is_v4() == places[i].address->is_v4()) ++end;
    std::swap(places[i], places[i + random_() % (end - i)]);
  }
  known = std::move(places);
  if (good_ && good_->server == server) {
    good_.reset();
    for (std::size_t p = 0; p < known.size(); ++p)
      if (good && known[p].address == good) good_ = Spot{server, p};
  }
}

ServerChoice::Address ServerChoice::take(const std::vector<Address>& found) {
  assert(!found.empty());
  std::optional<Address> taken;
  if (now_) taken = at(*now_).address;
  learn(server_, found);
  now_.reset();
  const std::vector<Place>& places = servers_[server_].places;
  for (std::size_t p = 0; p < places.size(); ++p)
    if (taken && places[p].address == taken) now_ = Spot{server_, p};
  if (!now_) now_ = best(server_);
  // the untried addresses may have been removed from the name
  if (!now_) now_ = Spot{server_, 0};
  at(*now_).tried = true;
  return *at(*now_).address;
}

void ServerChoice::fail(Place& place) {
  place.failed = ++failures_;
  place.failed_ns = time_.nowNs();
  place.tried = true;
}

void ServerChoice::failed() {
  if (now_) return fail(at(*now_));
  for (Place& place : servers_[server_].places)
    if (!place.tried) fail(place);
}

void ServerChoice::refused() {
  over_ = true;
}

void ServerChoice::welcomed() {
  if (!now_) return;
  at(*now_).failed = 0;
  good_ = now_;
}

void ServerChoice::lost() {
  if (now_) fail(at(*now_));
}

template <typename Which>
bool ServerChoice::anyOther(Which which) const {
  if (!now_) return false;
  const Server& here = servers_[now_->server];
  for (const Server& server : servers_)
    for (const Place& place : server.places) {
      if (&place == &here.places[now_->place]) continue;
      if (&server == &here && place.address->is_v4() != here.places[now_->place].address->is_v4()) continue;
      if (which(place)) return true;
    }
  return false;
}

bool ServerChoice::hasOther() const {
  return anyOther([](const Place&) { return true; });
}

bool ServerChoice::hasBetter() const {
  const std::int64_t now_ns = time_.nowNs();
  return anyOther(
      [now_ns](const Place& place) { return place.failed == 0 || now_ns - place.failed_ns >= kForgiven_ns; });
}

bool ServerChoice::several() const {
  return servers_.size() > 1 || servers_.front().places.size() > 1;
}

}  // namespace needlelab
