// Presence and frames across the servers of a lab.
#include "server/together/remote_live.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/core.h>
#include <cmath>
#include <limits>

#include "common/gesture/chunk.h"
#include "common/wire/live_frames.h"
#include "common/wire/protocol.h"
#include "server/base/log.h"
#include "tests/support/random.h"
#include "tests/support/run_form.h"
#include "tests/unit/db/planted_here.h"
#include "tests/unit/server/together/live_bus.h"

namespace needlelab {
namespace {

using test::LiveLab;
using test::LiveMessage;
using test::LiveServer;
using test::RecordingPeer;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

pb::Subscribe watchOf(std::uint32_t number, const std::string& station, double rate_hz = 0) {
  pb::Subscribe s;
  s.set_subscription(number);
  s.set_station(station);
  s.set_rate_hz(rate_hz);
  return s;
}

const std::string kLesson(16, 's');

/// 20 samples at 1 kHz, the n-th frame of a station.
pb::LiveFrame frameOfStation(std::uint64_t n) {
  std::vector<GestureSample> samples(20);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = n * 20 + i;
    samples[i].time_ns = static_cast<std::int64_t>(samples[i].tick) * kMs;
    samples[i].force_W_N[0] = 3;
    samples[i].force_W_N[2] = 4;
  }
  const Bytes data = encodeChunk(Resolution::standard(), samples);
  pb::LiveFrame frame;
  frame.set_session_id(kLesson);
  frame.set_frame_seq(n);
  frame.set_data(data.data(), data.size());
  return frame;
}

pb::StationStatus lessonOf(const std::string& trainee) {
  pb::StationStatus status;
  status.set_session_id(kLesson);
  status.set_trainee(trainee);
  status.set_exercise_id("knee");
  status.set_force_n(2.5);
  return status;
}

class RemoteLiveTest : public testing::Test {
 protected:
  RemoteLiveTest() { setLogLevel(LogLevel::kOff); }
  ~RemoteLiveTest() override { test::bugPlantedHere().reset(); }

  void sayStatus(LiveServer& server, const std::string& station, const pb::StationStatus& status) {
    ASSERT_FALSE(server.hub.onStatus(station, status, lab.time.peekNs()));
  }
  void sendFrames(LiveServer& server, const HubPeer& from, std::uint64_t first, std::uint64_t count) {
    for (std::uint64_t n = first; n < first + count; ++n)
      ASSERT_FALSE(server.hub.onLiveFrame(from, viewOf(frameOfStation(n)), lab.time.peekNs()));
    lab.bus.deliver();
  }
  void subscribe(LiveServer& server, HubPeer& viewer, const pb::Subscribe& wanted) {
    ASSERT_FALSE(server.hub.subscribe(viewer, wanted, lab.time.peekNs()));
    lab.bus.deliver();
  }

