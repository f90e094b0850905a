// Fifty stations stream and two viewers watch during attacks: the stations are not affected.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdio>
#include <optional>
#include <thread>

#include "client/net/link/server_link.h"
#include "common/base/time/clock.h"
#include "tests/load/load_viewer.h"
#include "tests/load/server/database_check.h"
#include "tests/load/server/own_server.h"
#include "tests/load/station_crowd.h"
#include "tests/security/attackers.h"
#include "tests/support/patience.h"
#include "tests/support/run_form.h"
#include "tests/support/sanitized.h"
#include "tests/support/store/password_cost.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

double ms(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-6;
}

/// Returns the duration of a log-in including TLS, with a station's retries. Returns nothing if it fails for
/// kPatience.
std::optional<std::int64_t> logInTime(const LoadShared& shared, const pb::Login& login) {
  ClientConfig config = shared.client;
  config.login = login;
  const std::int64_t begin_ns = steadyNowNs();
  Backoff backoff(1);
  for (;;) {
    const auto client = BlockingClient::connect(config);
    const std::int64_t took_ns = steadyNowNs() - begin_ns;
    if (client.ok()) return took_ns;
    std::fprintf(stderr, "flood: %s\n", client.error().message.c_str());
    if (took_ns > kPatience.count() * 1'000'000'000) return std::nullopt;
    std::this_thread::sleep_for(backoff.next());
  }
}

TEST(Flood, stationsAndViewersNoticeNothing) {
  const ProductPasswordCost product;  // for the administrator, whose log-in competes with the guesses
  const bool long_form = longForm();
  constexpr std::size_t kStations = 50, kViewers = 2;
  const double phase_s = long_form ? 20 : 2.5;
  rlimit files{};
  ::getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = files.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &files);

  TempFolder folder;
  auto pool = makeGesturePool(1, 2);
  ASSERT_TRUE(pool.ok()) << pool.error().message;
  // fifty stations stream, one connects during the flood, two have stolen keys
  const auto enrolled = enrol(folder.path() / "data", kStations + 3);
  ASSERT_TRUE(enrolled.ok()) << enrolled.error().message;
  OwnServer server(std::string(NEEDLELAB_BIN) + "/needlelab-server", folder.path());
  ASSERT_TRUE(server.start().ok());

  LoadShared shared;
  shared.pool = &*pool;
  shared.ticks = static_cast<std::uint64_t>(1000 * (2 * phase_s + 1));
  shared.client.program = programText("flood");
  shared.client.connect_timeout = kPatience;
  shared.client.server.port = server.port();
  auto tls = makeClientTls(server.caFile());
  ASSERT_TRUE(tls.ok());
  shared.client.tls = *tls;
  shared.stations = std::vector<StationPlan>(kStations);
  for (std::size_t i = 0; i < kStations; ++i) {
    shared.stations[i].name = enrolled->stations[i].first;
    shared.stations[i].key = enrolled->stations[i].second;
    shared.stations[i].session = makeUuidV7();
  }
  const pb::Login administrator = personLogin(enrolled->user, enrolled->password);
  const auto& [newcomer, newcomer_key] = enrolled->stations[kStations];
  const StolenKey* const stolen = &enrolled->stations[kStations + 1];

  StationCrowd crowd(shared);
  ViewerCrowd viewers(shared, administrator, kViewers);
  crowd.connect(400);
  viewers.connect();
  const auto ready = [&] { return crowd.state().opened == kStations && viewers.watching() == kViewers; };
  ASSERT_TRUE(eventually(ready, kPatience)) << crowd.state().trouble << viewers.lastError();
  const std::int64_t begin_ns = steadyNowNs() + 50'000'000;
  for (std::size_t i = 0; i < kStations; ++i)
    shared.stations[i].start_ns = begin_ns + static_cast<std::int64_t>(i) * 1'000'000'000 / kStations;
  crowd.stream();

  std::this_thread::sleep_for(std::chrono::duration<double>(phase_s));
  const LatencyHistogram ack_before = crowd.totals().ack, live_before = viewers.totals().live;
  const auto sample_before = server.sample();
  ASSERT_TRUE(sample_before.has_value());

  std::optional<std::int64_t> station_ns, person_ns;
  std::uint64_t greatest_KiB = 0, handles = 0;
  {
    const Attackers attackers(server.caFile(), server.port(), stolen[0], stolen[1]);
    const AttackCounts& c = attackers.counts();
    const auto begin = std::chrono::steady_clock::now();
    std::this_thread::sleep_for(std::chrono::duration<double>(phase_s / 2));
    station_ns = logInTime(shared, stationLogin(newcomer, newcomer_key));
    person_ns = logInTime(shared, administrator);
    const auto every = [&] {
      for (const auto* count :
           {&c.garbage, &c.half_open, &c.slow, &c.oversized, &c.oversized_in, &c.guesses, &c.churn})
        if (count->load() <= 3) return false;
      return c.pings > 1000;
    };
    // Gives a slow machine the time that every attack, the stations and the viewers need.
    const auto goesOn = [&] {
      const auto elapsed = std::chrono::steady_clock::now() - begin;
      if (elapsed < std::chrono::duration<double>(phase_s)) return true;
      return elapsed < kPatience && !(every() && crowd.totals().ack.since(ack_before).total() > kStations &&
                                      viewers.totals().live.since(live_before).total() > 50 * kStations);
    };
    do {
      if (const auto sample = server.sample()) {
        greatest_KiB = std::max(greatest_KiB, sample->rss_KiB);
        handles = std::max(handles, sample->handles);
      }
      std::this_thread::sleep_for(100ms);
    } while (goesOn());
    std::fprintf(stderr,
                 "flood: garbage %llu, half-open %llu, slow bytes %llu, oversized %llu before and %llu after "
                 "log-in, guesses %llu, churn %llu, pings %llu; turned away %llu\n",
                 static_cast<unsigned long long>(c.garbage), static_cast<unsigned long long>(c.half_open),
                 static_cast<unsigned long long>(c.slow), static_cast<unsigned long long>(c.oversized),
                 static_cast<unsigned long long>(c.oversized_in), static_cast<unsigned long long>(c.guesses),
                 static_cast<unsigned long long>(c.churn), static_cast<unsigned long long>(c.pings),
                 static_cast<unsigned long long>(c.turned_away));
    EXPECT_TRUE(every()) << "every kind of attack took place";
  }
  const LatencyHistogram ack = crowd.totals().ack.since(ack_before);
  const LatencyHistogram live = viewers.totals().live.since(live_before);
  // Reported, not asserted: durations depend on the machine (tests/bench/realtime, tests/load).
  const auto report = [](const char* what, const LatencyHistogram& before, const LatencyHistogram& during) {
    std::fprintf(stderr, "flood: %s p50 %.1f ms before, %.1f during; p99 %.1f before, %.1f during\n", what,
                 ms(before.quantile_ns(0.5)), ms(during.quantile_ns(0.5)), ms(before.quantile_ns(0.99)),
                 ms(during.quantile_ns(0.99)));
  };
  report("acknowledgement", ack_before, ack);
  report("live", live_before, live);
  std::fprintf(
      stderr,
      "flood: server %llu KiB before, at most %llu during, %llu handles; log-in of a station %.0f ms\n",
      static_cast<unsigned long long>(sample_before->rss_KiB), static_cast<unsigned long long>(greatest_KiB),
      static_cast<unsigned long long>(handles), ms(station_ns.value_or(-1)));
  EXPECT_GT(ack.total(), kStations);
  EXPECT_GT(live.total(), 50 * kStations);
  EXPECT_TRUE(station_ns.has_value()) << "a legitimate station gets in";
  EXPECT_TRUE(person_ns.has_value()) << "and so does a person who has been here before";
  // argon2id takes 64 MiB; 1,536 connections without log-in take about 60 KiB each
  if (!kSanitized) {
    EXPECT_LE(greatest_KiB, sample_before->rss_KiB + 200 * 1024);
  }

  const auto done = [&] { return crowd.state().finished == kStations; };
  EXPECT_TRUE(eventually(done, kPatience)) << crowd.state().trouble;
  EXPECT_EQ(crowd.state().closed, kStations) << crowd.state().trouble;
  viewers.stop();
  crowd.stop();
  EXPECT_EQ(crowd.totals().connections, kStations) << "no station was thrown out";
  EXPECT_EQ(viewers.totals().connections, kViewers);
  EXPECT_EQ(viewers.totals().corrupt, 0u);
  ASSERT_TRUE(server.stop().ok());
  const auto stored =
      checkDatabase(server.data() / "needlelab.db", shared, crowd.ticks(), [](std::size_t) {});
  ASSERT_TRUE(stored.ok()) << stored.error().message;
  EXPECT_TRUE(stored->clean()) << stored->samples.first;
  EXPECT_EQ(stored->samples.stored, kStations * shared.ticks);
  // A flood does not fill the disk with log lines.
  EXPECT_LT(std::filesystem::file_size(server.log()), (long_form ? 20u : 4u) << 20);
}

}  // namespace
}  // namespace needlelab::test
