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
      return entry.second.strangers == 0 && leftOf(entry.second, now_ns) <= 0;
    });
    // still full: drop the addresses with the fewest charges, which lose the least
    if (addresses_.size() >= settings_.max_addresses) {
      std::erase_if(addresses_, [&](const auto& entry) {
        return entry.second.strangers == 0 && leftOf(entry.second, now_ns) < settings_.charges_at_once / 2;
      });
    }
  }
  Address& address = addresses_[key];
  address.charges = leftOf(address, now_ns);
  address.at_ns = now_ns;
  return address;
}

std::optional<std::uint64_t> Admission::oldestOfTheGreediest() const {
  // compare the names as well: of two equal addresses, always the same one gives way until it has fewer
  // connections
  const auto greediest =
      std::max_element(addresses_.begin(), addresses_.end(), [](const auto& a, const auto& b) {
        return std::tie(a.second.strangers, a.first) < std::tie(b.second.strangers, b.first);
      });
  if (greediest == addresses_.end() || greediest->second.strangers == 0) return std::nullopt;
  for (const auto& [id, key] : strangers_)
    if (key == greediest->first) return id;
  return std::nullopt;
}

Admission::Arrival Admission::arrive(std::uint64_t id, const std::string& host, std::int64_t now_ns) {
  const std::string key = keyOf(host);
  Arrival arrival;
  Address& address = addressOf(key, now_ns);
  if (address.charges + 1 > settings_.charges_at_once) {
    arrival.answer = Answer::kTooMany;
    return arrival;
  }
  if (strangers_.size() >= settings_.max_strangers || connections() >= settings_.max_connections) {
    arrival.gives_way = oldestOfTheGreediest();
    if (!arrival.gives_way) {
      arrival.answer = Answer::kFull;
      return arrival;
    }
    left(*arrival.gives_way);
  }
  address.charges += 1;
  ++address.strangers;
  strangers_.emplace(id, key);
  return arrival;
}

void Admission::loggedIn(std::uint64_t id, std::int64_t now_ns) {
  const auto found = strangers_.find(id);
  if (found == strangers_.end()) return;
  Address& address = addressOf(found->second, now_ns);
  address.charges = std::max(0.0, address.charges - 1);
  --address.strangers;
  strangers_.erase(found);
  known_.insert(id);
}

void Admission::left(std::uint64_t id) {
  if (known_.erase(id) > 0) return;
  const auto found = strangers_.find(id);
  if (found == strangers_.end()) return;
  if (const auto address = addresses_.find(found->second); address != addresses_.end())
    --address->second.strangers;
  strangers_.erase(found);
}

}  // namespace needlelab
