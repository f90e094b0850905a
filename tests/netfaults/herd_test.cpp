// A thundering herd: the server is killed under load, and all stations reconnect at once.
#include <fmt/core.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <iostream>
#include <thread>

#include "common/base/files/files.h"
#include "common/base/time/clock.h"
#include "tests/load/server/database_check.h"
#include "tests/load/server/own_server.h"
#include "tests/load/station_crowd.h"
#include "tests/support/patience.h"
#include "tests/support/run_form.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

double secondsOf(std::int64_t ns) {
  return 1e-9 * static_cast<double>(ns);
}

void run(std::size_t stations, std::chrono::milliseconds outage) {
  rlimit files{};
  ::getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = files.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &files);
  const TempFolder folder;
  const auto enrolled = enrol(folder.path() / "data", stations);
  ASSERT_TRUE(enrolled.ok()) << enrolled.error().message;
  OwnServer server(std::string(NEEDLELAB_BIN) + "/needlelab-server", folder.path());
  const Status started = server.start();
  ASSERT_TRUE(started.ok()) << started.error().message;
  const GesturePool pool = makeGesturePool(1, 4).value();
  LoadShared shared;
  shared.pool = &pool;
  shared.ticks = 3'600'000;
  shared.link = {};  // as a station waits
  shared.client.program = programText("herd");
  shared.client.server.port = server.port();
  shared.client.tls = *makeClientTls(server.caFile());
  // in the short form, beside other tests, nothing is asserted about how soon
  if (!longForm()) shared.client.connect_timeout = kPatience;
  shared.stations = std::vector<StationPlan>(stations);
  for (std::size_t i = 0; i < stations; ++i) {
    shared.stations[i].name = enrolled->stations[i].first;
    shared.stations[i].key = enrolled->stations[i].second;
    shared.stations[i].session = makeUuidV7();
  }
  const auto said = [&] { return readWholeFile(server.log()).value().substr(0, 2000); };

  // the first storm: all connect for the first time
  StationCrowd crowd(shared);
  const std::int64_t first_ns = steadyNowNs();
  crowd.connect(1e6);
  ASSERT_TRUE(eventually([&] { return crowd.state().whole == stations; })) << crowd.state().trouble << said();
  std::cout << "herd of " << stations << ": first log-ins took " << secondsOf(steadyNowNs() - first_ns)
            << " s\n";
  const std::int64_t begin_ns = steadyNowNs();
  for (std::size_t i = 0; i < stations; ++i)
    shared.stations[i].start_ns =
        begin_ns + static_cast<std::int64_t>(1e9 * static_cast<double>(i) / static_cast<double>(stations));
  crowd.stream();
  ASSERT_TRUE(eventually([&] { return crowd.totals().samples_acked > 1000 * stations; }))
      << crowd.state().trouble;

  server.kill();
  ASSERT_TRUE(eventually([&] { return crowd.state().opened == 0; }));
  std::this_thread::sleep_for(outage);
  const std::uint64_t before = crowd.totals().connections;
  const std::int64_t start_ns = steadyNowNs();
  const Status again = server.start();  // the stations keep trying in the meantime
  ASSERT_TRUE(again.ok()) << again.error().message;
  const std::int64_t listening_ns = steadyNowNs();
  ASSERT_TRUE(eventually([&] { return crowd.state().whole == stations; }))
      << crowd.state().whole << " of " << stations << " are whole again; " << crowd.state().trouble << "\n"
      << said();
  std::vector<double> whole_s;
  for (const std::int64_t since_ns : crowd.wholeSince_ns())
    whole_s.push_back(secondsOf(since_ns - listening_ns));
  std::sort(whole_s.begin(), whole_s.end());
  ASSERT_EQ(whole_s.size(), stations);
  const auto sample = server.sample();
  std::cout << "outage " << outage.count() << " ms, start " << secondsOf(listening_ns - start_ns)
            << " s; whole again (logged in, resumed, backlog acknowledged) after the server listens: median "
            << whole_s[whole_s.size() / 2] << " s, 95 % " << whole_s[whole_s.size() * 95 / 100] << " s, last "
            << whole_s.back() << " s; server " << (sample ? sample->rss_KiB / 1024 : 0) << " MiB\n";
  // connected stations stay connected: those that reconnect do not end others' connections
  EXPECT_EQ(crowd.totals().connections - before, stations);

  crowd.endNow();
  EXPECT_TRUE(eventually([&] { return crowd.state().finished == stations; })) << crowd.state().trouble;
  EXPECT_EQ(crowd.state().closed, stations) << crowd.state().trouble;
  crowd.stop();
  ASSERT_TRUE(server.stop().ok());
  const auto stored = checkDatabase(server.data() / "needlelab.db", shared, crowd.ticks(), {});
  ASSERT_TRUE(stored.ok()) << stored.error().message;
  EXPECT_TRUE(stored->clean()) << (stored->faults.empty() ? "" : stored->faults.front());
}

TEST(HerdTest, sixtyStationsAreWholeAgainAfterAKill) {
  run(60, 500ms);
}

TEST(HerdTest, aThousandStationsAreWholeAgainAfterAKill) {
  if (!longForm()) GTEST_SKIP() << "takes some minutes: NEEDLELAB_LONG=1";
  run(1000, 3s);
}

}  // namespace
}  // namespace needlelab::test
