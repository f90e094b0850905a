// What subscriptions cost the hub, and how many each peer may hold.
#include <gtest/gtest.h>

#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "server/live/hub/hub.h"

namespace needlelab {
namespace {

/// A connection of an account.
struct Watcher : HubPeer {
  explicit Watcher(std::string of = {}) : name(std::move(of)) {}
  std::string name;
  std::vector<pb::Envelope> control;
  void sendControl(const pb::Envelope& envelope) override { control.push_back(envelope); }
  void sendLive(Frame, bool) override {}
  [[nodiscard]] std::string account() const override { return name; }

  /// A station's newest status.
  [[nodiscard]] pb::StationStatus statusOf(const std::string& station) const {
    pb::StationStatus found;
    for (const pb::Envelope& envelope : control)
      if (envelope.station_status().station() == station) found = envelope.station_status();
    return found;
  }
};

pb::Subscribe watchStation(std::uint32_t number, const std::string& station) {
  pb::Subscribe wanted;
  wanted.set_subscription(number);
  wanted.set_station(station);
  return wanted;
}

pb::Subscribe watchSession(std::uint32_t number, const std::string& id) {
  pb::Subscribe wanted;
  wanted.set_subscription(number);
  wanted.set_session_id(id);
  return wanted;
}

/// 16 bytes that end with the number.
std::string numberedSession(std::uint32_t number) {
  const std::string text = std::to_string(number);
  return std::string(16 - text.size(), 's') + text;
}

/// Subscribes to invented names until the limit, then stops.
std::uint32_t inventNames(Hub& hub, Watcher& viewer, const std::string& prefix) {
  for (std::uint32_t n = 1;; ++n)
    if (hub.subscribe(viewer, watchStation(n, prefix + std::to_string(n)), 0)) return n - 1;
}

bool toldWatched(const Watcher& station) {
  bool watched = false;
  for (const pb::Envelope& envelope : station.control)
    if (envelope.has_watch_state()) watched = envelope.watch_state().watched();
  return watched;
}

// The finding: 24,000 invented names, then 3,800 sessions that each scanned all of them on the network's
// thread.
TEST(HubSubscriptions, inventedNamesAndSessionsCostOthersNothing) {
  Hub hub;
  std::deque<Watcher> stations(200);
  for (std::size_t i = 0; i < stations.size(); ++i)
    hub.attachStation("bench-" + std::to_string(i), stations[i]);
  {
    std::deque<Watcher> crowd;
    for (int k = 0; k < 12; ++k) {
      crowd.emplace_back("person " + std::to_string(k));
      EXPECT_EQ(inventNames(hub, crowd.back(), "n" + std::to_string(k) + "-"), 2000u);
    }
    EXPECT_EQ(hub.stationsKnown(), 200u) << "an invented name is not a station";
    EXPECT_EQ(hub.subscriptions(), 24'000u);
    Watcher first("ines"), second("mara");
    for (std::uint32_t n = 1; n < 1900; ++n) {
      ASSERT_FALSE(hub.subscribe(first, watchSession(n, numberedSession(n)), 0));
      ASSERT_FALSE(hub.subscribe(second, watchSession(n, numberedSession(n + 5000)), 0));
    }
    EXPECT_EQ(hub.stationsLookedAt(), 0u) << "no station has one of these sessions";
    hub.detachViewer(first);
    hub.detachViewer(second);
    for (const Watcher& viewer : crowd) hub.detachViewer(viewer);
    EXPECT_EQ(hub.stationsLookedAt(), 0u);
  }
  EXPECT_EQ(hub.stationsKnown(), 200u);
  EXPECT_EQ(hub.subscriptions(), 0u);
}

TEST(HubSubscriptions, aNameWithAByteThatNoNameHasIsRefused) {
  Hub hub;
  Watcher viewer("ines");
  const auto refusal = hub.subscribe(viewer, watchStation(1, std::string("x\0y", 3)), 0);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->reason(), pb::Refusal::INVALID);
  EXPECT_EQ(hub.subscriptions(), 0u);
}

TEST(HubSubscriptions, aSessionCostsTheStationsThatRunIt) {
  Hub hub;
  std::deque<Watcher> stations(300);
  for (std::uint32_t i = 0; i < 300; ++i) {
    hub.attachStation("bench-" + std::to_string(i), stations[i]);
    hub.onSession("bench-" + std::to_string(i), numberedSession(i));
  }
  Watcher ines("ines");
  for (std::uint32_t i = 0; i < 300; ++i)
    ASSERT_FALSE(hub.subscribe(ines, watchSession(i, numberedSession(i)), 0));
  EXPECT_EQ(hub.stationsLookedAt(), 300u) << "one each";
  for (const Watcher& station : stations) EXPECT_TRUE(toldWatched(station));
  hub.detachViewer(ines);
  EXPECT_EQ(hub.stationsLookedAt(), 600u);
  for (const Watcher& station : stations) EXPECT_FALSE(toldWatched(station));
}

TEST(HubSubscriptions, aSessionIsFoundWhereItRunsNow) {
  Hub hub;
  Watcher one, two, ines("ines");
  hub.attachStation("bench-1", one);
  hub.attachStation("bench-2", two);
  hub.onSession("bench-1", numberedSession(7));
  hub.onSession("bench-1", numberedSession(8));
  hub.onSession("bench-2", numberedSession(7));
  ASSERT_FALSE(hub.subscribe(ines, watchSession(1, numberedSession(7)), 0));
  EXPECT_FALSE(toldWatched(one)) << "it has gone on to another session";
  EXPECT_TRUE(toldWatched(two));
  Watcher again;
  hub.attachStation("bench-2", again);
  EXPECT_FALSE(toldWatched(again)) << "it has not said yet which session it is in";
  hub.onSession("bench-2", numberedSession(7));
  EXPECT_TRUE(toldWatched(again));
  hub.detachStation("bench-2", again);
  ASSERT_FALSE(hub.subscribe(ines, watchSession(2, numberedSession(8)), 0));
  EXPECT_TRUE(toldWatched(one));
}

TEST(HubSubscriptions, anInstructorWatchesTwoHundredStationsBeforeTheyConnect) {
  Hub hub;
  Watcher ines("ines");
  const auto name = [](std::uint32_t i) { return "bench-" + std::to_string(i); };
  for (std::uint32_t i = 0; i < 200; ++i) {
    ASSERT_FALSE(hub.subscribe(ines, watchStation(i, name(i)), 0));
    EXPECT_EQ(ines.control.back().station_status().station(), name(i));
    EXPECT_FALSE(ines.control.back().station_status().online());
  }
  EXPECT_EQ(hub.stationsKnown(), 0u);
  std::deque<Watcher> stations(200);
  for (std::uint32_t i = 0; i < 200; ++i) {
    hub.attachStation(name(i), stations[i]);
    EXPECT_TRUE(toldWatched(stations[i]));
    EXPECT_TRUE(ines.statusOf(name(i)).online());
  }
  for (std::uint32_t i = 0; i < 200; ++i) hub.detachStation(name(i), stations[i]);
  EXPECT_FALSE(ines.statusOf(name(7)).online());
  EXPECT_EQ(hub.stationsKnown(), 200u) << "offline, but watched";
  Watcher back;
  hub.attachStation(name(7), back);
  EXPECT_TRUE(toldWatched(back));
  hub.detachStation(name(7), back);
  hub.detachViewer(ines);
  EXPECT_EQ(hub.stationsKnown(), 0u);
  EXPECT_EQ(hub.subscriptions(), 0u);
}

TEST(HubSubscriptions, anUnsubscribedWaiterIsNotNotified) {
  Hub hub;
  Watcher station, ines("ines");
  ASSERT_FALSE(hub.subscribe(ines, watchStation(1, "bench-1"), 0));
  ASSERT_FALSE(hub.subscribe(ines, watchStation(2, "bench-2"), 0)) << "it stays";
  ASSERT_FALSE(hub.unsubscribe(ines, 1));
  EXPECT_EQ(hub.subscriptions(), 1u);
  hub.attachStation("bench-1", station);
  EXPECT_FALSE(toldWatched(station));
  EXPECT_FALSE(ines.statusOf("bench-1").online());
  EXPECT_FALSE(hub.subscribe(ines, watchStation(1, "bench-1"), 0)) << "number and name are free again";
  EXPECT_TRUE(toldWatched(station));
}

TEST(HubSubscriptions, theBoundIsThatOfAnAccountOverAllItsConnections) {
  HubSettings settings;
  settings.max_subscriptions = 10;
  Hub hub(settings);
  Watcher here("ines"), there("ines"), other("mara");
  for (std::uint32_t n = 0; n < 6; ++n)
    ASSERT_FALSE(hub.subscribe(here, watchStation(n, "s" + std::to_string(n)), 0));
  for (std::uint32_t n = 0; n < 4; ++n)
    ASSERT_FALSE(hub.subscribe(there, watchSession(n, numberedSession(n)), 0));
  for (Watcher* full : {&here, &there}) {
    const auto refusal = hub.subscribe(*full, watchStation(99, "s99"), 0);
    ASSERT_TRUE(refusal);
    EXPECT_EQ(refusal->reason(), pb::Refusal::TOO_LARGE);
    EXPECT_NE(refusal->text().find("at most 10 subscriptions"), std::string::npos) << refusal->text();
  }
  EXPECT_FALSE(hub.subscribe(other, watchStation(99, "s99"), 0)) << "others have their own";
  ASSERT_FALSE(hub.unsubscribe(there, 3));
  EXPECT_FALSE(hub.subscribe(here, watchStation(6, "s6"), 0));
  EXPECT_TRUE(hub.subscribe(here, watchStation(7, "s7"), 0));
  hub.detachViewer(there);
  for (std::uint32_t n = 7; n < 10; ++n)
    EXPECT_FALSE(hub.subscribe(here, watchStation(n, "s" + std::to_string(n)), 0));
  EXPECT_TRUE(hub.subscribe(here, watchStation(10, "s10"), 0));
}

}  // namespace
}  // namespace needlelab
