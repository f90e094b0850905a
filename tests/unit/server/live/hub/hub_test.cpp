#include "server/live/hub/hub.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "common/gesture/chunk.h"
#include "common/wire/live_frames.h"
#include "tests/unit/server/live/milliseconds.h"

namespace needlelab {
namespace {

/// Stores everything it receives.
struct FakePeer : HubPeer {
  std::vector<pb::Envelope> control, live;
  std::vector<Frame> frames;
  bool elsewhere = false;
  [[nodiscard]] bool isRemote() const override { return elsewhere; }
  void sendControl(const pb::Envelope& envelope) override { control.push_back(envelope); }
  void sendLive(Frame frame, bool) override {
    live.push_back(*decodeFrame(viewOf(*frame)));
    frames.push_back(std::move(frame));
  }
  [[nodiscard]] std::size_t liveFrames() const {
    return static_cast<std::size_t>(
        std::count_if(live.begin(), live.end(), [](const auto& e) { return e.has_live_frame(); }));
  }
};

pb::Subscribe toStation(std::uint32_t number, const std::string& station, double rate_hz = 0) {
  pb::Subscribe s;
  s.set_subscription(number);
  s.set_station(station);
  s.set_rate_hz(rate_hz);
  return s;
}

/// 20 samples at 1 kHz, the n-th frame of a station.
pb::LiveFrame frameNumber(std::uint64_t n, const std::string& session = std::string(16, 's')) {
  std::vector<GestureSample> samples(20);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = n * 20 + i;
    samples[i].time_ns = static_cast<std::int64_t>(samples[i].tick) * kMs;
    samples[i].insertion_m = 0.001 * static_cast<double>(n);
    samples[i].force_W_N[0] = 3;
    samples[i].force_W_N[2] = 4;
  }
  const Bytes data = encodeChunk(Resolution::standard(), samples);
  pb::LiveFrame frame;
  frame.set_session_id(session);
  frame.set_frame_seq(n);
  frame.set_data(data.data(), data.size());
  frame.set_capture_unix_ns(static_cast<std::int64_t>(n));
  return frame;
}

bool lastWatchState(const FakePeer& station) {
  for (auto it = station.control.rbegin(); it != station.control.rend(); ++it) {
    if (it->has_watch_state()) return it->watch_state().watched();
  }
  return false;
}

TEST(Hub, aStationHearsWhetherSomebodyWatches) {
  Hub hub;
  FakePeer station, anna, bert;
  EXPECT_EQ(hub.attachStation("bench-1", station), nullptr);
  EXPECT_TRUE(station.control.empty()) << "no one watches: nothing to say";
  ASSERT_FALSE(hub.subscribe(anna, toStation(1, "bench-1"), 0));
  EXPECT_TRUE(lastWatchState(station));
  ASSERT_FALSE(hub.subscribe(bert, toStation(1, "bench-1"), 0));
  EXPECT_EQ(station.control.size(), 1u) << "a second viewer changes nothing";
  ASSERT_FALSE(hub.unsubscribe(anna, 1));
  EXPECT_TRUE(lastWatchState(station));
  hub.detachViewer(bert);
  EXPECT_FALSE(lastWatchState(station));
}

TEST(Hub, framesAreEncodedOnceAndSharedByAllViewers) {
  Hub hub;
  FakePeer station;
  std::vector<FakePeer> viewers(5);
  hub.attachStation("bench-1", station);
  for (auto& viewer : viewers) ASSERT_FALSE(hub.subscribe(viewer, toStation(1, "bench-1"), 0));
  pb::LiveFrame frame = frameNumber(3);
  frame.set_station("liar");
  frame.set_dropped_for_you(99);
  ASSERT_FALSE(hub.onLiveFrame("bench-1", frame, 0));
  for (auto& viewer : viewers) {
    ASSERT_EQ(viewer.frames.size(), 1u);
    EXPECT_EQ(viewer.frames[0].get(), viewers[0].frames[0].get());
    EXPECT_EQ(viewer.live[0].live_frame().station(), "bench-1")
        << "the server fills it, regardless of the station";
    EXPECT_EQ(viewer.live[0].live_frame().dropped_for_you(), 0u);
    EXPECT_EQ(viewer.live[0].live_frame().data(), frame.data());
  }
}

TEST(Hub, framesGoOnlyToThoseWhoAsked) {
  Hub hub;
  FakePeer one, two, anna;
  hub.attachStation("bench-1", one);
  hub.attachStation("bench-2", two);
  ASSERT_FALSE(hub.subscribe(anna, toStation(1, "bench-1"), 0));
  ASSERT_FALSE(hub.onLiveFrame("bench-2", frameNumber(0), 0));
  EXPECT_EQ(anna.liveFrames(), 0u);
  ASSERT_FALSE(hub.onLiveFrame("bench-1", frameNumber(0), 0));
  EXPECT_EQ(anna.liveFrames(), 1u);
}

TEST(Hub, aSessionCanBeWatchedAtAnyStation) {
  Hub hub;
  FakePeer station, anna;
  pb::Subscribe wanted;
  wanted.set_subscription(1);
  wanted.set_session_id(std::string(16, 'x'));
  ASSERT_FALSE(hub.subscribe(anna, wanted, 0));
  hub.attachStation("bench-1", station);
  EXPECT_FALSE(lastWatchState(station));
  hub.onSession("bench-1", std::string(16, 'x'));
  EXPECT_TRUE(lastWatchState(station));
  ASSERT_FALSE(hub.onLiveFrame("bench-1", frameNumber(0, std::string(16, 'x')), 0));
  EXPECT_EQ(anna.liveFrames(), 1u);
  // the next session is a different one
  ASSERT_FALSE(hub.onLiveFrame("bench-1", frameNumber(1, std::string(16, 'y')), 0));
  EXPECT_EQ(anna.liveFrames(), 1u);
  EXPECT_FALSE(lastWatchState(station));
  ASSERT_FALSE(hub.unsubscribe(anna, 1));
}

TEST(Hub, aLowerRateGetsFewerSamplesWithItsOwnNumbers) {
  Hub hub;
  FakePeer station, fast, slow;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(fast, toStation(1, "bench-1"), 0));
  ASSERT_FALSE(hub.subscribe(slow, toStation(1, "bench-1", 25), 0));
  // 2 s at 1 kHz; frame 60 is missing: the station's own queue dropped it
  for (std::uint64_t n = 0; n < 100; ++n) {
    if (n == 60) continue;
    ASSERT_FALSE(hub.onLiveFrame("bench-1", frameNumber(n), static_cast<std::int64_t>(n) * 20 * kMs));
  }
  EXPECT_EQ(fast.liveFrames(), 99u);
  std::vector<std::uint64_t> ticks;
  std::uint64_t gaps = 0, expected = 0;
  for (const auto& envelope : slow.live) {
    if (!envelope.has_live_frame()) continue;
    gaps += envelope.live_frame().frame_seq() - expected;
    expected = envelope.live_frame().frame_seq() + 1;
    const auto samples = decodeChunk(viewOf(envelope.live_frame().data()));
    ASSERT_TRUE(samples.ok());
    for (const auto& sample : *samples) ticks.push_back(sample.tick);
  }
  EXPECT_EQ(gaps, 1u);
  EXPECT_EQ(ticks.size(), 50u);
  for (std::size_t i = 1; i < ticks.size(); ++i) EXPECT_GT(ticks[i], ticks[i - 1]);
}