  LiveLab lab;
  LiveServer& a = lab.add("a");
  LiveServer& b = lab.add("b");
  // must be gone before the servers end
  RecordingPeer bench, other_bench, anna, bert;
  void TearDown() override {
    for (const auto& server : lab.servers) {
      for (RecordingPeer* const peer : {&bench, &other_bench}) {
        server->hub.detachStation("bench-1", *peer);
        server->hub.detachStation("bench-2", *peer);
      }
      server->hub.detachViewer(anna);
      server->hub.detachViewer(bert);
    }
  }
};

TEST_F(RemoteLiveTest, eachServerListsTheStationsOfAllWithTheirServersNames) {
  a.hub.attachStation("bench-1", bench);
  b.hub.attachStation("bench-2", other_bench);
  sayStatus(a, "bench-1", lessonOf("tina"));
  lab.run(200);
  for (LiveServer* const server : {&a, &b}) {
    const auto first = server->listed("bench-1"), second = server->listed("bench-2");
    EXPECT_TRUE(first.online());
    EXPECT_EQ(first.status().server(), "a");
    EXPECT_EQ(first.status().trainee(), "tina");
    EXPECT_EQ(first.status().force_n(), 2.5);
    EXPECT_TRUE(second.online());
    EXPECT_EQ(second.status().server(), "b");
    EXPECT_EQ(server->hub.stationsOnline(), 2u);
    EXPECT_EQ(server->hub.remoteStations(), 1u);
    EXPECT_FALSE(server->listed("bench-3").online());
  }
  EXPECT_THAT(a.remote->servers(), ElementsAre("b"));
  a.hub.detachStation("bench-1", bench);
  lab.run(150);
  EXPECT_FALSE(b.listed("bench-1").online());
  EXPECT_EQ(b.hub.stationsKnown(), 1u) << "nothing is left of it";
}

TEST_F(RemoteLiveTest, changingStatesAreSentOftenAndIdleOnesEachSecond) {
  a.hub.attachStation("bench-1", bench);
  a.hub.attachStation("bench-2", other_bench);
  lab.run(1000);
  lab.bus.passed.clear();
  for (int i = 0; i < 100; ++i) {
    pb::StationStatus status = lessonOf("tina");
    status.set_samples(static_cast<std::uint64_t>(i));
    sayStatus(a, "bench-1", status);
    lab.run(100);
  }
  std::map<std::string, int> told;
  int messages = 0;
  for (const LiveMessage& each : lab.bus.passed) {
    if (each.plane != LivePlane::kPresence || each.from != "a") continue;
    pb::Presence presence;
    ASSERT_TRUE(presence.ParseFromString(each.bytes));
    ++messages;
    for (const auto& station : presence.stations()) ++told[station.station()];
  }
  EXPECT_NEAR(messages, 100, 1);
  EXPECT_NEAR(told["bench-1"], 100, 1);
  EXPECT_NEAR(told["bench-2"], 10, 1);
}

TEST_F(RemoteLiveTest, aNewServerLearnsOfAllStationsAtOnce) {
  lab.kill(b);
  lab.run(4000);
  EXPECT_THAT(a.remote->servers(), IsEmpty());
  a.hub.attachStation("bench-1", bench);
  lab.bus.passed.clear();
  lab.run(3000);
  EXPECT_LE(lab.bus.passed.size(), 4u);
  LiveServer& c = lab.add("c");
  lab.run(100);
  EXPECT_TRUE(c.listed("bench-1").online());
}

TEST_F(RemoteLiveTest, manyStationsTakeManyMessagesOfABoundedSize) {
  std::vector<std::unique_ptr<RecordingPeer>> many;
  for (int i = 0; i < 700; ++i) {
    const std::string name = fmt::format("room-{}", i);
    many.push_back(std::make_unique<RecordingPeer>());
    a.hub.attachStation(name, *many.back());
    pb::StationStatus status = lessonOf("tina");
    status.set_trouble(std::string(400, 'x'));
    sayStatus(a, name, status);
  }
  lab.run(200);
  EXPECT_EQ(b.hub.remoteStations(), 700u);
  std::size_t largest = 0;
  for (const LiveMessage& each : lab.bus.passed) largest = std::max(largest, each.bytes.size());
  EXPECT_LE(largest, RemoteLiveSettings().presence_bytes + 256);
  EXPECT_GT(largest, RemoteLiveSettings().presence_bytes / 2);
  for (int i = 0; i < 700; ++i)
    a.hub.detachStation(fmt::format("room-{}", i), *many[static_cast<std::size_t>(i)]);
  lab.run(100);
  EXPECT_EQ(b.hub.stationsKnown(), 0u);
}

/// Whether other servers show a killed server's station as offline in time, and not too early.
void expectPresenceExpires(LiveLab& lab, LiveServer& a, LiveServer& b, bool in_time) {
  lab.run(200);
  ASSERT_TRUE(b.listed("bench-1").online());
  lab.kill(a);
  lab.run(2800);
  EXPECT_TRUE(b.listed("bench-1").online());
  lab.run(600);
  EXPECT_EQ(!b.listed("bench-1").online(), in_time);
  EXPECT_EQ(b.hub.remoteStations() == 0, in_time);
}

TEST_F(RemoteLiveTest, theStationsOfAServerThatFallsSilentAreOffline) {
  a.hub.attachStation("bench-1", bench);
  ASSERT_FALSE(b.hub.subscribe(anna, watchOf(1, "bench-1"), 0));
  expectPresenceExpires(lab, a, b, true);
  EXPECT_FALSE(anna.lastTold("bench-1").online());
  EXPECT_THAT(b.remote->servers(), IsEmpty());
  EXPECT_THAT(b.port.stations, IsEmpty()) << "no one listens to it any more";
}

TEST_F(RemoteLiveTest, presenceThatNeverExpiresIsCaught) {
  test::bugPlantedHere() = PlantedBug::kPresenceForEver;
  a.hub.attachStation("bench-1", bench);
  expectPresenceExpires(lab, a, b, false);
}

TEST_F(RemoteLiveTest, aPausedServerForgetsNoOneStillThere) {
  a.hub.attachStation("bench-1", bench);
  ASSERT_FALSE(b.hub.subscribe(anna, watchOf(1, "bench-1"), 0));
  lab.run(200);
  anna.control.clear();
  // b hangs; a's messages in the meantime wait for it
  for (int i = 0; i < 200; ++i) {
    lab.time.advance(50 * kMs);
    a.remote->step();
  }
  b.remote->step();
  EXPECT_TRUE(b.listed("bench-1").online());
  lab.run(5000);
  EXPECT_TRUE(b.listed("bench-1").online());
  EXPECT_TRUE(anna.control.empty()) << "no one was told of anything";
}

TEST_F(RemoteLiveTest, aStoppingServerAnnouncesIt) {
  a.hub.attachStation("bench-1", bench);
  lab.run(200);
  a.remote->leave();
  lab.run(50);
  EXPECT_FALSE(b.listed("bench-1").online());
  EXPECT_THAT(b.remote->servers(), IsEmpty());
}

TEST_F(RemoteLiveTest, framesAreOnTheWayOnlyWhileSomebodyWatchesElsewhere) {
  a.hub.attachStation("bench-1", bench);
  sayStatus(a, "bench-1", lessonOf("tina"));
  lab.run(200);
  subscribe(a, bert, watchOf(1, "bench-1"));
  sendFrames(a, bench, 0, 5);
  EXPECT_EQ(bert.frames().size(), 5u);
  EXPECT_EQ(lab.bus.count(LivePlane::kLive, "a"), 0u) << "who watches here needs no other server";
  a.hub.detachViewer(bert);
  EXPECT_FALSE(bench.isWatched());

  subscribe(b, anna, watchOf(1, "bench-1"));
  EXPECT_EQ(anna.lastTold("bench-1").trainee(), "tina");
  EXPECT_TRUE(bench.isWatched());
  EXPECT_EQ(a.remote->remotelyWatched(), 1u);
  sendFrames(a, bench, 5, 5);
  const auto frames = anna.frames();
  ASSERT_EQ(frames.size(), 5u);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const pb::LiveFrame sent = frameOfStation(5 + i);
    EXPECT_EQ(frames[i].station(), "bench-1");
    EXPECT_EQ(frames[i].data(), sent.data());
    EXPECT_EQ(frames[i].frame_seq(), sent.frame_seq());
    EXPECT_EQ(frames[i].session_id(), kLesson);
  }
  // however long it lasts
  for (int i = 0; i < 30; ++i) {
    lab.run(500);
    ASSERT_TRUE(bench.isWatched()) << i;
  }
  ASSERT_FALSE(b.hub.unsubscribe(anna, 1));
  lab.bus.deliver();
  EXPECT_FALSE(bench.isWatched());
  sendFrames(a, bench, 10, 5);
  EXPECT_EQ(anna.frames().size(), 5u);
  EXPECT_EQ(lab.bus.count(LivePlane::kLive, "a"), 5u);
}

