// Parts tested without a server: gestures, comparison, schedule, faults, profile.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <functional>
#include <set>

#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/load/load_options.h"
#include "tests/load/load_report.h"
#include "tests/load/load_run.h"
#include "tests/load/load_station.h"
#include "tests/load/server/database_check.h"
#include "tests/load/server/own_server.h"
#include "tests/load/server/process_use.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

const GesturePool& pool() {
  static const GesturePool made = makeGesturePool(1, 6).value();
  return made;
}

std::vector<GestureSample> samplesOf(std::size_t station, std::uint64_t first, std::size_t count,
                                     std::uint64_t seed = 1) {
  std::vector<GestureSample> samples(count);
  StationStream(pool(), seed, station).fill(first, samples);
  return samples;
}

// as the database returns them
std::vector<GestureSample> storedOf(const std::vector<GestureSample>& samples) {
  return decodeChunk(encodeChunk(Resolution::standard(), samples)).value();
}

bool sameBits(const GestureSample& a, const GestureSample& b) {
  return storedOf({a})[0].time_ns == b.time_ns && differingField(a, b, Resolution::lossless()) == nullptr;
}

TEST(GesturePool, holdsWholeInsertionsWithForces) {
  ASSERT_EQ(pool().gestures.size(), 6u);
  for (const PoolGesture& gesture : pool().gestures) {
    ASSERT_GT(gesture.size(), 1000u);
    EXPECT_EQ(gesture.front().layer, -1);
    EXPECT_EQ(gesture.back().layer, -1);
    double deepest_m = 0, max_N = 0, plunger = 0;
    for (const GestureSample& s : gesture) {
      deepest_m = std::max(deepest_m, s.insertion_m);
      max_N = std::max(max_N, std::hypot(s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]));
      plunger = std::max(plunger, s.plunger);
      EXPECT_EQ(s.fault, 0);
    }
    EXPECT_GT(deepest_m, 0.008);
    EXPECT_GT(max_N, 0.5);
    EXPECT_GT(plunger, 0.9);
  }
}

TEST(GesturePool, isTheSameForTheSameSeedOnly) {
  const GesturePool again = makeGesturePool(1, 2).value(), other = makeGesturePool(2, 2).value();
  for (std::size_t g = 0; g < 2; ++g) {
    ASSERT_EQ(again.gestures[g].size(), pool().gestures[g].size());
    for (std::size_t i = 0; i < again.gestures[g].size(); ++i)
      ASSERT_EQ(differingField(again.gestures[g][i], pool().gestures[g][i], Resolution::lossless()), nullptr);
  }
  EXPECT_NE(other.gestures[0].size(), pool().gestures[0].size());
}