/// 1,000 samples at 1 kHz: the longest frame that a station may send.
pb::LiveFrame longFrame(std::uint64_t n) {
  std::vector<GestureSample> samples(1000);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = n * 1000 + i;
    samples[i].time_ns = static_cast<std::int64_t>(samples[i].tick) * kMs;
  }
  const Bytes data = encodeChunk(Resolution::standard(), samples);
  pb::LiveFrame frame = frameNumber(n);
  frame.set_data(data.data(), data.size());
  return frame;
}

TEST(Hub, aFrameIsDecodedOnceAndReducedOncePerRate) {
  Hub hub;
  FakePeer station;
  std::vector<FakePeer> viewers(10);
  hub.attachStation("bench-1", station);
  for (std::size_t i = 0; i < viewers.size(); ++i)
    ASSERT_FALSE(hub.subscribe(viewers[i], toStation(1, "bench-1", i % 2 == 0 ? 25 : 60), 0));
  constexpr std::uint64_t kFrames = 7;
  for (std::uint64_t n = 0; n < kFrames; ++n) ASSERT_FALSE(hub.onLiveFrame("bench-1", longFrame(n), 0));
  EXPECT_EQ(hub.framesDecoded(), kFrames);
  EXPECT_EQ(hub.framesReduced(), 2 * kFrames) << "25 Hz and 60 Hz";
  EXPECT_EQ(hub.framesOut(), 10 * kFrames);
  for (std::size_t i = 0; i < viewers.size(); ++i) {
    ASSERT_EQ(viewers[i].frames.size(), kFrames);
    EXPECT_EQ(viewers[i].frames[3].get(), viewers[i % 2].frames[3].get()) << "shared by all of a rate";
  }
  EXPECT_EQ(decodeChunk(viewOf(viewers[0].live[3].live_frame().data()))->size(), 25u);
  EXPECT_EQ(decodeChunk(viewOf(viewers[1].live[3].live_frame().data()))->size(), 60u);

  // a later viewer joins without another reduction; a rate that is no longer watched costs nothing
  FakePeer late;
  ASSERT_FALSE(hub.subscribe(late, toStation(1, "bench-1", 25), 0));
  for (std::size_t i = 1; i < viewers.size(); i += 2) hub.detachViewer(viewers[i]);
  ASSERT_FALSE(hub.onLiveFrame("bench-1", longFrame(kFrames), 0));
  EXPECT_EQ(hub.framesReduced(), 2 * kFrames + 1);
  ASSERT_EQ(late.frames.size(), 1u);
  EXPECT_EQ(late.frames[0].get(), viewers[0].frames.back().get());
}