TEST_F(RemoteLiveTest, theInterestOfAServerThatIsGoneEnds) {
  a.hub.attachStation("bench-1", bench);
  lab.run(200);
  subscribe(b, anna, watchOf(1, "bench-1"));
  EXPECT_TRUE(bench.isWatched());
  lab.kill(b);
  lab.run(2400);
  EXPECT_TRUE(bench.isWatched());
  lab.run(1500);
  EXPECT_FALSE(bench.isWatched());
  EXPECT_EQ(a.remote->remotelyWatched(), 0u);
}

TEST_F(RemoteLiveTest, aWaitingViewerGetsFramesFromTheArrivingStationsServer) {
  subscribe(b, anna, watchOf(1, "bench-1"));
  EXPECT_FALSE(anna.lastTold("bench-1").online());
  lab.run(200);
  a.hub.attachStation("bench-1", bench);
  lab.run(150);
  EXPECT_TRUE(anna.lastTold("bench-1").online());
  EXPECT_TRUE(bench.isWatched());
  sendFrames(a, bench, 0, 3);
  EXPECT_EQ(anna.frames().size(), 3u);
}

TEST_F(RemoteLiveTest, aSessionIsWatchedAtAnyServer) {
  pb::Subscribe wanted;
  wanted.set_subscription(1);
  wanted.set_session_id(kLesson);
  subscribe(b, anna, wanted);
  a.hub.attachStation("bench-1", bench);
  lab.run(200);
  EXPECT_FALSE(bench.isWatched());
  sayStatus(a, "bench-1", lessonOf("tina"));
  lab.run(100);
  EXPECT_TRUE(bench.isWatched());
  sendFrames(a, bench, 0, 3);
  EXPECT_EQ(anna.frames().size(), 3u);
  sayStatus(a, "bench-1", {});
  lab.run(100);
  EXPECT_FALSE(bench.isWatched());
}