TEST(StationStream, givesTheSameSampleWheneverItIsAsked) {
  const auto whole = samplesOf(7, 0, 60'000);
  StationStream stream(pool(), 1, 7);
  // forwards in frames, then in the middle and back
  for (const std::uint64_t first : {0u, 20u, 40u, 31'000u, 59'980u, 12'345u, 5u}) {
    std::vector<GestureSample> part(20);
    stream.fill(first, part);
    for (std::size_t i = 0; i < part.size(); ++i) {
      ASSERT_EQ(part[i].tick, first + i);
      ASSERT_TRUE(sameBits(part[i], whole[first + i])) << first << " + " << i;
    }
  }
}

TEST(StationStream, noSampleIsLikeOneOfAnotherStation) {
  std::set<std::int64_t> times;
  std::set<std::array<double, 3>> places;
  constexpr std::size_t kStations = 1000;
  for (std::size_t station = 0; station < kStations; ++station) {
    const auto samples = samplesOf(station, 0, 3);
    for (const GestureSample& s : samples) times.insert(s.time_ns);
    const Vec3 at = StationStream(pool(), 1, station).placement_m();
    places.insert({at.x, at.y, at.z});
    // the longest run's last time still belongs to this station
    EXPECT_LT(StationStream(pool(), 1, station).timeOf(7'200'000),
              StationStream(pool(), 1, station + 1).timeOf(0));
  }
  EXPECT_EQ(times.size(), 3 * kStations);
  EXPECT_EQ(places.size(), kStations);
}

TEST(StationStream, ofAnotherSeedIsAnotherGesture) {
  const auto one = samplesOf(3, 0, 2000), other = samplesOf(3, 0, 2000, 2);
  std::size_t different = 0;
  for (std::size_t i = 0; i < one.size(); ++i) different += one[i].p_WT_m[2] != other[i].p_WT_m[2] ? 1 : 0;
  EXPECT_GT(different, 1900u);
}

TEST(StationStream, costsFewBytesAsRealMotionDoes) {
  const auto samples = samplesOf(5, 4000, 1000);
  const double bytes = static_cast<double>(encodeChunk(Resolution::standard(), samples).size()) / 1000;
  EXPECT_LT(bytes, 8);
  EXPECT_GT(bytes, 1.5);
}

class Compared : public testing::Test {
 protected:
  static constexpr std::uint64_t kTicks = 3000;
  static Difference compare(const std::vector<std::vector<GestureSample>>& chunks, std::size_t station = 4) {
    SessionComparison comparison(StationStream(pool(), 1, station), kTicks, "station");
    for (const auto& chunk : chunks) comparison.take(chunk);
    return comparison.finish();
  }
  std::vector<std::vector<GestureSample>> chunks_ = {storedOf(samplesOf(4, 0, 1000)),
                                                     storedOf(samplesOf(4, 1000, 1000)),
                                                     storedOf(samplesOf(4, 2000, 1000))};
};

TEST_F(Compared, countsLostDuplicatedAndForeignSamples) {
  using Chunks = std::vector<std::vector<GestureSample>>;
  const struct {
    const char* what;
    void (*change)(Chunks&);
    std::uint64_t lost, duplicated, foreign;
    const char* words;
  } cases[] = {
      {"all is there", [](Chunks&) {}, 0, 0, 0, ""},
      {"the order is not a difference", [](Chunks& c) { std::swap(c[0], c[2]); }, 0, 0, 0, ""},
      {"a chunk is lost", [](Chunks& c) { c.erase(c.begin() + 1); }, 1000, 0, 0, "tick 1000"},
      {"a sample is lost", [](Chunks& c) { c[2].erase(c[2].begin() + 17); }, 1, 0, 0, "tick 2017"},
      {"a chunk twice", [](Chunks& c) { c.push_back(c[1]); }, 0, 1000, 0, "twice"},
      {"a sample twice", [](Chunks& c) { c[0].push_back(c[0][999]); }, 0, 1, 0, "twice"},
      {"of another station", [](Chunks& c) { c[1] = storedOf(samplesOf(5, 1000, 1000)); }, 1000, 0, 1000,
       "another station"},
      {"beyond the end",
       [](Chunks& c) {
         c[2].push_back(c[2].back());
         c[2].back().tick = UINT64_MAX;
       },
       0, 0, 1, "never generated"},
  };
  for (const auto& each : cases) {
    auto chunks = chunks_;
    each.change(chunks);
    const Difference d = compare(chunks);
    EXPECT_EQ(d.lost, each.lost) << each.what;
    EXPECT_EQ(d.duplicated, each.duplicated) << each.what;
    EXPECT_EQ(d.foreign, each.foreign) << each.what;
    EXPECT_EQ(d.different, 0u) << each.what;
    EXPECT_NE(d.first.find(each.words), std::string::npos) << d.first;
  }
  EXPECT_EQ(compare(chunks_).stored, kTicks);
}

TEST_F(Compared, findsAChangeInEveryField) {
  const std::vector<std::pair<const char*, void (*)(GestureSample&)>> changes = {
      {"p_WT_m", [](GestureSample& s) { s.p_WT_m[1] += 1.1e-6; }},
      {"q_WT", [](GestureSample& s) { s.q_WT[2] += 0x1.2p-15; }},
      {"speed_mps", [](GestureSample& s) { s.speed_mps += 1.1e-4; }},
      {"force_W_N", [](GestureSample& s) { s.force_W_N[2] -= 1.1e-3; }},
      {"torque_W_Nm", [](GestureSample& s) { s.torque_W_Nm[0] += 1.1e-4; }},
      {"wall_W_m", [](GestureSample& s) { s.wall_W_m[0] = std::isnan(s.wall_W_m[0]) ? 0 : std::nan(""); }},
      {"insertion_m", [](GestureSample& s) { s.insertion_m += 1.1e-6; }},
      {"lateral_error_m", [](GestureSample& s) { s.lateral_error_m += 1.1e-6; }},
      {"plunger", [](GestureSample& s) { s.plunger += 0x1.2p-15; }},
      {"device_ns", [](GestureSample& s) { s.device_ns += 1100; }},
      {"engine_ns", [](GestureSample& s) { s.engine_ns += 1100; }},
      {"flags", [](GestureSample& s) { s.flags ^= 1; }},
      {"buttons", [](GestureSample& s) { s.buttons ^= 1; }},
      {"layer", [](GestureSample& s) { ++s.layer; }},
      {"phase", [](GestureSample& s) { ++s.phase; }},
      {"fault", [](GestureSample& s) { ++s.fault; }},
  };
  for (const auto& [field, change] : changes) {
    auto changed = chunks_;
    change(changed[1][500]);
    const Difference d = compare(changed);
    EXPECT_EQ(d.different, 1u) << field;
    EXPECT_EQ(d.lost + d.duplicated + d.foreign, 0u) << field;
    EXPECT_NE(d.first.find(field), std::string::npos) << d.first;
  }
}

// a station without a connection: only its schedule
struct LonelyStation {
  explicit LonelyStation(std::uint64_t ticks, std::int64_t start_ns) {
    shared.pool = &pool();
    shared.ticks = ticks;
    shared.stations = std::vector<StationPlan>(1);
    shared.stations[0].start_ns = start_ns;
    station = std::make_shared<LoadStation>(shared, 0, totals, io);
  }
  asio::io_context io{1};
  LoadShared shared;
  StationTotals totals;
  std::shared_ptr<LoadStation> station;
};

TEST(LoadStation, framesAreDueAtFixedTimesHoweverLateTheyAreMade) {
  const std::int64_t start_ns = 5'000'000'000'000;
  LonelyStation lonely(2010, start_ns);
  // the first frame is made 3 s late; the next is due 20 ms after the first was due, not after it was made
  EXPECT_EQ(lonely.station->nextDue_ns(), start_ns + 19'000'000);
  EXPECT_TRUE(lonely.station->step(start_ns + 3'000'000'000));
  EXPECT_EQ(lonely.station->nextDue_ns(), start_ns + 39'000'000);
  EXPECT_NEAR(static_cast<double>(lonely.totals.late.max_ns()), 3e9 - 19e6, 1);
  while (lonely.station->step(lonely.station->nextDue_ns())) {
  }
  EXPECT_EQ(lonely.station->ticks(), 2010u);
  EXPECT_EQ(lonely.totals.late.total(), 101u);
  EXPECT_EQ(lonely.totals.late.quantile_ns(0.9), 0);  // the others were on time
  // three chunks wait: 1000, 1000 and 10 samples
  EXPECT_EQ(lonely.totals.unsent_peak, 3u);
  EXPECT_EQ(lonely.totals.samples_sent, 0u);
}

TEST(FaultPlan, isTheSameForASeedAndHasAKillSecond) {
  LoadOptions options;
  options.stations = 40;
  options.viewers = 4;
  options.seconds = 1000;
  options.fault_every_s = 5;
  const auto plan = [&options] {
    FaultPlan faults(options);
    std::vector<std::pair<double, PlannedFault>> all;
    for (double t = 0; t < options.seconds; t += 0.02)
      if (auto fault = faults.at(t)) all.emplace_back(t, *fault);
    return all;
  };
  const auto one = plan(), again = plan();
  ASSERT_EQ(one.size(), again.size());
  EXPECT_NEAR(static_cast<double>(one.size()), 200, 60);
  EXPECT_EQ(one[0].second.kind, PlannedFault::Kind::kCut);
  EXPECT_EQ(one[1].second.kind, PlannedFault::Kind::kKillServer);
  std::size_t kinds[3] = {}, late_kills = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    const PlannedFault& fault = one[i].second;
    EXPECT_EQ(fault.kind, again[i].second.kind);
    EXPECT_EQ(fault.who, again[i].second.who);
    ++kinds[static_cast<std::size_t>(fault.kind)];
    for (const std::size_t who : fault.who)
      EXPECT_LT(who, fault.kind == PlannedFault::Kind::kSlowViewer ? 4u : 40u);
    if (fault.kind == PlannedFault::Kind::kKillServer && one[i].first > 250) ++late_kills;
  }
  for (const std::size_t kind : kinds) EXPECT_GT(kind, 5u);
  EXPECT_EQ(late_kills, 0u);
}

TEST(LoadOptions, whatIsWrongIsNamed) {
  using O = LoadOptions&;
  const auto there = [](O o) { o.server = {Endpoint{}}, o.ca_file = o.password_file = "x"; };
  const auto several = [](O o, std::vector<std::string> names) {
    o.servers = std::move(names), o.store = "postgresql:///x";
  };
  const std::pair<const char*, std::function<void(O)>> cases[] = {
      {"accepted", [](O) {}},
      {"accepted", there},
      {"accepted",
       [&](O o) {
         several(o, {"a", "b"});
       }},
      {"accepted",
       [&](O o) {
         several(o, {"a", "b", "c3"});
       }},
      {"--stations: 0 is out of range [1, 4000]", [](O o) { o.stations = 0; }},
      {"--seconds: 0 is out of range [0.1, 7200]", [](O o) { o.seconds = 0; }},
      {"--viewers: 101 is out of range [0, 100]", [](O o) { o.viewers = 101; }},
      {"--ca", [](O o) { o.server = {Endpoint{}}; }},
      {"--password-file", [](O o) { o.server = {Endpoint{}}, o.ca_file = "x"; }},
      {"--server", [](O o) { o.ca_file = "x"; }},
      {"--faults", [&](O o) { there(o), o.faults = true; }},
      {"--store", [&](O o) { there(o), o.store = "postgresql:///x"; }},
      {"--servers",
       [&](O o) {
         there(o), several(o, {"a", "b"});
       }},
      {"--servers", [&](O o) { several(o, {"a"}); }},
      {"--servers",
       [&](O o) {
         several(o, {"a", "a"});
       }},
      {"--servers",
       [&](O o) {
         several(o, {"a", ""});
       }},
      {"--servers",
       [&](O o) {
         several(o, {"a", "../b"});
       }},
      {"--servers",
       [&](O o) {
         several(o, {"a", "first"});
       }},
      {"--servers",
       [&](O o) {
         several(o, {"a", "B"});
       }},
      {"here are 9", [&](O o) { several(o, std::vector<std::string>(9, "a")); }},
      {"--store",
       [](O o) {
         o.servers = {"a", "b"};
       }},
      {"--faults",
       [&](O o) {
         several(o, {"a", "b"}), o.faults = true;
       }},
      {"--standby", [](O o) { o.standby = "x"; }},
  };
  for (const auto& [words, change] : cases) {
    LoadOptions options;
    change(options);
    const Status status = checkOptions(options);
    const std::string said = status.ok() ? "accepted" : status.error().message;
    EXPECT_NE(said.find(words), std::string::npos) << words << "; said: " << said;
    if (!status.ok()) EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
  }
}

TEST(LoadOptions, viewersOfEachServerWatchStationsOfAll) {
  for (const std::size_t servers : {2u, 3u})
    for (const std::size_t viewers : {0u, 1u, 2u, 3u, 4u, 10u}) {
      std::vector<std::size_t> at(servers);
      // as LoadViewer assigns them
      std::set<std::pair<std::size_t, std::size_t>> watched;
      for (std::size_t station = 0; station < 60; ++station) {
        const std::size_t server = firstServerOf(station, viewers, servers);
        ASSERT_LT(server, servers);
        ++at[server];
        if (viewers > 0) watched.insert({station % viewers, server});
      }
      for (const std::size_t count : at) EXPECT_EQ(count, 60 / servers) << viewers << " viewers";
      EXPECT_EQ(watched.size(), viewers * servers) << "each viewer has stations at each server";
    }
  EXPECT_EQ(firstServerOf(7, 10, 1), 0u);
}

TEST(LoadShared, aStationTriesItsOwnServerFirstAndThenAllOthers) {
  LoadShared shared;
  shared.client.setServers({{"a", 1}, {"b", 2}, {"c", 3}});
  EXPECT_EQ(endpointsText(shared.clientOf(0).servers()), "a:1,b:2,c:3");
  EXPECT_EQ(endpointsText(shared.clientOf(2).servers()), "c:3,a:1,b:2");
  EXPECT_EQ(endpointsText(shared.clientOf(4).servers()), "b:2,c:3,a:1") << "a viewer's number";
  EXPECT_EQ(shared.numberOf({"c", 3}), 2u);
}

TEST(ProcessUse, isTheDifferenceAndUnknownAfterAProcessRestart) {
  ProcessUse begin, end;
  end.name = "NATS";
  begin.cpu_s = 1.5;
  end.cpu_s = 4;
  begin.disk_bytes = 7;
  end.disk_bytes = 7;
  begin.sent_bytes = 100;
  end.sent_bytes = 90;
  end.received_bytes = 5;
  begin.messages_in = 3;
  const ProcessUse use = useBetween(begin, end);
  EXPECT_EQ(use.name, "NATS");
  EXPECT_EQ(use.cpu_s, 2.5);
  EXPECT_EQ(use.disk_bytes, 0u);
  EXPECT_FALSE(use.sent_bytes || use.received_bytes || use.messages_in || use.messages_out || use.log_bytes);
}

TEST(ProcessUse, isReadFromMetricsAndFromNats) {
  const std::string alone =
      "needlelab_sent_bytes_total 100\nneedlelab_received_bytes_total 50\nneedlelab_acks_total 3\n"
      "needlelab_live_frames_sent_total 20\nneedlelab_live_frames_received_total 30\n"
      "needlelab_messages_parsed_total{thread=\"network\"} 4\n"
      "needlelab_messages_parsed_total{thread=\"parsers\"} 1\n";
  ProcessUse use;
  addScrape(use, parsePrometheus(alone));
  EXPECT_EQ(use.sent_bytes, 100u);
  EXPECT_EQ(use.received_bytes, 50u);
  EXPECT_EQ(use.messages_out, 23u);
  EXPECT_EQ(use.messages_in, 35u);
  addScrape(use, parsePrometheus(alone + "needlelab_live_link_bytes_total{direction=\"in\"} 7\n"
                                         "needlelab_live_link_bytes_total{direction=\"out\"} 9\n"));
  EXPECT_EQ(use.sent_bytes, 109u);
  EXPECT_EQ(use.received_bytes, 57u);
  addScrape(use, parsePrometheus(""));
  EXPECT_FALSE(use.sent_bytes || use.received_bytes || use.messages_out || use.messages_in);

  addVarz(use, R"({"in_msgs": 1, "out_msgs": 2, "in_bytes": 30, "out_bytes": 40})");
  EXPECT_EQ(use.messages_in, 1u);
  EXPECT_EQ(use.messages_out, 2u);
  EXPECT_EQ(use.received_bytes, 30u);
  EXPECT_EQ(use.sent_bytes, 40u);
  addVarz(use, "no JSON");
  EXPECT_FALSE(use.messages_in || use.sent_bytes);
}

TEST(ProcessUse, hasAProcessAndItsChildren) {
  const TempFolder folder;
  const auto busy = [&](const std::string& file) {
    return "i=0; while [ $i -lt 60000 ]; do i=$((i + 1)); done; head -c 400000 /dev/zero >" +
           (folder.path() / file).string();
  };
  // a child that has ended, one that is alive, and the parent, which waits for it
  Process parent("/bin/sh",
                 {"-c", "(" + busy("one") + "); (" + busy("two") + "; touch " +
                            (folder.path() / "done").string() + "; sleep 100) & wait"},
                 folder.path() / "said");
  ASSERT_TRUE(eventually([&] { return exists(folder.path() / "done"); })) << parent.said();
  const ProcessUse alone = useOf(parent.pid()), all = useWithChildren(parent.pid());
  ASSERT_TRUE(alone.cpu_s && all.cpu_s);
  EXPECT_GT(*all.cpu_s, *alone.cpu_s + 0.02);
  // nothing if the kernel does not count, or the folder is in memory
  if (all.disk_bytes.value_or(0) > 0) EXPECT_GE(*all.disk_bytes, 800'000u);
  EXPECT_FALSE(useOf(0).cpu_s || useWithChildren(0).disk_bytes);
}

TEST(ProcessUse, ofPostgresWantsThePidOfOne) {
  const TempFolder folder;
  const auto refused = [&](const std::string& text) {
    const auto use = standbyUse(folder.write("postmaster.pid", text));
    return use.ok() ? std::string("accepted") : use.error().message;
  };
  EXPECT_NE(refused(std::to_string(::getpid()) + "\n/data\n").find("no process of PostgreSQL"),
            std::string::npos);
  EXPECT_NE(refused("nonsense").find("no process of PostgreSQL"), std::string::npos);
  EXPECT_FALSE(standbyUse(folder.path() / "missing").ok());
}

TEST(LoadReport, listsEachProcessWithItsKnownFigures) {
  LoadResult result;
  result.options.servers = {"a", "b"};
  result.stations_at = {60, 40};
  result.samples_made = 1'000'000;
  ProcessUse nats;
  nats.name = "NATS";
  nats.messages_in = 1234;
  result.processes = {nats};
  const auto json = loadJson(result);
  EXPECT_EQ(json["station_s"], 1000);
  EXPECT_EQ(json["processes"][0]["messages_in"], 1234);
  EXPECT_TRUE(json["processes"][0]["cpu_s"].is_null());
  EXPECT_EQ(json["stations_at"], (std::vector<std::size_t>{60, 40}));
  const std::string text = loadText(result);
  EXPECT_NE(text.find("station_s               1000\n"), std::string::npos) << text;
  EXPECT_NE(text.find("verdict: "), std::string::npos) << text;
}

// a good run with the given memory and handles
LoadResult quietRun(double growth_KiB_per_min, double handles_per_min) {
  LoadResult result;
  result.options.stations = result.stations_closed = 200;
  result.options.seconds = 1800;
  for (int s = 0; s < 1800; ++s) {
    ServerRow row;
    row.time_s = s;
    row.starts = s < 600 ? 1 : 2;  // killed after ten minutes: its memory starts over
    const double min = s / 60.0;
    row.server.rss_KiB = static_cast<std::uint64_t>(
        50'000 + (s < 600 ? 3000 * min : growth_KiB_per_min * min) + 40 * std::sin(s));
    row.live_KiB = row.server.rss_KiB - 15'000;
    row.server.handles = static_cast<std::uint64_t>(227 + handles_per_min * min) - (s % 9 == 0 ? 30 : 0);
    result.rows.push_back(row);
  }
  return result;
}

TEST(SoakOfTheLoad, judgesTheLastServersMemoryAndHandles) {
  EXPECT_EQ(verdictOf(judgeLoad(quietRun(0, 0))), Verdict::kGood);
  EXPECT_EQ(verdictOf(judgeLoad(quietRun(40, 0))), Verdict::kBad);
  EXPECT_EQ(verdictOf(judgeLoad(quietRun(0, 1))), Verdict::kBad);
  LoadResult spread = quietRun(0, 0);
  for (ServerRow& row : spread.rows) row.server.rss_KiB += static_cast<std::uint64_t>(row.time_s);
  EXPECT_EQ(verdictOf(judgeLoad(spread)), Verdict::kGood) << "its live blocks lie on more pages";
  for (ServerRow& row : spread.rows) row.server.rss_KiB += 70'000;
  EXPECT_EQ(verdictOf(judgeLoad(spread)), Verdict::kBad) << "it holds far more than is live";
  LoadResult silent = quietRun(0, 0);
  for (ServerRow& row : silent.rows) row.live_KiB = 0;
  EXPECT_EQ(verdictOf(judgeLoad(silent)), Verdict::kBad) << "no one knows";
  LoadResult brief = quietRun(40, 0);
  brief.options.seconds = 899;
  EXPECT_EQ(soakForm(brief.options), SoakForm::kShort);
  EXPECT_EQ(verdictOf(judgeLoad(brief)), Verdict::kGood) << "the short form says nothing of memory";
  brief.options.seconds = 1199;
  EXPECT_EQ(soakForm(brief.options), SoakForm::kNightly);
  brief.options.faults = true;
  EXPECT_EQ(soakForm(brief.options), SoakForm::kShort)
      << "the last server may live for a quarter of an hour only";
  LoadResult lost = quietRun(0, 0);
  lost.stored.samples.lost = 1;
  EXPECT_EQ(verdictOf(judgeLoad(lost)), Verdict::kBad);
}

TEST(SoakOfTheLoad, isWrittenAsTables) {
  const TempFolder folder;
  const LoadResult result = quietRun(0, 0);
  const Status written = writeSoak(result, judgeLoad(result), folder.path());
  ASSERT_TRUE(written.ok()) << written.error().message;
  for (const char* name : {"samples.csv", "load.json", "table.txt"})
    EXPECT_TRUE(std::filesystem::exists(folder.path() / name)) << name;
}

}  // namespace
}  // namespace needlelab::test