TEST(Hub, aFrameIsReducedToFewRatesHoweverManyAreAskedFor) {
  Hub hub;
  FakePeer station;
  std::vector<FakePeer> viewers(1000);
  hub.attachStation("bench-1", station);
  for (std::size_t i = 0; i < viewers.size(); ++i)
    ASSERT_FALSE(hub.subscribe(viewers[i], toStation(1, "bench-1", static_cast<double>(i + 1)), 0));
  constexpr std::uint64_t kFrames = 2;
  for (std::uint64_t n = 0; n < kFrames; ++n) ASSERT_FALSE(hub.onLiveFrame("bench-1", longFrame(n), 0));
  EXPECT_EQ(hub.framesReduced(), 11 * kFrames) << "1, 2, 5, 10, 25, 30, 60, 100, 200, 500 and 1000 Hz";
  EXPECT_EQ(hub.framesOut(), 1000 * kFrames);
  EXPECT_EQ(decodeChunk(viewOf(viewers[58].live[0].live_frame().data()))->size(), 30u)
      << "59 Hz were asked for";
  EXPECT_EQ(viewers[58].frames[0].get(), viewers[29].frames[0].get());
}

TEST(Hub, framesAreNotDecodedForFullRateViewers) {
  Hub hub;
  FakePeer station, anna;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(anna, toStation(1, "bench-1"), 0));
  ASSERT_FALSE(hub.onLiveFrame("bench-1", longFrame(0), 0));
  EXPECT_EQ(anna.frames.size(), 1u);
  EXPECT_EQ(hub.framesIn(), 1u);
  EXPECT_EQ(hub.framesDecoded(), 0u);
  EXPECT_EQ(hub.framesReduced(), 0u);
}

TEST(Hub, aGarbageFrameReachesFullRateViewersOnly) {
  Hub hub;
  FakePeer station, fast, slow, overview;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(fast, toStation(1, "bench-1"), 0));
  ASSERT_FALSE(hub.subscribe(slow, toStation(1, "bench-1", 25), 0));
  ASSERT_FALSE(hub.subscribe(overview, toStation(1, ""), 0));
  pb::LiveFrame frame;
  frame.set_data("no chunk at all");
  ASSERT_FALSE(hub.onLiveFrame("bench-1", frame, 1000 * kMs));
  EXPECT_EQ(fast.liveFrames(), 1u);
  EXPECT_EQ(slow.liveFrames(), 0u);
}

TEST(Hub, anOversizedFrameIsRefused) {
  Hub hub;
  FakePeer station;
  hub.attachStation("bench-1", station);
  pb::LiveFrame frame;
  frame.set_data(std::string(64u << 10, 'x'));
  EXPECT_FALSE(hub.onLiveFrame("bench-1", frame, 0)) << "just as long as the limit";
  frame.set_data(std::string((64u << 10) + 1, 'x'));
  const auto refusal = hub.onLiveFrame("bench-1", frame, 0);
  ASSERT_TRUE(refusal.has_value());
  EXPECT_EQ(refusal->reason(), pb::Refusal::TOO_LARGE);
}

TEST(Hub, theMemoryOfTheCutGoesToViewersAndHasABound) {
  Hub hub;
  FakePeer station, fast;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(fast, toStation(1, "bench-1"), 0));
  pb::LiveFrame frame;
  frame.set_data("samples");
  frame.set_cut_memory(std::string(4096, 'c'));
  EXPECT_FALSE(hub.onLiveFrame("bench-1", frame, 0));
  ASSERT_EQ(fast.liveFrames(), 1u);
  frame.set_cut_memory(std::string(4097, 'c'));
  const auto refusal = hub.onLiveFrame("bench-1", frame, 0);
  ASSERT_TRUE(refusal.has_value());
  EXPECT_EQ(refusal->reason(), pb::Refusal::TOO_LARGE);
  EXPECT_THAT(refusal->text(), testing::HasSubstr("cut_memory of 4097 bytes: the limit is 4096"));
  EXPECT_EQ(fast.liveFrames(), 1u);
}

