// A thousand stations after an outage, in simulated time: how soon each reconnects, and how often all of them
// try.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <queue>
#include <utility>
#include <vector>

#include "client/net/link/server_choice.h"
#include "client/net/link/server_link.h"
#include "client/net/uplink/uplink.h"

namespace needlelab {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kStations = 1000;
constexpr double kProbe_ms = 1500;  // the default of Backoff::Settings::probe, written out
/// A station's waits between probes are uniform in [p/2, p]: 0.75 p on average.
constexpr double kProbesPerSecond = kStations / (0.75e-3 * kProbe_ms);

struct Outage {
  double listens_ms = 10'000;     ///< after the stations lost their connections
  double handshakes_per_s = 500;  ///< that the server completes, one after the other
  bool lesson_runs = true;
};

struct Herd {
  std::vector<double> tries_ms;    ///< of all stations, sorted
  std::vector<double> arrived_ms;  ///< tries that found the server listening, sorted
  std::vector<double> back_ms;     ///< log-ins after the server listens, sorted
};

Herd simulate(const Outage& outage) {
  const double patience_ms = static_cast<double>(ClientConfig{}.connect_timeout.count());
  std::vector<Backoff> waits;
  using Try = std::pair<double, std::size_t>;
  std::priority_queue<Try, std::vector<Try>, std::greater<>> due;
  const auto tryAgain = [&](double now_ms, std::size_t station, const LinkEnd& end) {
    const Retry retry = retryOfStation(end, outage.lesson_runs);
    const auto wait = retry == Retry::kProbe ? waits[station].nextProbe() : waits[station].next();
    due.emplace(now_ms + static_cast<double>(wait.count()), station);
  };
  LinkEnd lost, refused, overdue;
  lost.was_connected = lost.reached = true;
  refused.error = overdue.error = {ErrorCode::kUnavailable, ""};
  overdue.reached = true;
  for (std::size_t station = 0; station < kStations; ++station) {
    waits.emplace_back(station + 1, UplinkConfig{}.retry());
    tryAgain(0, station, lost);
  }
  Herd herd;
  double free_ms = outage.listens_ms;
  while (!due.empty()) {
    const auto [now_ms, station] = due.top();
    due.pop();
    herd.tries_ms.push_back(now_ms);
    if (now_ms < outage.listens_ms) {
      tryAgain(now_ms, station, refused);
      continue;
    }
    herd.arrived_ms.push_back(now_ms);
    const double done_ms = std::max(free_ms, now_ms) + 1000 / outage.handshakes_per_s;
    if (done_ms > now_ms + patience_ms) {
      tryAgain(now_ms + patience_ms, station, overdue);
      continue;
    }
    free_ms = done_ms;
    herd.back_ms.push_back(done_ms - outage.listens_ms);
  }
  std::sort(herd.back_ms.begin(), herd.back_ms.end());
  return herd;
}

/// The most of these sorted times within any second from `from_ms` on.
std::size_t mostInASecond(const std::vector<double>& times_ms, double from_ms = 0) {
  std::size_t most = 0;
  auto first = std::lower_bound(times_ms.begin(), times_ms.end(), from_ms);
  for (auto last = first; last != times_ms.end(); ++last) {
    while (*last - *first >= 1000) ++first;
    most = std::max(most, static_cast<std::size_t>(last - first) + 1);
  }
  return most;
}

TEST(Reconnection, ninetyPercentOfStationsReconnectWithinTwoSecondsOfAnOutage) {
  const Herd herd = simulate({});
  ASSERT_EQ(herd.back_ms.size(), kStations);
  EXPECT_LE(herd.back_ms[kStations * 9 / 10], 2000);
  // by then all have probed, and the last one waits for the others
  EXPECT_LE(herd.back_ms.back(), kProbe_ms + 1000 * kStations / 500.0);
}

TEST(Reconnection, anOutageOfAnyLengthEndsAsSoon) {
  for (const double listens_ms : {3'000.0, 5'500.0, 30'000.0, 600'000.0}) {
    const Herd herd = simulate({.listens_ms = listens_ms});
    ASSERT_EQ(herd.back_ms.size(), kStations);
    EXPECT_LE(herd.back_ms[kStations * 9 / 10], 2000) << listens_ms;
  }
}

TEST(Reconnection, aThousandStationsThatProbeStayBelowTheRateOfTheirWaits) {
  const Herd herd = simulate({.listens_ms = 60'000});
  // the shortest waits are 0.1, 0.2, 0.4 and then 0.75 s: a station tries three times in its first second and
  // twice in any later one
  EXPECT_LE(mostInASecond(herd.tries_ms), 3 * kStations);
  EXPECT_LE(mostInASecond(herd.tries_ms, 1'100), 2 * kStations);
  // with mixed phases, all stations together try at the rate of the mean wait, and so do those that find the
  // server: no second brings more handshakes than that
  EXPECT_LE(static_cast<double>(mostInASecond(herd.tries_ms, 15'000)), 1.2 * kProbesPerSecond);
  EXPECT_LE(static_cast<double>(mostInASecond(herd.arrived_ms)), 1.2 * kProbesPerSecond);
  EXPECT_EQ(herd.arrived_ms.size(), kStations) << "each shakes hands once";
}

TEST(Reconnection, aServerThatIsTooSlowIsTriedEverMoreSeldom) {
  // 40 handshakes a second: most stations give up after 5 s and back off, although their lessons run
  const Herd herd = simulate({.handshakes_per_s = 40});
  ASSERT_EQ(herd.back_ms.size(), kStations);
  // after giving up for the k-th time a station waits at least 0.8·2^k s, at most 5 s: this bounds the tries
  const double whole_s = herd.back_ms.back() / 1000;
  EXPECT_LE(static_cast<double>(herd.arrived_ms.size()), kStations * (1 + whole_s / (5 + 0.8)));
}

TEST(Reconnection, withoutALessonTheWaitsGrowToTenSeconds) {
  const Herd herd = simulate({.listens_ms = 60'000, .lesson_runs = false});
  ASSERT_EQ(herd.back_ms.size(), kStations);
  EXPECT_GT(herd.back_ms[kStations * 9 / 10], 4000);
  // waits of 5 to 10 s
  EXPECT_LE(static_cast<double>(mostInASecond(herd.tries_ms, 30'000)), 1.5 * kStations / 7.5);
}

TEST(Reconnection, onlyAnUnreachedAddressIsProbedDuringALesson) {
  LinkEnd end;
  end.error = {ErrorCode::kUnavailable, "connection refused"};
  EXPECT_EQ(retryOfStation(end, true), Retry::kProbe);
  EXPECT_EQ(retryOfStation(end, false), Retry::kBackOff);
  end.reached = true;
  EXPECT_EQ(retryOfStation(end, true), Retry::kBackOff) << "it accepts connections and is busy";
  end.error.code = ErrorCode::kDenied;
  EXPECT_EQ(retryOfStation(end, true), Retry::kSlowly);
  end.was_connected = true;
  EXPECT_EQ(retryOfStation(end, true), Retry::kBackOff) << "two stations with one key must not fight";
}

// --- two servers; the first has just died

/// Stations with a lesson, all of them on server a until time 0. Server b listens from `listens_ms` on.
Herd simulateTwo(double listens_ms, double handshakes_per_s) {
  const Endpoints servers = *parseEndpoints("a:1,b:1");
  const std::vector<asio::ip::address> address = {asio::ip::make_address("10.0.0.1")};
  std::vector<Backoff> waits;
  std::vector<ServerChoice> choices;
  using Try = std::pair<double, std::size_t>;
  std::priority_queue<Try, std::vector<Try>, std::greater<>> due;
  for (std::size_t station = 0; station < kStations; ++station) {
    waits.emplace_back(station + 1, UplinkConfig{}.retry());
    choices.emplace_back(servers, station + 1);
    choices.back().beginRound();
    EXPECT_EQ(choices.back().next()->host, "a");
    (void)choices.back().take(address);
    choices.back().welcomed();
    choices.back().lost();
    due.emplace(static_cast<double>(waits.back().next().count()), station);
  }
  Herd herd;
  double free_ms = 0;
  while (!due.empty()) {
    const auto [now_ms, station] = due.top();
    due.pop();
    ServerChoice& choice = choices[station];
    bool is_back = false;
    choice.beginRound();
    while (const Endpoint* const next = choice.next()) {
      herd.tries_ms.push_back(now_ms);
      (void)choice.take(address);
      if (next->host == "a" || now_ms < listens_ms) {
        choice.failed();  // refused at once
        continue;
      }
      choice.welcomed();
      herd.arrived_ms.push_back(now_ms);
      free_ms = std::max(free_ms, now_ms) + 1000 / handshakes_per_s;
      herd.back_ms.push_back(free_ms - listens_ms);
      is_back = true;
      break;
    }
    if (is_back) continue;
    LinkEnd refused;
    refused.error = {ErrorCode::kUnavailable, ""};
    EXPECT_EQ(retryOfStation(refused, true), Retry::kProbe);
    due.emplace(now_ms + static_cast<double>(waits[station].nextProbe().count()), station);
  }
  return herd;
}

TEST(ReconnectionOfTwo, whoLosesAServerIsAtTheOtherAfterTheFirstWait) {
  const Herd herd = simulateTwo(0, 500);
  ASSERT_EQ(herd.back_ms.size(), kStations);
  EXPECT_EQ(herd.tries_ms.size(), kStations) << "no one asks the dead one";
  // all arrive within their first waits, 100 to 200 ms, and are served one after the other
  EXPECT_GE(herd.arrived_ms.front(), 100);
  EXPECT_LE(herd.arrived_ms.back(), 200);
  for (std::size_t k = 0; k < kStations; ++k)
    ASSERT_LE(herd.back_ms[k], 200 + 2.0 * static_cast<double>(k + 1)) << k;
  // evenly: each 10 ms of these 100 gets a tenth of them, 100 ± 9.5; tolerance four deviations
  std::vector<int> buckets(11, 0);
  for (const double at_ms : herd.arrived_ms) ++buckets[static_cast<std::size_t>((at_ms - 100) / 10)];
  for (std::size_t i = 0; i < 10; ++i) EXPECT_NEAR(buckets[i], 100, 40) << i;
}

TEST(ReconnectionOfTwo, whileBothAreAwayARoundBacksOffAsOneServerDoes) {
  const Herd herd = simulateTwo(60'000, 500);
  ASSERT_EQ(herd.back_ms.size(), kStations);
  EXPECT_LE(herd.back_ms[kStations * 9 / 10], 2000 + 200);
  // two tries per round; when b comes back it gets no more handshakes per second than a single server
  EXPECT_LE(static_cast<double>(mostInASecond(herd.tries_ms, 15'000)), 2 * 1.2 * kProbesPerSecond);
  EXPECT_LE(static_cast<double>(mostInASecond(herd.arrived_ms)), 1.2 * kProbesPerSecond);
}

TEST(Backoff, aProbesWaitIsCappedAndLeavesTheBackOffUnchanged) {
  Backoff probing(3, {milliseconds(200), milliseconds(10'000), 2.0, milliseconds(1500)});
  double all = 200;
  for (int n = 0; n < 100; ++n, all = std::min(2 * all, 1500.0)) {
    const auto wait = static_cast<double>(probing.nextProbe().count());
    EXPECT_GE(wait, std::floor(0.5 * all)) << n;
    EXPECT_LE(wait, all) << n;
  }
  // 0.2, 0.4 and 0.8 s were below the limit: the back-off's fourth wait is next
  EXPECT_EQ(probing.tries(), 3u);
  EXPECT_LE(probing.next(), milliseconds(1600));
}

}  // namespace
}  // namespace needlelab
