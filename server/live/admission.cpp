#include "server/live/admission.h"

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <tuple>

#include "common/wire/asio.h"

namespace needlelab {

std::string Admission::keyOf(const std::string& host) {
  std::string text = host;
  if (text.size() > 1 && text.front() == '[' && text.back() == ']') text = text.substr(1, text.size() - 2);
  boost::system::error_code error;
  const auto address = asio::ip::make_address(text, error);
  if (error || address.is_v4()) return text;
  const auto v6 = address.to_v6();
  if (v6.is_v4_mapped()) return asio::ip::make_address_v4(asio::ip::v4_mapped, v6).to_string();
  const auto bytes = v6.to_bytes();
  return "v6/64 " + std::string(bytes.begin(), bytes.begin() + 8);
}

double Admission::leftOf(const Address& address, std::int64_t now_ns) const {
  const double leaked =
      static_cast<double>(now_ns - address.at_ns) / (1e6 * static_cast<double>(settings_.refill.count()));
  return std::max(0.0, address.charges - leaked);
}

Admission::Address& Admission::addressOf(const std::string& key, std::int64_t now_ns) {
  if (addresses_.size() >= settings_.max_addresses && !addresses_.contains(key)) {
    std::erase_if(addresses_, [&](const auto& entry) {
      return entry.second.all() == 0 && leftOf(entry.second, now_ns) <= 0;
    });
    // still full: drop the addresses with the fewest charges, which lose the least
    if (addresses_.size() >= settings_.max_addresses) {
      std::erase_if(addresses_, [&](const auto& entry) {
        return entry.second.all() == 0 && leftOf(entry.second, now_ns) < settings_.charges_at_once / 2;
      });
    }
  }
  Address& address = addresses_[key];
  address.charges = leftOf(address, now_ns);
  address.at_ns = now_ns;
  return address;
}

bool Admission::knows(const std::string& key, std::int64_t now_ns) const {
  const auto found = known_.find(key);
  return found != known_.end() &&
         now_ns - found->second <= std::chrono::nanoseconds(settings_.known_for).count();
}

void Admission::remember(const std::string& key, std::int64_t now_ns) {
  if (known_.size() >= settings_.max_known && !known_.contains(key)) {
    known_.erase(std::min_element(known_.begin(), known_.end(),
                                  [](const auto& a, const auto& b) { return a.second < b.second; }));
  }
  known_[key] = now_ns;
}

std::optional<std::uint64_t> Admission::oldestOf(const std::string& key) const {
  for (const auto& [id, stranger] : strangers_)
    if (stranger.address == key) return id;
  return std::nullopt;
}

std::optional<std::uint64_t> Admission::oldestOfTheGreediest(bool known) const {
  // compare the names as well: of two equal addresses, always the same one gives way until it has fewer
  // connections
  const auto greediest =
      std::max_element(addresses_.begin(), addresses_.end(), [known](const auto& a, const auto& b) {
        return std::tie(a.second.strangers[known], a.first) < std::tie(b.second.strangers[known], b.first);
      });
  if (greediest == addresses_.end() || greediest->second.strangers[known] == 0) return std::nullopt;
  for (const auto& [id, stranger] : strangers_)
    if (stranger.known == known && stranger.address == greediest->first) return id;
  return std::nullopt;
}

bool Admission::isFullFor(bool known) const {
  return connections() >= settings_.max_connections || strangers_.size() >= settings_.max_strangers ||
         (!known && strangers_of_unknown_ >= settings_.max_strangers_of_unknown);
}

Admission::Arrival Admission::arrive(std::uint64_t id, const std::string& host, std::int64_t now_ns) {
  const std::string key = keyOf(host);
  const bool known = knows(key, now_ns);
  Arrival arrival;
  Address& address = addressOf(key, now_ns);
  if (address.charges + 1 > (known ? settings_.charges_at_once_of_known : settings_.charges_at_once)) {
    arrival.answer = Answer::kTooMany;
    return arrival;
  }
  if (address.all() >= settings_.strangers_of_address) {
    arrival.gives_way = oldestOf(key);
  } else if (isFullFor(known)) {
    arrival.gives_way = oldestOfTheGreediest(false);
    if (!arrival.gives_way && known) arrival.gives_way = oldestOfTheGreediest(true);
    if (!arrival.gives_way) {
      arrival.answer = Answer::kFull;
      return arrival;
    }
  }
  if (arrival.gives_way) left(*arrival.gives_way);
  address.charges += 1;
  ++address.strangers[known];
  if (!known) ++strangers_of_unknown_;
  strangers_.emplace(id, Stranger{key, known});
  return arrival;
}

Admission::Arrival Admission::arriveFromProxy(std::uint64_t id) {
  Arrival arrival;
  if (connections() >= settings_.max_connections) {
    arrival.gives_way = oldestOfTheGreediest(false);
    if (!arrival.gives_way) arrival.gives_way = oldestOfTheGreediest(true);
    if (!arrival.gives_way) {
      arrival.answer = Answer::kFull;
      return arrival;
    }
    left(*arrival.gives_way);
  }
  of_proxies_.insert(id);
  return arrival;
}

bool Admission::isFullFor(const Account& account) const {
  const auto share = [this](std::size_t one_in) {
    return one_in == 0 ? 0 : settings_.max_connections / one_in;
  };
  const std::size_t places = settings_.max_connections - share(settings_.newcomers_one_in);
  return settled() >= places || (!account.station && people_ >= places - share(settings_.stations_one_in));
}

std::size_t Admission::connectionsOf(const Account& account) const {
  const auto found = accounts_.find(account);
  return found == accounts_.end() ? 0 : found->second.size();
}

std::optional<std::uint64_t> Admission::idlestFor(const Account& newcomer) const {
  const std::size_t with_new = connectionsOf(newcomer) + 1;
  auto greediest = accounts_.find(newcomer);
  std::size_t most = with_new;
  for (auto other = accounts_.begin(); other != accounts_.end(); ++other) {
    // the reserve is the stations': they give no place to a person
    if (other->second.size() <= most || (other->first.station && !newcomer.station)) continue;
    greediest = other;
    most = other->second.size();
  }
  if (greediest == accounts_.end()) return std::nullopt;
  return greediest->second.begin()->second;
}

Admission::Arrival Admission::loggedIn(std::uint64_t id, const Account& account, std::int64_t now_ns) {
  Arrival arrival;
  const auto before = logged_in_.find(id);
  const bool inside = before != logged_in_.end();
  if (inside && before->second.account == account) {
    used(id);
    return arrival;
  }
  const auto stranger = strangers_.find(id);
  if (!inside && stranger == strangers_.end()) return arrival;
  if (connectionsOf(account) >= settings_.connections_of_account) {
    arrival.gives_way = accounts_.at(account).begin()->second;
  } else if (!inside && isFullFor(account)) {
    arrival.gives_way = idlestFor(account);
    if (!arrival.gives_way) {
      arrival.answer = Answer::kFull;
      return arrival;
    }
  }
  if (!inside) {
    const std::string key = stranger->second.address;
    Address& address = addressOf(key, now_ns);
    address.charges = std::max(0.0, address.charges - 1);
    remember(key, now_ns);
  }
  if (arrival.gives_way) left(*arrival.gives_way);
  left(id);
  logged_in_.emplace(id, LoggedIn{account, ++turn_});
  accounts_[account].emplace(turn_, id);
  if (!account.station) ++people_;
  return arrival;
}

void Admission::used(std::uint64_t id) {
  const auto found = logged_in_.find(id);
  if (found == logged_in_.end()) return;
  auto& theirs = accounts_.at(found->second.account);
  theirs.erase(found->second.used);
  found->second.used = ++turn_;
  theirs.emplace(turn_, id);
}

void Admission::left(std::uint64_t id) {
  if (of_proxies_.erase(id) > 0) return;
  if (const auto inside = logged_in_.find(id); inside != logged_in_.end()) {
    const auto theirs = accounts_.find(inside->second.account);
    if (!theirs->first.station) --people_;
    theirs->second.erase(inside->second.used);
    if (theirs->second.empty()) accounts_.erase(theirs);
    logged_in_.erase(inside);
    return;
  }
  const auto found = strangers_.find(id);
  if (found == strangers_.end()) return;
  const Stranger& stranger = found->second;
  if (const auto address = addresses_.find(stranger.address); address != addresses_.end())
    --address->second.strangers[stranger.known];
  if (!stranger.known) --strangers_of_unknown_;
  strangers_.erase(found);
}

}  // namespace needlelab