TEST(Hub, pathsInABodyGoToViewersAndHaveABound) {
  Hub hub;
  FakePeer station, fast;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(fast, toStation(1, "bench-1"), 0));
  pb::LiveFrame frame;
  frame.set_data("samples");
  frame.set_paths(std::string(32'768, 'p'));
  EXPECT_FALSE(hub.onLiveFrame("bench-1", frame, 0));
  ASSERT_EQ(fast.liveFrames(), 1u);
  frame.set_paths(std::string(32'769, 'p'));
  const auto refusal = hub.onLiveFrame("bench-1", frame, 0);
  ASSERT_TRUE(refusal.has_value());
  EXPECT_EQ(refusal->reason(), pb::Refusal::TOO_LARGE);
  EXPECT_THAT(refusal->text(), testing::HasSubstr("paths of 32769 bytes: the limit is 32768"));
  EXPECT_EQ(fast.liveFrames(), 1u);
}

TEST(Hub, aSmallFrameOfManySamplesIsRefusedBeforeAnybodyDecodesIt) {
  const auto frameOf = [](std::size_t count) {
    std::vector<GestureSample> samples(count);
    for (std::size_t i = 0; i < count; ++i) {
      samples[i].tick = i;
      samples[i].time_ns = static_cast<std::int64_t>(i) * kMs;
    }
    const Bytes data = encodeChunk(Resolution::standard(), samples);
    EXPECT_EQ(claimedSamples(data), count);
    pb::LiveFrame frame;
    frame.set_data(data.data(), data.size());
    return frame;
  };
  Hub hub;
  FakePeer station, fast, slow, overview;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(fast, toStation(1, "bench-1"), 0));
  ASSERT_FALSE(hub.subscribe(slow, toStation(1, "bench-1", 25), 0));
  ASSERT_FALSE(hub.subscribe(overview, toStation(1, ""), 0));
  for (const std::size_t count : {std::size_t{1001}, kMaxChunkSamples}) {
    const pb::LiveFrame frame = frameOf(count);
    ASSERT_LT(frame.data().size(), 64u << 10) << "the bytes alone would be let through";
    const auto refusal = hub.onLiveFrame("bench-1", frame, 1000 * kMs);
    ASSERT_TRUE(refusal) << count;
    EXPECT_EQ(refusal->reason(), pb::Refusal::TOO_LARGE);
  }
  EXPECT_TRUE(fast.live.empty() && slow.live.empty() && overview.live.empty());
  EXPECT_FALSE(hub.onLiveFrame("bench-1", frameOf(1000), 1000 * kMs));
  EXPECT_EQ(fast.liveFrames(), 1u);
  EXPECT_EQ(slow.liveFrames(), 1u);
  EXPECT_EQ(overview.live.size(), 1u);
  // Bytes that are not a chunk claim no samples, however few they are.
  const pb::LiveFrame whole = frameOf(20);
  for (std::size_t size = 0; size < 8; ++size)
    EXPECT_FALSE(claimedSamples(viewOf(whole.data()).first(size))) << size;
  EXPECT_EQ(claimedSamples(viewOf(whole.data()).first(8)), 20u);
}

TEST(Hub, aStatusThatIsTooLargeIsRefusedAndNotKept) {
  Hub hub;
  FakePeer station, anna, boss;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(boss, toStation(1, ""), 0));
  pb::StationStatus good;
  good.set_trainee("tina");
  ASSERT_FALSE(hub.onStatus("bench-1", good, 1000 * kMs));
  const auto refused = [&](const pb::StationStatus& status) {
    const auto refusal = hub.onStatus("bench-1", status, 2000 * kMs);
    return refusal ? refusal->reason() : pb::Refusal::REASON_UNSPECIFIED;
  };
  pb::StationStatus status;
  status.set_trouble(std::string(2045, 'x'));  // plus two bytes of length and one of the field's tag
  EXPECT_EQ(status.ByteSizeLong(), 2048u);
  pb::StationStatus above = status;
  above.mutable_trouble()->push_back('x');
  EXPECT_EQ(refused(above), pb::Refusal::TOO_LARGE);
  for (const std::size_t bytes : {1u, 15u, 17u, 100u, 1'000'000u}) {
    pb::StationStatus named;
    named.set_session_id(std::string(bytes, 's'));
    EXPECT_EQ(refused(named), pb::Refusal::INVALID) << bytes;
    pb::LiveFrame frame = frameNumber(0, std::string(bytes, 's'));
    const auto refusal = hub.onLiveFrame("bench-1", frame, 2000 * kMs);
    ASSERT_TRUE(refusal) << bytes;
    EXPECT_EQ(refusal->reason(), pb::Refusal::INVALID);
  }
  // No viewer receives any of it, neither now nor after a later subscription.
  ASSERT_EQ(boss.live.size(), 1u);
  ASSERT_FALSE(hub.subscribe(anna, toStation(1, "bench-1"), 0));
  EXPECT_EQ(anna.control.back().station_status().trainee(), "tina");
  EXPECT_EQ(anna.control.back().station_status().trouble(), "");
  EXPECT_EQ(anna.control.back().station_status().session_id(), "");
  EXPECT_FALSE(hub.onStatus("bench-1", status, 3000 * kMs)) << "2048 bytes are still taken";
  EXPECT_EQ(boss.live.back().station_status().trouble().size(), 2045u);
}

TEST(Hub, theLargestStatusesFitAViewersQueueAndAList) {
  Hub hub;
  std::vector<FakePeer> stations(4000);
  pb::StationStatus status;
  status.set_trouble(std::string(2000, 'x'));
  pb::Stations list;
  for (std::size_t i = 0; i < stations.size(); ++i) {
    const std::string name = "s" + std::to_string(i);
    hub.attachStation(name, stations[i]);
    ASSERT_FALSE(hub.onStatus(name, status, 0));
    list.add_stations()->set_name(name);
  }
  FakePeer boss;
  ASSERT_FALSE(hub.subscribe(boss, toStation(1, ""), 0));
  std::size_t bytes = 0;
  for (const auto& envelope : boss.control) bytes += envelope.ByteSizeLong();
  EXPECT_GT(bytes, 500'000u);
  EXPECT_LT(bytes, std::size_t{1} << 20);
  // The omitted stations follow with their next line.
  boss.live.clear();
  const std::size_t first_lines = boss.control.size() - 1;
  for (std::size_t i = 0; i < stations.size(); ++i)
    ASSERT_FALSE(hub.onStatus("s" + std::to_string(i), status, 20'000 * kMs + 1));
  EXPECT_EQ(boss.live.size(), stations.size());
  EXPECT_LT(first_lines, stations.size());
  hub.fillStations(list);
  EXPECT_LT(list.ByteSizeLong(), std::size_t{1} << 20);
  EXPECT_TRUE(std::all_of(list.stations().begin(), list.stations().end(),
                          [](const auto& info) { return info.online(); }));
}

TEST(Hub, overviewsAreSlowedByTheNumberOfStations) {
  HubSettings settings;
  settings.overview_lines_per_s = 200;
  Hub hub(settings);
  FakePeer anna;
  std::vector<FakePeer> stations(100);
  for (std::size_t i = 0; i < stations.size(); ++i) hub.attachStation("s" + std::to_string(i), stations[i]);
  ASSERT_FALSE(hub.subscribe(anna, toStation(1, ""), 0));
  EXPECT_EQ(anna.control.size(), 101u) << "at first, all of them";
  // 10 s; every station sends 10 lines per second: 10,000 lines
  pb::StationStatus status;
  for (std::int64_t t = 100; t <= 10'000; t += 100) {
    for (std::size_t i = 0; i < stations.size(); ++i)
      ASSERT_FALSE(hub.onStatus("s" + std::to_string(i), status, t * kMs));
  }
  EXPECT_NEAR(static_cast<double>(anna.live.size()), 2000, 200);
}

TEST(Hub, overviewsOfAWatchedStationComeFromItsSamples) {
  Hub hub;
  FakePeer station, anna, boss;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(anna, toStation(1, "bench-1"), 0));
  ASSERT_FALSE(hub.subscribe(boss, toStation(1, ""), 0));
  for (std::uint64_t n = 0; n < 50; ++n)
    ASSERT_FALSE(
        hub.onLiveFrame("bench-1", frameNumber(n), 1000 * kMs + static_cast<std::int64_t>(n) * 20 * kMs));
  EXPECT_NEAR(static_cast<double>(boss.live.size()), 10, 1);
  const auto& status = boss.live.back().station_status();
  EXPECT_NEAR(status.force_n(), 5, 1e-3);
  EXPECT_NEAR(status.insertion_m(), 0.045, 0.0051);
  EXPECT_EQ(boss.liveFrames(), 0u);
}

TEST(Hub, aLessonsPeakRisesWithItsSamplesAndEndsWithIt) {
  Hub hub;
  FakePeer station, viewer;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(viewer, toStation(1, ""), 0));
  pb::StationStatus status;
  status.set_session_id(std::string(16, 's'));
  status.set_peak_force_n(2);
  status.add_hazards_touched("nerve");
  status.set_tissue("muscle");
  ASSERT_FALSE(hub.onStatus("bench-1", status, kMs));
  pb::Stations stations;
  stations.add_stations()->set_name("bench-1");
  const auto known = [&] {
    hub.fillStations(stations);
    return stations.stations(0).status();
  };
  EXPECT_EQ(known().peak_force_n(), 2);
  // a frame of 5 N between two status lines: hypot(3, 4)
  FakePeer close_up;
  ASSERT_FALSE(hub.subscribe(close_up, toStation(1, "bench-1"), 0));
  ASSERT_FALSE(hub.onLiveFrame("bench-1", frameNumber(1), 200 * kMs));
  EXPECT_NEAR(known().peak_force_n(), 5, 1e-3);
  EXPECT_EQ(known().hazards_touched_size(), 1) << "what only the station knows stays";
  hub.onSession("bench-1", std::string(16, 't'));
  EXPECT_EQ(known().peak_force_n(), 0);
  EXPECT_EQ(known().hazards_touched_size(), 0);
  EXPECT_EQ(known().tissue(), "");
}

TEST(Hub, noStatusNamesAnErasedTraineeUntilANamesakesSession) {
  Hub hub;
  FakePeer one, two, anna;
  const auto statusOf = [](char session, const std::string& trainee) {
    pb::StationStatus status;
    status.set_session_id(std::string(16, session));
    status.set_trainee(trainee);
    return status;
  };
  const auto shownIn = [&hub] {
    pb::Stations stations;
    stations.add_stations()->set_name("bench-1");
    hub.fillStations(stations);
    return stations.stations(0).status().trainee();
  };
  const auto said = [&hub](const std::string& station) {
    FakePeer viewer;
    EXPECT_FALSE(hub.subscribe(viewer, toStation(1, station), 0));
    hub.detachViewer(viewer);
    return viewer.control.back().station_status().trainee();
  };
  hub.attachStation("bench-1", one);
  hub.attachStation("bench-2", two);
  for (const char* station : {"bench-1", "bench-2"})
    ASSERT_FALSE(hub.subscribe(anna, toStation(station[6] == '1' ? 1 : 2, station), 0));
  hub.onSession("bench-1", std::string(16, 's'), "@7");
  hub.onSession("bench-2", std::string(16, 'r'), "@7");
  ASSERT_FALSE(hub.onStatus("bench-1", statusOf('s', "tom"), 0));
  ASSERT_FALSE(hub.onStatus("bench-2", statusOf('r', "tom"), 0));
  hub.detachStation("bench-2", two);
  EXPECT_EQ(said("bench-1"), "tom");
  EXPECT_EQ(said("bench-2"), "tom");

  const std::size_t before = anna.control.size();
  hub.forgetTrainee("@7");
  EXPECT_TRUE(hub.isErased("@7"));
  ASSERT_EQ(anna.control.size(), before + 2) << "viewers are told";
  for (std::size_t i = before; i < anna.control.size(); ++i)
    EXPECT_EQ(anna.control[i].station_status().trainee(), "");
  EXPECT_EQ(said("bench-1"), "");
  EXPECT_EQ(said("bench-2"), "") << "gone, but watched";
  EXPECT_EQ(shownIn(), "");
  // the station continues its lesson, also after its network was away
  for (int i = 0; i < 2; ++i) {
    ASSERT_FALSE(hub.onStatus("bench-1", statusOf('s', "tom"), 0));
    EXPECT_EQ(anna.live.back().station_status().trainee(), "");
    EXPECT_EQ(shownIn(), "");
    hub.attachStation("bench-1", one);
  }
  ASSERT_FALSE(hub.onStatus("bench-1", statusOf('t', "ben"), 0));
  EXPECT_EQ(shownIn(), "ben");
  // another tom, whose session the server stores
  hub.onSession("bench-1", std::string(16, 'u'), "@8");
  ASSERT_FALSE(hub.onStatus("bench-1", statusOf('u', "tom"), 0));
  EXPECT_EQ(shownIn(), "tom");
  // erased before the session's first status
  hub.forgetTrainee("@8");
  ASSERT_FALSE(hub.onStatus("bench-1", statusOf('u', "tom"), 0));
  EXPECT_EQ(shownIn(), "");
}

TEST(Hub, thePeakIsTheStationsOrTheLargestSeen) {
  Hub hub;
  FakePeer station;
  hub.attachStation("bench-1", station);
  pb::Stations stations;
  stations.add_stations()->set_name("bench-1");
  const auto peak_N = [&](char session, double force_N, double own_peak_N) {
    pb::StationStatus status;
    status.set_session_id(std::string(session == 0 ? 0 : 16, session));
    status.set_force_n(force_N);
    status.set_peak_force_n(own_peak_N);
    EXPECT_FALSE(hub.onStatus("bench-1", status, kMs));
    hub.fillStations(stations);
    return stations.stations(0).status().peak_force_n();
  };
  // also without viewers
  EXPECT_EQ(peak_N('s', 2.5, 0), 2.5);
  EXPECT_EQ(peak_N('s', 0.5, 0), 2.5);
  EXPECT_EQ(peak_N('t', 1, 0), 1) << "another session has its own";
  EXPECT_EQ(peak_N(0, 0, 0), 0) << "idle";
  // the station's own peak, from before this server watched
  EXPECT_EQ(peak_N('u', 1, 6.5), 6.5);
  EXPECT_EQ(peak_N('u', 7, 6.5), 7) << "the force of this moment counts, too";
  EXPECT_EQ(peak_N('v', 0, 0), 0) << "a lesson that has just begun";
  EXPECT_EQ(peak_N('v', std::nan(""), 0), 0);
}

TEST(Hub, aLateFrameDoesNotPassThePeakOn) {
  Hub hub;
  FakePeer station, overview;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(overview, toStation(1, ""), 0));
  pb::StationStatus status;
  status.set_session_id(std::string(16, 's'));
  status.set_peak_force_n(9);
  ASSERT_FALSE(hub.onStatus("bench-1", status, kMs));
  // 5 N, from the next lesson
  ASSERT_FALSE(hub.onLiveFrame("bench-1", frameNumber(1, std::string(16, 't')), 200 * kMs));
  pb::Stations stations;
  stations.add_stations()->set_name("bench-1");
  hub.fillStations(stations);
  EXPECT_NEAR(stations.stations(0).status().peak_force_n(), 5, 1e-3);
}

TEST(Hub, theNewestConnectionOfAStationCounts) {
  Hub hub;
  FakePeer older, newer, anna;
  hub.attachStation("bench-1", older);
  ASSERT_FALSE(hub.subscribe(anna, toStation(1, "bench-1"), 0));
  EXPECT_EQ(hub.attachStation("bench-1", newer), &older);
  EXPECT_TRUE(lastWatchState(newer));
  hub.detachStation("bench-1", older);  // the older one ends late: nothing changes
  EXPECT_EQ(hub.stationsOnline(), 1u);
  EXPECT_EQ(hub.stationPeer("bench-1"), &newer);
}

TEST(Hub, aFrameOfAStationThatIsGoneReachesNoViewer) {
  Hub hub;
  FakePeer station, anna;
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(anna, toStation(1, "bench-1"), 0));
  hub.detachStation("bench-1", station);
  EXPECT_FALSE(hub.onLiveFrame("bench-1", frameNumber(0), 0)) << "known, but not connected";
  EXPECT_FALSE(hub.onLiveFrame("bench-2", frameNumber(0), 0)) << "unknown";
  EXPECT_EQ(anna.liveFrames(), 0u);
}