TEST_F(RemoteLiveTest, overviewsHaveTheStationsOfAllServers) {
  a.hub.attachStation("bench-1", bench);
  b.hub.attachStation("bench-2", other_bench);
  subscribe(b, anna, watchOf(1, ""));
  for (int i = 0; i < 20; ++i) {
    pb::StationStatus status = lessonOf("tina");
    status.set_samples(static_cast<std::uint64_t>(i));
    sayStatus(a, "bench-1", status);
    lab.run(100);
  }
  const auto lines = std::count_if(anna.live.begin(), anna.live.end(), [](const auto& each) {
    return each.station_status().station() == "bench-1";
  });
  EXPECT_GE(lines, 17);
  EXPECT_LE(lines, 21);
  EXPECT_EQ(anna.status("bench-1").server(), "a");
}

TEST_F(RemoteLiveTest, aWatchedStationThatSendsFramesOnlyKeepsItsStatusFresh) {
  a.hub.attachStation("bench-1", bench);
  sayStatus(a, "bench-1", lessonOf("tina"));
  lab.run(200);
  for (std::uint64_t n = 0; n < 20; ++n) {
    sendFrames(a, bench, n, 1);
    lab.run(50);
  }
  EXPECT_EQ(b.listed("bench-1").status().force_n(), 5) << "of the samples";
}

TEST_F(RemoteLiveTest, aCommonRateIsReducedAtTheSource) {
  a.hub.attachStation("bench-1", bench);
  sayStatus(a, "bench-1", lessonOf("tina"));
  lab.run(200);
  RecordingPeer near;
  subscribe(a, near, watchOf(1, "bench-1", 25));
  subscribe(b, anna, watchOf(1, "bench-1", 25));
  sendFrames(a, bench, 0, 50);
  const auto here = near.frames(), there = anna.frames();
  ASSERT_EQ(here.size(), 25u);
  ASSERT_EQ(there.size(), here.size());
  for (std::size_t i = 0; i < here.size(); ++i) {
    EXPECT_EQ(there[i].data(), here[i].data());
    EXPECT_EQ(there[i].frame_seq(), i);
  }
  EXPECT_EQ(lab.bus.count(LivePlane::kLive, "a"), 25u) << "half of them on the way";

  // with one viewer of all samples everything is sent, and those with a rate continue without a gap
  RecordingPeer all;
  subscribe(b, all, watchOf(1, "bench-1"));
  sendFrames(a, bench, 50, 50);
  EXPECT_EQ(all.frames().size(), 50u);
  ASSERT_FALSE(b.hub.unsubscribe(all, 1));
  lab.bus.deliver();
  sendFrames(a, bench, 100, 50);
  const auto numbers = anna.frames();
  for (std::size_t i = 1; i < numbers.size(); ++i)
    EXPECT_EQ(numbers[i].frame_seq(), numbers[i - 1].frame_seq() + 1) << i;
  EXPECT_NEAR(static_cast<double>(numbers.size()), 75, 2);
  a.hub.detachViewer(near);
  b.hub.detachViewer(all);
}

TEST_F(RemoteLiveTest, theServerWithTheGreaterEpochHasTheStation) {
  LiveServer& c = lab.add("c");
  a.hub.attachStation("bench-1", bench, 5);
  subscribe(c, anna, watchOf(1, "bench-1"));
  subscribe(a, bert, watchOf(1, "bench-1"));
  lab.run(200);
  sayStatus(a, "bench-1", lessonOf("tina"));
  lab.run(100);
  ASSERT_EQ(c.listed("bench-1").status().server(), "a");
  sendFrames(a, bench, 0, 1);
  ASSERT_EQ(anna.frames().size(), 1u);

  // the station moves to b; a has not noticed that its connection is dead
  b.hub.attachStation("bench-1", other_bench, 6);
  lab.run(150);
  for (LiveServer* const server : {&a, &b, &c}) EXPECT_EQ(server->listed("bench-1").status().server(), "b");
  EXPECT_TRUE(other_bench.isWatched());
  sendFrames(a, bench, 1, 5);
  EXPECT_EQ(anna.frames().size(), 1u) << "what its old connection still says is no one's view";
  EXPECT_EQ(bert.frames().size(), 1u);
  sendFrames(b, other_bench, 0, 3);
  EXPECT_EQ(anna.frames().size(), 4u);
  EXPECT_EQ(bert.frames().size(), 4u) << "also where it was";

  // the old connection checks the database, and ends
  EXPECT_EQ(bench.displaced, 1);
  a.hub.detachStation("bench-1", bench);
  b.hub.detachStation("bench-1", other_bench);
  lab.run(3500);
  EXPECT_FALSE(c.listed("bench-1").online());
  // a newer one counts
  RecordingPeer again;
  a.hub.attachStation("bench-1", again, 7);
  lab.run(150);
  EXPECT_EQ(c.listed("bench-1").status().server(), "a");
  a.hub.detachStation("bench-1", again);
}

