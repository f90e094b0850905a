#include "server/live/limits/admission.h"

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <cassert>

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

BucketRate Admission::chargesOf(bool known) const {
  return {known ? settings_.charges_at_once_of_known : settings_.charges_at_once,
          1000 / static_cast<double>(settings_.refill.count())};
}

std::optional<std::uint64_t> Admission::strangerToCut(bool also_known) const {
  const auto any = [](const std::string&) { return true; };
  const auto unknown = strangers_[false].oldestOfTheGreediest(0, any);
  return unknown || !also_known ? unknown : strangers_[true].oldestOfTheGreediest(0, any);
}

bool Admission::isFullFor(bool known) const {
  return connections() >= settings_.max_connections || strangers() >= settings_.max_strangers ||
         (!known && strangers_[false].size() >= settings_.max_strangers_of_unknown);
}

Admission::Arrival Admission::arrive(std::uint64_t id, const std::string& host, std::int64_t now_ns) {
  const std::string key = keyOf(host);
  const bool known = knows(key, now_ns);
  TokenBucket& charges = charges_.of(key, chargesOf(known), now_ns);
  if (!charges.has(1, now_ns)) return {Answer::kTooMany, {}};
  Arrival arrival;
  if (strangers_[false].of(key) + strangers_[true].of(key) >= settings_.strangers_of_address) {
    // of those, the ones that arrived while it was unknown are older
    arrival.displaced = strangers_[false].oldestOf(key);
    if (!arrival.displaced) arrival.displaced = strangers_[true].oldestOf(key);
  } else if (isFullFor(known)) {
    arrival.displaced = strangerToCut(known);
    if (!arrival.displaced) return {Answer::kFull, {}};
  }
  if (arrival.displaced) left(*arrival.displaced);
  charges.take(1, now_ns);
  strangers_[known].add(key, id);
  return arrival;
}

Admission::Arrival Admission::arriveFromProxy(std::uint64_t id) {
  Arrival arrival;
  if (connections() >= settings_.max_connections) {
    arrival.displaced = strangerToCut(true);
    if (!arrival.displaced) return {Answer::kFull, {}};
    left(*arrival.displaced);
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

Admission::Arrival Admission::loggedIn(std::uint64_t id, const Account& account, std::int64_t now_ns) {
  const Account* const before = accounts_.ownerOf(id);
  const std::string* address = strangers_[false].ownerOf(id);
  if (address == nullptr) address = strangers_[true].ownerOf(id);
  Arrival arrival;
  if (before == nullptr ? address == nullptr : *before == account) {
    used(id);
    return arrival;
  }
  if (accounts_.of(account) >= settings_.connections_of_account) {
    arrival.displaced = accounts_.oldestOf(account);
  } else if (before == nullptr && isFullFor(account)) {
    // the reserve belongs to stations: they do not give way to a person
    arrival.displaced = accounts_.oldestOfTheGreediest(
        accounts_.of(account) + 1, [&](const Account& other) { return account.station || !other.station; });
    if (!arrival.displaced) arrival.displaced = accounts_.oldestOf(account);
    if (!arrival.displaced) return {Answer::kFull, {}};
  }
  if (before == nullptr) {
    charges_.of(*address, chargesOf(true), now_ns).take(-1, now_ns);
    remember(*address, now_ns);
  }
  if (arrival.displaced) left(*arrival.displaced);
  left(id);
  accounts_.add(account, id);
  if (!account.station) ++people_;
  return arrival;
}

void Admission::used(std::uint64_t id) {
  accounts_.use(id);
}

void Admission::left(std::uint64_t id) {
  of_proxies_.erase(id);
  if (const Account* const account = accounts_.ownerOf(id); account != nullptr && !account->station) {
    assert(people_ > 0);
    --people_;
  }
  accounts_.remove(id);
  for (auto& strangers : strangers_) strangers.remove(id);
}

}  // namespace needlelab