// What a session's viewers look up must not be a station that is forgotten (memory; under ASan).
TEST(Hub, aForgottenStationIsNoLongerFoundByItsSession) {
  Hub hub;
  FakePeer station, other, anna;
  const std::string session(16, 'x');
  hub.attachStation("bench-1", station);
  hub.onSession("bench-1", session);
  hub.detachStation("bench-1", station);
  hub.attachStation("bench-2", other);
  hub.onSession("bench-2", session);
  pb::Subscribe wanted;
  wanted.set_subscription(1);
  wanted.set_session_id(session);
  ASSERT_FALSE(hub.subscribe(anna, wanted, 0));
  EXPECT_TRUE(lastWatchState(other));
  ASSERT_FALSE(hub.onLiveFrame("bench-2", frameNumber(0, session), 0));
  EXPECT_EQ(anna.liveFrames(), 1u);
}

// Another server's claim about a station may be wrong; the database ends a connection that was really
// overtaken.
TEST(Hub, aConnectionThatOneElsewhereHasDisplacedIsBackWhenThatEnds) {
  Hub hub;
  FakePeer here, newer, ines;
  FakePeer elsewhere;
  elsewhere.elsewhere = true;
  hub.attachStation("bench-1", here, 3);
  ASSERT_FALSE(hub.subscribe(ines, toStation(1, "bench-1"), 0));
  EXPECT_EQ(hub.attachStation("bench-1", elsewhere, 9), &here);
  hub.detachStation("bench-1", elsewhere);
  EXPECT_EQ(hub.stationPeer("bench-1"), &here);
  EXPECT_EQ(hub.epochOf("bench-1"), 3u);
  EXPECT_TRUE(lastWatchState(here));
  // not if it has ended in the meantime, or a newer connection to this server has replaced it
  hub.attachStation("bench-1", elsewhere, 9);
  hub.detachStation("bench-1", here);
  hub.detachStation("bench-1", elsewhere);
  EXPECT_EQ(hub.stationPeer("bench-1"), nullptr);
  hub.attachStation("bench-1", here, 3);
  hub.attachStation("bench-1", elsewhere, 9);
  hub.attachStation("bench-1", newer, 10);
  hub.attachStation("bench-1", elsewhere, 11);
  hub.detachStation("bench-1", elsewhere);
  EXPECT_EQ(hub.stationPeer("bench-1"), &newer);
  EXPECT_EQ(hub.stationsOnline(), 1u);
}