TEST_F(RemoteLiveTest, whatComesLateFromTheServerThatHadTheStationChangesNothing) {
  LiveServer& c = lab.add("c");
  a.hub.attachStation("bench-1", bench, 5);
  lab.run(200);
  // nothing from b reaches a: it still says that it has the station
  lab.bus.loses = [](const LiveMessage& message, const std::string& to) {
    return message.from == "b" && to == "a";
  };
  b.hub.attachStation("bench-1", other_bench, 6);
  for (int i = 0; i < 50; ++i) {
    lab.run(100);
    ASSERT_TRUE(c.listed("bench-1").online());
    if (i > 1) ASSERT_EQ(c.listed("bench-1").status().server(), "b") << i;
  }
  EXPECT_EQ(a.listed("bench-1").status().server(), "a") << "it does not know better";
}

// another server's claim may be wrong: a connection that the database does not end becomes active again
TEST_F(RemoteLiveTest, aDisplacedConnectionReturnsWhenTheOtherLeaves) {
  a.hub.attachStation("bench-1", bench, 5);
  b.hub.attachStation("bench-1", other_bench, 6);
  lab.run(200);
  ASSERT_EQ(a.listed("bench-1").status().server(), "b");
  b.hub.detachStation("bench-1", other_bench);
  lab.run(200);
  for (LiveServer* const server : {&a, &b}) EXPECT_EQ(server->listed("bench-1").status().server(), "a");
}

