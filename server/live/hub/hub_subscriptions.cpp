// Start and end of viewers' subscriptions.
#include <fmt/core.h>
#include <cassert>
#include <cmath>
#include <utility>

#include "server/live/hub/hub.h"

namespace needlelab {

template <typename Act>
void Hub::forEachOfSession(const std::string& session_id, Act act) {
  const auto found = stations_by_session_.find(session_id);
  if (found == stations_by_session_.end()) return;
  for (Station* station : found->second) {
    ++looked_at_;
    act(*station);
  }
}

std::optional<pb::Refusal> Hub::subscribe(HubPeer& viewer, const pb::Subscribe& wanted, std::int64_t now_ns) {
  const auto refuse = [](pb::Refusal::Reason reason, std::string text) {
    return makeRefusal(reason, std::move(text));
  };
  if (!std::isfinite(wanted.rate_hz()) || wanted.rate_hz() < 0 || wanted.rate_hz() > 1e6) {
    return refuse(pb::Refusal::INVALID,
                  fmt::format("subscribe.rate_hz {:f} is not in [0, 1e6]", wanted.rate_hz()));
  }
  if (wanted.station().size() > 256 || (!wanted.session_id().empty() && wanted.session_id().size() != 16)) {
    return refuse(pb::Refusal::INVALID, "subscribe.station is at most 256 bytes, session_id 16 or none");
  }
  if (wanted.station().find('\0') != std::string::npos)
    return refuse(pb::Refusal::INVALID, "subscribe.station has a byte 0, which no station's name has");
  if (!wanted.station().empty() && !wanted.session_id().empty()) {
    return refuse(pb::Refusal::INVALID, "subscribe: either a station or a session, not both");
  }
  const auto known_viewer = viewers_.find(&viewer);
  const std::string account = viewer.account();
  const auto counted = subscriptions_of_.find(account);
  std::size_t held = counted == subscriptions_of_.end() ? 0 : counted->second;
  if (known_viewer != viewers_.end()) {
    const Viewer& mine = known_viewer->second;
    if (mine.by_number.contains(wanted.subscription())) {
      return refuse(pb::Refusal::CONFLICT,
                    fmt::format("subscription {} exists already", wanted.subscription()));
    }
    const auto& same_kind = wanted.session_id().empty() ? mine.by_station : mine.by_session;
    const auto same = same_kind.find(wanted.session_id().empty() ? wanted.station() : wanted.session_id());
    if (same != same_kind.end()) {
      return refuse(pb::Refusal::CONFLICT,
                    fmt::format("subscription {} watches the same already", same->second));
    }
    if (account.empty()) held = mine.by_number.size();
  }
  if (held >= settings_.max_subscriptions) {
    return refuse(pb::Refusal::TOO_LARGE, fmt::format("an account has at most {} subscriptions, by all of "
                                                      "its connections together: end one of them first",
                                                      settings_.max_subscriptions));
  }

  auto owned = std::make_unique<Subscription>();
  Subscription& subscription = *owned;
  subscription.viewer = &viewer;
  subscription.number = wanted.subscription();
  subscription.station = wanted.station();
  subscription.session_id = wanted.session_id();
  const bool is_overview = wanted.station().empty() && wanted.session_id().empty();
  subscription.rate_hz =
      is_overview || wanted.rate_hz() == 0 ? wanted.rate_hz() : reducedRateOf(wanted.rate_hz());
  Viewer& mine = viewers_[&viewer];
  mine.account = account;
  mine.by_number.emplace(subscription.number, std::move(owned));
  if (subscription.session_id.empty())
    mine.by_station.emplace(subscription.station, subscription.number);
  else
    mine.by_session.emplace(subscription.session_id, subscription.number);
  if (!account.empty()) ++subscriptions_of_[account];
  assert(mine.by_number.size() == mine.by_station.size() + mine.by_session.size());

  pb::Envelope answer;
  answer.mutable_subscribed()->set_subscription(wanted.subscription());
  viewer.sendControl(answer);

  if (is_overview) {
    overviews_.push_back(&subscription);
    std::size_t bytes = 0;
    for (auto& [name, station] : stations_) {
      ++looked_at_;
      if (station.peer == nullptr) continue;
      // not more at once than a viewer's queue can hold; the other statuses follow with their next lines
      if ((bytes += station.status.ByteSizeLong()) > kMaxStatusBytes) break;
      sendStatus(viewer, station.status);
      subscription.last_line_ns[&station] = now_ns;
    }
    return std::nullopt;
  }
  if (!subscription.session_id.empty()) {
    by_session_[subscription.session_id].push_back(&subscription);
    forEachOfSession(subscription.session_id, [&](Station& station) {
      sendStatus(viewer, station.status);
      refreshWatch(station);
    });
    return std::nullopt;
  }
  const auto found = stations_.find(subscription.station);
  if (found == stations_.end()) {
    sendStatus(viewer, offlineStatus(subscription.station));
    return std::nullopt;
  }
  Station& station = found->second;
  ++looked_at_;
  station.watchers.push_back(&subscription);
  sendStatus(viewer, station.status);
  refreshWatch(station);
  return std::nullopt;
}

std::optional<pb::Refusal> Hub::unsubscribe(HubPeer& viewer, std::uint32_t subscription) {
  const auto mine = viewers_.find(&viewer);
  if (mine == viewers_.end() || !mine->second.by_number.contains(subscription)) {
    return makeRefusal(pb::Refusal::NOT_FOUND, fmt::format("no subscription {}", subscription));
  }
  Viewer& all = mine->second;
  auto owned = std::move(all.by_number.extract(subscription).mapped());
  if (owned->session_id.empty())
    all.by_station.erase(owned->station);
  else
    all.by_session.erase(owned->session_id);
  assert(all.by_number.size() == all.by_station.size() + all.by_session.size());
  remove(all, std::move(owned));
  if (all.by_number.empty()) viewers_.erase(mine);
  return std::nullopt;
}

void Hub::detachViewer(const HubPeer& viewer) {
  const auto mine = viewers_.find(&viewer);
  if (mine == viewers_.end()) return;
  Viewer all = std::move(mine->second);
  viewers_.erase(mine);
  for (auto& [number, subscription] : all.by_number) remove(all, std::move(subscription));
}

void Hub::remove(const Viewer& of, std::unique_ptr<Subscription> subscription) {
  Subscription* const gone = subscription.get();
  assert(gone != nullptr);
  if (const auto counted = subscriptions_of_.find(of.account); counted != subscriptions_of_.end()) {
    if (--counted->second == 0) subscriptions_of_.erase(counted);
  }
  if (!gone->session_id.empty()) {
    const auto found = by_session_.find(gone->session_id);
    assert(found != by_session_.end());
    std::erase(found->second, gone);
    if (found->second.empty()) by_session_.erase(found);
    forEachOfSession(gone->session_id, [this](Station& station) { refreshWatch(station); });
    return;
  }
  if (gone->station.empty()) {
    std::erase(overviews_, gone);
    return;
  }
  const auto found = stations_.find(gone->station);
  if (found == stations_.end()) return;  // it has not been online since
  ++looked_at_;
  std::erase(found->second.watchers, gone);
  refreshWatch(found->second);
  forgetIfUnused(gone->station);
}

std::size_t Hub::subscriptions() const {
  std::size_t sum = 0;
  for (const auto& [peer, viewer] : viewers_) sum += viewer.by_number.size();
  return sum;
}

}  // namespace needlelab