TEST(Hub, wrongSubscriptionsAreRefusedByName) {
  Hub hub;
  FakePeer anna;
  EXPECT_EQ(hub.subscribe(anna, toStation(1, "s", -1), 0)->reason(), pb::Refusal::INVALID);
  EXPECT_EQ(hub.subscribe(anna, toStation(1, "s", std::nan("")), 0)->reason(), pb::Refusal::INVALID);
  EXPECT_EQ(hub.subscribe(anna, toStation(1, std::string(1000, 's')), 0)->reason(), pb::Refusal::INVALID);
  auto both = toStation(1, "s");
  both.set_session_id(std::string(16, 'x'));
  EXPECT_EQ(hub.subscribe(anna, both, 0)->reason(), pb::Refusal::INVALID);
  ASSERT_FALSE(hub.subscribe(anna, toStation(1, "s"), 0));
  EXPECT_EQ(hub.subscribe(anna, toStation(1, "t"), 0)->reason(), pb::Refusal::CONFLICT);
  EXPECT_EQ(hub.subscribe(anna, toStation(2, "s"), 0)->reason(), pb::Refusal::CONFLICT);
  EXPECT_EQ(hub.unsubscribe(anna, 9)->reason(), pb::Refusal::NOT_FOUND);
}

TEST(Hub, subscriptionsOfOneViewerAreBounded) {
  HubSettings settings;
  settings.max_subscriptions = 3;
  Hub hub(settings);
  FakePeer anna;
  for (std::uint32_t i = 0; i < 3; ++i)
    ASSERT_FALSE(hub.subscribe(anna, toStation(i, "s" + std::to_string(i)), 0));
  EXPECT_EQ(hub.subscribe(anna, toStation(9, "s9"), 0)->reason(), pb::Refusal::TOO_LARGE);
}