// a server that hung still says that it has the station; a database that went back has lower epochs
TEST_F(RemoteLiveTest, aGreaterEpochExpiresAfterAMinuteOfSilence) {
  LiveServer& c = lab.add("c");
  lab.bus.loses = [](const LiveMessage& message, const std::string& to) {
    return message.from == "b" && to == "a";
  };
  a.hub.attachStation("bench-1", bench, 5);
  b.hub.attachStation("bench-1", other_bench, 9);
  lab.run(300);
  ASSERT_EQ(c.listed("bench-1").status().server(), "b");
  b.hub.detachStation("bench-1", other_bench);
  lab.run(55'000);
  EXPECT_FALSE(c.listed("bench-1").online());
  lab.run(10'000);
  EXPECT_EQ(c.listed("bench-1").status().server(), "a");
}

TEST_F(RemoteLiveTest, withoutEpochsTheLastClaimWins) {
  LiveServer& c = lab.add("c");
  a.hub.attachStation("bench-1", bench);
  lab.run(200);
  b.hub.attachStation("bench-1", other_bench);
  lab.run(150);
  EXPECT_EQ(c.listed("bench-1").status().server(), "b");
  lab.run(2000);
  EXPECT_EQ(c.listed("bench-1").status().server(), "b") << "it does not go to and fro";
  EXPECT_EQ(a.listed("bench-1").status().server(), "a") << "what is connected here is here";
  b.hub.detachStation("bench-1", other_bench);
  lab.run(150);
  EXPECT_EQ(c.listed("bench-1").status().server(), "a");
}

TEST_F(RemoteLiveTest, aStationThatComesHereIsHereAtOnce) {
  a.hub.attachStation("bench-1", bench, 5);
  subscribe(b, anna, watchOf(1, "bench-1"));
  lab.run(200);
  sendFrames(a, bench, 0, 2);
  b.hub.attachStation("bench-1", other_bench, 6);
  EXPECT_TRUE(other_bench.isWatched());
  EXPECT_EQ(b.listed("bench-1").status().server(), "b");
  lab.run(100);
  EXPECT_THAT(b.port.stations, IsEmpty()) << "its frames come from its connection";
  sendFrames(b, other_bench, 0, 2);
  EXPECT_EQ(anna.frames().size(), 4u);
  EXPECT_FALSE(bench.isWatched());
}

TEST_F(RemoteLiveTest, framesOfAnotherServerAreNotPublishedAgain) {
  LiveServer& c = lab.add("c");
  a.hub.attachStation("bench-1", bench, 5);
  lab.run(200);
  subscribe(c, anna, watchOf(1, "bench-1"));
  b.hub.attachStation("bench-1", other_bench, 6);
  lab.run(150);
  // a was watched, and now receives the frames itself
  subscribe(a, bert, watchOf(1, "bench-1"));
  lab.bus.passed.clear();
  sendFrames(b, other_bench, 0, 10);
  EXPECT_EQ(lab.bus.count(LivePlane::kLive, "b"), 10u);
  EXPECT_EQ(lab.bus.count(LivePlane::kLive, "a"), 0u);
  EXPECT_EQ(anna.frames().size(), 10u);
  EXPECT_EQ(bert.frames().size(), 10u);
}

TEST_F(RemoteLiveTest, whatComesTwiceCountsOnce) {
  lab.bus.twice = true;
  a.hub.attachStation("bench-1", bench, 5);
  sayStatus(a, "bench-1", lessonOf("tina"));
  lab.run(200);
  subscribe(b, anna, watchOf(1, "bench-1"));
  sendFrames(a, bench, 0, 10);
  EXPECT_EQ(anna.frames().size(), 10u);
  EXPECT_EQ(b.remote->counters().malformed, 0u);
  EXPECT_GT(b.remote->counters().stale, 10u);
}

TEST_F(RemoteLiveTest, whatOvertookIsNotUndoneByWhatComesAfterIt) {
  a.hub.attachStation("bench-1", bench, 5);
  lab.run(200);
  subscribe(b, anna, watchOf(1, "bench-1"));
  const auto presenceOf = [&](const std::string& trainee) {
    lab.bus.passed.clear();
    sayStatus(a, "bench-1", lessonOf(trainee));
    lab.run(100);
    for (const LiveMessage& each : lab.bus.passed)
      if (each.plane == LivePlane::kPresence && each.from == "a") return each;
    return LiveMessage();
  };
  const LiveMessage older = presenceOf("tina");
  (void)presenceOf("tom");
  ASSERT_EQ(b.listed("bench-1").status().trainee(), "tom");
  b.remote->onMessage(older.plane, older.name, older.bytes);
  EXPECT_EQ(b.listed("bench-1").status().trainee(), "tom");

  lab.bus.passed.clear();
  sendFrames(a, bench, 0, 3);
  std::vector<LiveMessage> frames;
  for (const LiveMessage& each : lab.bus.passed)
    if (each.plane == LivePlane::kLive) frames.push_back(each);
  ASSERT_EQ(frames.size(), 3u);
  b.remote->onMessage(frames[1].plane, frames[1].name, frames[1].bytes);
  EXPECT_EQ(anna.frames().size(), 3u);
  // an interest that ended does not return
  LiveMessage watch;
  for (const LiveMessage& each : lab.bus.passed)
    if (each.plane == LivePlane::kWatch) watch = each;
  ASSERT_FALSE(b.hub.unsubscribe(anna, 1));
  lab.bus.deliver();
  ASSERT_FALSE(bench.isWatched());
  if (!watch.bytes.empty()) a.remote->onMessage(watch.plane, watch.name, watch.bytes);
  EXPECT_FALSE(bench.isWatched());
}

TEST_F(RemoteLiveTest, aServerThatWasStartedAgainIsAnotherOne) {
  a.hub.attachStation("bench-1", bench);
  lab.run(200);
  lab.bus.passed.clear();
  lab.run(1100);
  const LiveMessage late = lab.bus.passed.front();
  ASSERT_EQ(late.from, "a");
  lab.kill(a);
  LiveServer& again = lab.add("a", {.instance = 77});
  lab.run(50);
  EXPECT_FALSE(b.listed("bench-1").online()) << "at once: the new one has no stations yet";
  again.hub.attachStation("bench-1", other_bench);
  lab.run(150);
  EXPECT_TRUE(b.listed("bench-1").online());
  // a message of the old one that was still in transit
  const std::uint64_t stale = b.remote->counters().stale;
  b.remote->onMessage(late.plane, late.name, late.bytes);
  EXPECT_EQ(b.remote->counters().stale, stale + 1);
  EXPECT_TRUE(b.listed("bench-1").online());
}

TEST_F(RemoteLiveTest, withoutTheLinkViewersAreToldAndItReconnects) {
  a.hub.attachStation("bench-1", bench);
  sayStatus(a, "bench-1", lessonOf("tina"));
  b.hub.attachStation("bench-2", other_bench);
  lab.run(200);
  subscribe(b, anna, watchOf(1, "bench-1"));
  subscribe(b, bert, watchOf(1, ""));
  subscribe(b, anna, watchOf(2, "bench-3"));
  subscribe(b, anna, watchOf(3, "bench-2"));
  EXPECT_EQ(b.remote->trouble(), "");

  const char* const kDown = "the live connection between servers is down";
  b.disconnect();
  for (const RecordingPeer* const viewer : {&anna, &bert}) {
    EXPECT_EQ(viewer->lastTold("bench-1").trouble(), kDown);
    EXPECT_TRUE(viewer->lastTold("bench-1").online()) << "as far as is known";
    EXPECT_EQ(viewer->lastTold("bench-1").trainee(), "tina");
  }
  EXPECT_EQ(anna.lastTold("bench-3").trouble(), kDown) << "it may be there";
  EXPECT_EQ(anna.lastTold("bench-2").trouble(), "") << "what is here is here";
  EXPECT_THAT(b.remote->trouble(), HasSubstr("a test"));
  pb::Stations list;
  list.add_stations()->set_name("bench-1");
  b.hub.fillStations(list);
  EXPECT_EQ(list.live_trouble(), kDown);
  EXPECT_EQ(list.stations(0).status().trouble(), kDown);

  // for any length of time: nothing is forgotten, and lessons here continue
  lab.run(20'000);
  EXPECT_TRUE(b.listed("bench-1").online());
  sendFrames(b, other_bench, 0, 3);
  EXPECT_EQ(anna.frames().size(), 3u);
  RecordingPeer late;
  subscribe(b, late, watchOf(1, "bench-9"));
  EXPECT_EQ(late.lastTold("bench-9").trouble(), kDown);
  EXPECT_FALSE(bench.isWatched()) << "a does not hear of b any more";

  b.connect();
  lab.run(200);
  EXPECT_EQ(anna.status("bench-1").trouble(), "");
  EXPECT_EQ(anna.lastTold("bench-3").trouble(), "");
  EXPECT_EQ(late.lastTold("bench-9").trouble(), "");
  EXPECT_TRUE(bench.isWatched());
  sendFrames(a, bench, 0, 3);
  EXPECT_EQ(anna.frames().size(), 6u);

  // it existed before, but no longer does
  b.disconnect();
  a.hub.detachStation("bench-1", bench);
  lab.run(10'000);
  b.connect();
  lab.run(3500);
  EXPECT_FALSE(b.listed("bench-1").online());
  b.hub.detachViewer(late);
}

TEST_F(RemoteLiveTest, anErasedNameDisappearsOnceTheStationsServerKnows) {
  a.hub.attachStation("bench-1", bench);
  const auto lesson = lessonOf("tina");
  a.hub.onSession("bench-1", lesson.session_id(), "@7");
  sayStatus(a, "bench-1", lesson);
  lab.run(200);
  ASSERT_EQ(b.listed("bench-1").status().trainee(), "tina");
  a.hub.forgetTrainee("@7");
  lab.run(1500);
  EXPECT_EQ(b.listed("bench-1").status().trainee(), "");
}

TEST_F(RemoteLiveTest, anotherLabsMessagesAndThoseOfTheSameNameAreRefused) {
  LiveServer& foreign = lab.add("f", {.lab = "another lab"});
  foreign.hub.attachStation("bench-1", bench);
  lab.run(1500);
  EXPECT_FALSE(a.listed("bench-1").online());
  EXPECT_THAT(a.remote->servers(), ElementsAre("b"));
  EXPECT_GT(a.remote->counters().malformed, 0u);
  EXPECT_EQ(a.remote->duplicateName(), "");
  // a's own name in another program
  LiveServer twin(lab.bus, lab.time, "a", {.instance = 99});
  // the bus does not deliver to the name that sent it
  pb::Presence claim;
  claim.mutable_origin()->set_lab("lab");
  claim.mutable_origin()->set_server("a");
  claim.mutable_origin()->set_instance(99);
  claim.mutable_origin()->set_number(1);
  a.remote->onMessage(LivePlane::kPresence, "a", claim.SerializeAsString());
  EXPECT_THAT(a.remote->duplicateName(), HasSubstr("--live-name"));
  lab.run(11'000);
  EXPECT_EQ(a.remote->duplicateName(), "");
  foreign.hub.detachStation("bench-1", bench);
}

/// One message of each plane, as server b sends it to a.
std::vector<LiveMessage> oneOfEach(LiveLab& lab, LiveServer& a, LiveServer& b, RecordingPeer& bench,
                                   RecordingPeer& viewer) {
  b.hub.attachStation("bench-1", bench, 3);
  (void)b.hub.onStatus("bench-1", lessonOf("tina"), lab.time.peekNs());
  (void)a.hub.subscribe(viewer, watchOf(1, "bench-1"), 0);
  lab.run(1200);
  (void)b.hub.onLiveFrame(bench, viewOf(frameOfStation(0)), lab.time.peekNs());
  pb::Envelope stop;
  stop.mutable_stop_lesson()->set_station("bench-1");
  stop.mutable_stop_lesson()->set_from("ines");
  b.remote->deliverBy([](const auto&, const auto&, auto done) { done(std::nullopt); });
  a.remote->ask("bench-1", stop, [](RemoteLive::Asked) {});
  lab.run(200);
  std::map<LivePlane, LiveMessage> each;
  for (const LiveMessage& message : lab.bus.passed) each[message.plane] = message;
  std::vector<LiveMessage> all;
  for (auto& [plane, message] : each) all.push_back(message);
  return all;
}

TEST_F(RemoteLiveTest, anyBytesAreRefusedOrDoNoHarm) {
  keepProtobufQuiet();
  const auto seeds = oneOfEach(lab, a, b, bench, anna);
  ASSERT_EQ(seeds.size(), kLivePlanes);
  test::Random random(test::seedOr(1));
  for (int round = 0; round < 20'000; ++round) {
    LiveMessage message = seeds[random.below(seeds.size())];
    for (std::uint64_t changes = random.below(4); changes > 0 && !message.bytes.empty(); --changes) {
      const std::size_t at = random.below(message.bytes.size());
      switch (random.below(3)) {
        case 0:
          message.bytes[at] = static_cast<char>(random.bits());
          break;
        case 1:
          message.bytes.resize(at);
          break;
        default:
          message.bytes.insert(at, seeds[random.below(seeds.size())].bytes.substr(0, random.below(60)));
      }
    }
    if (random.chance(0.1)) message.plane = static_cast<LivePlane>(random.below(kLivePlanes));
    for (LiveServer* const server : {&a, &b})
      server->remote->onMessage(message.plane, message.name, message.bytes);
    if (round % 100 == 0) lab.run(50);
  }
  lab.bus.sent.clear();
  EXPECT_GT(a.remote->counters().malformed, 100u);
  lab.run(15'000);
  EXPECT_EQ(b.listed("bench-1").status().server(), "b");
  EXPECT_LE(a.hub.stationsKnown(), 2u) << "the invented entry has expired";
}

TEST_F(RemoteLiveTest, valuesThatAreNoneAndTooManyStationsAreRefused) {
  pb::Presence claim;
  std::uint64_t number = 0;
  const auto say = [&](pb::PresentStation entry) {
    claim.Clear();
    claim.mutable_origin()->set_lab("lab");
    claim.mutable_origin()->set_server("z");
    claim.mutable_origin()->set_instance(9);
    claim.mutable_origin()->set_number(++number);
    *claim.add_stations() = std::move(entry);
    a.remote->onMessage(LivePlane::kPresence, "z", claim.SerializeAsString());
  };
  const auto named = [](const std::string& name) {
    pb::PresentStation entry;
    entry.set_station(name);
    return entry;
  };
  for (const std::string& name :
       {std::string(), std::string(65, 'x'), std::string("a\nb"), std::string("\0", 1)}) {
    const auto before = a.remote->counters().malformed;
    say(named(name));
    EXPECT_EQ(a.remote->counters().malformed, before + 1) << name;
  }
  pb::PresentStation entry = named("bench-1");
  entry.mutable_status()->set_session_id("short");
  say(entry);
  EXPECT_FALSE(a.listed("bench-1").online());
  entry.mutable_status()->set_session_id(kLesson);
  entry.mutable_status()->set_trouble(std::string(5000, 'x'));
  say(entry);
  EXPECT_FALSE(a.listed("bench-1").online());
  entry.mutable_status()->clear_trouble();
  entry.mutable_status()->set_force_n(std::nan(""));
  entry.mutable_status()->set_peak_force_n(std::numeric_limits<double>::infinity());
  entry.mutable_status()->set_server("not z");
  say(entry);
  ASSERT_TRUE(a.listed("bench-1").online());
  EXPECT_EQ(a.listed("bench-1").status().force_n(), 0);
  EXPECT_EQ(a.listed("bench-1").status().peak_force_n(), 0);
  EXPECT_EQ(a.listed("bench-1").status().server(), "z");

  LiveServer& small = lab.add("small", {.max_stations = 10, .max_servers = 3});
  for (int i = 0; i < 20; ++i) {
    claim.Clear();
    claim.mutable_origin()->set_lab("lab");
    claim.mutable_origin()->set_server("z");
    claim.mutable_origin()->set_instance(9);
    claim.mutable_origin()->set_number(++number);
    *claim.add_stations() = named(fmt::format("room-{}", i));
    small.remote->onMessage(LivePlane::kPresence, "z", claim.SerializeAsString());
  }
  EXPECT_EQ(small.hub.remoteStations(), 10u);
  for (int i = 0; i < 20; ++i) {
    claim.mutable_origin()->set_server(fmt::format("z{}", i));
    small.remote->onMessage(LivePlane::kPresence, claim.origin().server(), claim.SerializeAsString());
  }
  EXPECT_EQ(small.remote->servers().size(), 3u);
}

}  // namespace
}  // namespace needlelab