/// A viewer like a connection: its live queue is read from time to time.
struct QueuedPeer : HubPeer {
  explicit QueuedPeer(std::int64_t age_ns) : queue(age_ns, 1u << 20) {}
  LiveQueue queue;
  std::int64_t now_ns = 0;
  void sendControl(const pb::Envelope&) override {}
  void sendLive(Frame frame, bool counted) override { queue.push(std::move(frame), counted, now_ns); }
};

TEST(Hub, aSlowViewerLosesOnlyItsOwnFrames) {
  Hub hub;
  FakePeer station;
  QueuedPeer slow(100 * kMs), fast(100 * kMs);
  hub.attachStation("bench-1", station);
  ASSERT_FALSE(hub.subscribe(slow, toStation(1, "bench-1"), 0));
  ASSERT_FALSE(hub.subscribe(fast, toStation(1, "bench-1"), 0));
  std::size_t fast_got = 0, slow_got = 0;
  for (std::uint64_t n = 0; n < 500; ++n) {
    const std::int64_t now = static_cast<std::int64_t>(n) * 20 * kMs;
    slow.now_ns = fast.now_ns = now;
    ASSERT_FALSE(hub.onLiveFrame("bench-1", frameNumber(n), now));
    while (fast.queue.pop(now)) ++fast_got;
    // The slow viewer reads one frame for every five that arrive.
    if (n % 5 == 4 && slow.queue.pop(now)) ++slow_got;
    EXPECT_LE(slow.queue.bytes(), 10'000u);
  }
  EXPECT_EQ(fast_got, 500u);
  EXPECT_EQ(fast.queue.dropped(), 0u);
  EXPECT_EQ(slow_got, 100u);
  EXPECT_NEAR(static_cast<double>(slow.queue.dropped()), 400, 6);
}

}  // namespace
}  // namespace needlelab
