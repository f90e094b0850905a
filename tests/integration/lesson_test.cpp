#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <random>

#include "client/device/hand/hand_plan.h"
#include "client/device/pose_option.h"
#include "client/device/recording/recording_device.h"
#include "common/base/program.h"
#include "common/base/text/csv.h"
#include "common/haptics/geometry.h"
#include "tests/integration/lab.h"
#include "tests/support/recordings/recordings.h"
#include "tests/support/run_form.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

// A synthetic stroke through the training ball and back, with receive times that jitter like a real device's.
PoseTrack makeStroke(double seconds) {
  std::mt19937_64 random(42);
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  PoseTrack track;
  for (double t = 0; t < seconds;) {
    const double s = 0.5 - 0.5 * std::cos(2 * 3.141592653589793 * t / seconds);  // in and out
    const double angle = 3.0 + 0.1 * std::sin(2 * t);
    track.t_s.push_back(t);
    track.X_WH.push_back({{0.4 + 0.001 * std::sin(5 * t), -0.1 + 0.002 * s, 0.05 - 0.03 * s},
                          normalized(Quat{std::sin(angle / 2), 0.01, 0.02, std::cos(angle / 2)})});
    track.plunger.push_back(s > 0.9 ? 1 : 0);
    t += uniform() < 0.01 ? 0.006 * uniform() : 0.0006 + 0.0006 * uniform();
  }
  return track;
}

std::filesystem::path writeStroke(const Lab& lab, const PoseTrack& track) {
  std::string text = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw,plunger\n";
  for (std::size_t i = 0; i < track.t_s.size(); ++i) {
    char line[400];
    const Pose& X = track.X_WH[i];
    std::snprintf(line, sizeof line, "%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", track.t_s[i],
                  X.p.x, X.p.y, X.p.z, X.q.x, X.q.y, X.q.z, X.q.w, track.plunger[i]);
    text += line;
  }
  const auto file = lab.path("stroke.csv");
  std::ofstream(file) << text;
  return file;
}

const Pose kBallUnderStroke{{0.4, -0.1, 0.045}, {}};

// every stored sample is the played pose of its tick, to half a step of the stored resolution
void expectPlayed(const std::vector<GestureSample>& samples, const PoseTrack& track, double rate_hz,
                  const Pose& X_HT, std::uint64_t missed, bool whole) {
  const auto poses = resamplePoses(track, rate_hz);
  if (whole) {
    ASSERT_EQ(samples.size() + missed, poses.size());
  }
  constexpr double kHalf_m = 0.5e-6 * 1.001, kHalfQ = 0.5 * 0x1p-15 * 1.001;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const GestureSample& s = samples[i];
    ASSERT_TRUE(i == 0 || s.tick > samples[i - 1].tick) << "doubled or out of order";
    ASSERT_LT(s.tick, poses.size());
    const Pose tip = tipFromHandle(poses[s.tick], X_HT);
    const Quat q = normalized(tip.q);
    ASSERT_NEAR(s.p_WT_m[0], tip.p.x, kHalf_m) << "tick " << s.tick;
    ASSERT_NEAR(s.p_WT_m[1], tip.p.y, kHalf_m) << "tick " << s.tick;
    ASSERT_NEAR(s.p_WT_m[2], tip.p.z, kHalf_m) << "tick " << s.tick;
    ASSERT_NEAR(s.q_WT[0], q.x, kHalfQ);
    ASSERT_NEAR(s.q_WT[1], q.y, kHalfQ);
    ASSERT_NEAR(s.q_WT[2], q.z, kHalfQ);
    ASSERT_NEAR(s.q_WT[3], q.w, kHalfQ);
  }
}

class LessonTest : public testing::Test {
 protected:
  std::vector<std::string> playing(const std::filesystem::path& stroke) const {
    return {"--exercise",  "ball-free-practice",
            "--device",    "recording:" + stroke.string(),
            "--placement", poseOptionText(kBallUnderStroke)};
  }
  std::string onlySession() const {
    const auto sessions = lab_.sessions();
    EXPECT_EQ(sessions.size(), 1u);
    return sessions.empty() ? "" : sessions.front().description().session_id();
  }
  Lab lab_;
};

std::string idText(const std::string& id) {
  Uuid uuid{};
  std::copy(id.begin(), id.end(), uuid.begin());
  return uuidText(uuid);
}

TEST_F(LessonTest, aWholeLessonIsStoredVerifiedAndScored) {
  lab_.startServer();
  const PoseTrack track = makeStroke(3);
  auto station = lab_.startStation("station", playing(writeStroke(lab_, track)));
  ASSERT_EQ(station->wait(), kExitDone) << station->said();
  const auto summary = lab_.summary("station");
  ASSERT_TRUE(summary.is_object()) << station->said();
  EXPECT_EQ(summary["state"], "COMPLETE");
  EXPECT_EQ(summary["samples_acked"], summary["samples"]);
  EXPECT_EQ(summary["spool_left"], 0);
  EXPECT_EQ(summary["samples_lost"], 0);
  EXPECT_EQ(summary["score_source"], "server");
  EXPECT_TRUE(summary["score"].is_array() && !summary["score"].empty());
  EXPECT_EQ(summary["events"]["entries into the tissue"], 1);
  EXPECT_TRUE(summary["miss"]["in_target"].is_boolean()) << "the ball has a target, and the needle was in";

  const std::string id = summary["session_id"];
  const StoredSession stored = lab_.stored(id);
  EXPECT_EQ(stored.info.state(), pb::SESSION_COMPLETE);
  EXPECT_EQ(stored.info.description().trainee(), "tom");
  EXPECT_EQ(stored.info.description().profile_id(), "phantom-ball");
  EXPECT_GT(stored.info.description().profile_revision(), 0u);
  EXPECT_GT(stored.info.clock_round_trip_ns(), 0);
  EXPECT_FALSE(stored.info.score_json().empty());
  EXPECT_EQ(stored.chunks, Lab::spooledChunks(lab_.path("spool"), id));
  expectPlayed(stored.samples, track, 1000, {}, summary["missed_ticks"], true);
  EXPECT_TRUE(lab_.verifies(id));

  // and the tool's export equals the stored data, number by number
  EXPECT_EQ(lab_.stopServer(), kExitDone);
  ASSERT_EQ(lab_.admin({"session", "verify", id}), kExitDone);
  ASSERT_EQ(lab_.admin({"session", "export", id, "--every-tick", "--format", "csv", "--out",
                        lab_.path("export.csv")}),
            kExitDone);
  const std::vector<std::string> names = {"tick", "time_ns", "px_m", "py_m", "pz_m",
                                          "qx",   "qy",      "qz",   "qw",   "fz_n"};
  auto table = readCsv(lab_.path("export.csv"), names);
  ASSERT_TRUE(table.ok()) << table.error().message;
  ASSERT_EQ(table->rows(), stored.samples.size());
  const auto column = [&](std::size_t name) {
    return table->columns[static_cast<std::size_t>(table->find(names[name]))];
  };
  const auto ticks = column(0), times = column(1), px = column(2), qw = column(8), fz = column(9);
  for (std::size_t i = 0; i < table->rows(); ++i) {
    const GestureSample& s = stored.samples[i];
    ASSERT_EQ(ticks[i], static_cast<double>(s.tick));
    ASSERT_EQ(times[i], static_cast<double>(s.time_ns));
    ASSERT_EQ(px[i], s.p_WT_m[0]);
    ASSERT_EQ(qw[i], s.q_WT[3]);
    ASSERT_EQ(fz[i], s.force_W_N[2]);
  }
}

TEST_F(LessonTest, theServerIsKilledAndRestartedInMidLesson) {
  lab_.startServer();
  const PoseTrack track = makeStroke(7);
  auto station = lab_.startStation("station", playing(writeStroke(lab_, track)));
  // twice: once with chunks committed, once shortly after the restart
  ASSERT_TRUE(eventually([&] { return !lab_.sessions().empty() && lab_.sessions().front().chunks() >= 2; }))
      << station->said();
  lab_.killServer();
  std::this_thread::sleep_for(1200ms);
  lab_.startServer();
  std::this_thread::sleep_for(700ms);
  lab_.killServer();
  lab_.startServer();
  ASSERT_EQ(station->wait(), kExitDone) << station->said();
  const auto summary = lab_.summary("station");
  EXPECT_EQ(summary["state"], "COMPLETE") << station->said();
  EXPECT_EQ(summary["samples_acked"], summary["samples"]);
  EXPECT_GE(summary["connections"], 2);
  const StoredSession stored = lab_.stored(summary["session_id"]);
  EXPECT_EQ(stored.chunks, Lab::spooledChunks(lab_.path("spool"), summary["session_id"]));
  expectPlayed(stored.samples, track, 1000, {}, summary["missed_ticks"], true);
  EXPECT_TRUE(lab_.verifies(summary["session_id"]));
}

TEST_F(LessonTest, theNextStartUploadsTheRestOfAKilledLesson) {
  lab_.startServer();
  const PoseTrack track = makeStroke(20);
  auto first = lab_.startStation("first", playing(writeStroke(lab_, track)));
  ASSERT_TRUE(eventually([&] { return !lab_.sessions().empty() && lab_.sessions().front().chunks() >= 2; }))
      << first->said();
  std::this_thread::sleep_for(630ms);  // in the middle of a chunk
  first->signal(SIGKILL);
  ASSERT_EQ(first->wait(), -SIGKILL);
  const std::string id = idText(onlySession());

  // the spool as left by the crash: a copy shows what recovery must return
  std::filesystem::copy(lab_.path("spool"), lab_.path("copy"), std::filesystem::copy_options::recursive);
  std::vector<std::string> expected;
  {
    auto copy = Spool::open(lab_.path("copy"));
    ASSERT_TRUE(copy.ok());
    ASSERT_EQ((*copy)->unfinished().size(), 1u);
    expected = Lab::spooledChunks(lab_.path("copy"), id);
  }
  ASSERT_GE(expected.size(), 3u);

  // a short lesson that also uploads the old session
  auto second = lab_.startStation("second", {"--exercise", "ball-free-practice", "--seconds", "0.5"});
  ASSERT_EQ(second->wait(), kExitDone) << second->said();
  EXPECT_EQ(lab_.summary("second")["state"], "COMPLETE");
  EXPECT_EQ(lab_.summary("second")["spool_left"], 0);
  EXPECT_THAT(second->said(), HasSubstr("was cut off"));

  const StoredSession stored = lab_.stored(id);
  EXPECT_EQ(stored.info.state(), pb::SESSION_INTERRUPTED);
  EXPECT_EQ(stored.chunks, expected);
  EXPECT_TRUE(lab_.verifies(id));
  expectPlayed(stored.samples, track, 1000, {}, 0, false);
  EXPECT_LT(stored.samples.front().tick, 500u)
      << "from its beginning on, though a busy machine's loop may miss ticks";
  EXPECT_EQ(lab_.sessions().size(), 2u) << "nothing doubled";

  // and a third start has nothing left to upload
  auto third = lab_.startStation("third", {"--exercise", "ball-free-practice", "--seconds", "0.2"});
  ASSERT_EQ(third->wait(), kExitDone) << third->said();
  EXPECT_THAT(third->said(), testing::Not(HasSubstr("earlier runs")));
}

TEST_F(LessonTest, theStationIsKilledManyTimesAndNothingIsLostOrDoubled) {
  lab_.startServer();
  const int rounds = longForm() ? 50 : 3;
  std::mt19937 random(7);
  for (int round = 0; round < rounds; ++round) {
    auto station = lab_.startStation("station", {"--exercise", "ball-free-practice", "--hand-repeat", "0"});
    std::this_thread::sleep_for(std::chrono::milliseconds(300 + random() % 1500));
    station->signal(SIGKILL);
    ASSERT_TRUE(station->wait());
  }
  auto last =
      lab_.startStation("last", {"--exercise", "ball-free-practice", "--seconds", "0.3", "--drain", "30"});
  ASSERT_EQ(last->wait(), kExitDone) << last->said();
  EXPECT_EQ(lab_.summary("last")["spool_left"], 0);
  const auto sessions = lab_.sessions();
  EXPECT_GE(sessions.size(), 2u);
  for (const pb::SessionInfo& info : sessions) {
    const std::string id = idText(info.description().session_id());
    const StoredSession stored = lab_.stored(id);
    EXPECT_NE(stored.info.state(), pb::SESSION_OPEN) << id;
    EXPECT_EQ(stored.chunks, Lab::spooledChunks(lab_.path("spool"), id));
    for (std::size_t i = 1; i < stored.samples.size(); ++i)
      ASSERT_GT(stored.samples[i].tick, stored.samples[i - 1].tick);
    EXPECT_TRUE(stored.chunks.empty() || lab_.verifies(id));
  }
}

TEST_F(LessonTest, faultsOfAJumpingRecordingAreReportedAndStored) {
  lab_.startServer();
  const auto file = lab_.path("jump.csv");
  std::ofstream csv(file);
  csv << "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
  for (int k = 0; k < 2000; ++k) csv << k * 0.001 << "," << (k < 1000 ? 0 : 1) << ",0,1,0,0,0,1\n";
  csv.close();
  auto station = lab_.startStation(
      "station", {"--exercise", "ball-free-practice", "--device", "recording:" + file.string()});
  ASSERT_EQ(station->wait(), kExitFailed) << station->said();
  EXPECT_THAT(station->said(), HasSubstr("FAULT"));
  const auto summary = lab_.summary("station");
  EXPECT_THAT(std::string(summary["fault"]), HasSubstr("5 m/s"));
  const StoredSession stored = lab_.stored(summary["session_id"]);
  EXPECT_EQ(stored.info.state(), pb::SESSION_COMPLETE);
  EXPECT_EQ(stored.samples.back().fault, 2);
}

TEST_F(LessonTest, wrongInputIsRefusedWithItsExitCode) {
  lab_.startServer();
  const std::string good_key = lab_.path("station.key");
  std::ofstream(lab_.path("wrong.key")) << "station-1:" << std::string(64, '0') << "\n";
  std::ofstream(lab_.path("torn.key")) << "station-1:00";
  std::ofstream(lab_.path("bad.json")) << "{\"id\": \"x\", \"needle\": {\"length_m\": \"NaN\"}}";
  struct Case {
    std::vector<std::string> arguments;
    int code;
    std::string said;
  };
  const std::string server = lab_.stationArguments({})[1], ca = lab_.path("data") / "tls" / "ca.crt",
                    spool = lab_.path("spool");
  const std::vector<std::string> base = {"--headless", "--spool",   spool, "--seconds",
                                         "0.2",        "--trainee", "tom"};
  const std::vector<Case> cases = {
      {{"--server", server, "--ca", ca, "--key", lab_.path("wrong.key"), "--exercise", "ball-free-practice"},
       kExitFailed,
       "LOGIN"},
      {{"--server", server, "--ca", ca, "--key", lab_.path("torn.key"), "--exercise", "ball-free-practice"},
       kExitInvalid,
       "torn.key"},
      {{"--server", server, "--ca", lab_.path("none.crt"), "--key", good_key, "--exercise", "x"},
       kExitInvalid,
       "none.crt"},
      {{"--server", server, "--ca", good_key, "--key", good_key, "--exercise", "x"},
       kExitInvalid,
       "station.key"},
      {{"--server", server, "--ca", ca, "--key", good_key, "--exercise", "no-such"}, kExitFailed, "no-such"},
      {{"--server", server, "--ca", ca, "--key", good_key, "--exercise", "../../etc"},
       kExitInvalid,
       "../../etc"},
      {{"--profile", lab_.path("bad.json")}, kExitInvalid, "bad.json"},
      {{"--profile", lab_.path("none.json")}, kExitInvalid, "none.json"},
      {{"--profile", NEEDLELAB_SAMPLES "/knee-adult.json", "--device", "joystick"}, kExitInvalid, "joystick"},
      {{"--profile", NEEDLELAB_SAMPLES "/knee-adult.json", "--model", "X"}, kExitInvalid, "'X'"},
      {{"--profile", NEEDLELAB_SAMPLES "/knee-adult.json", "--spool", good_key + "/spool"},
       kExitFailed,
       "spool"},
  };
  int number = 0;
  for (const Case& wrong : cases) {
    auto arguments = base;
    if (std::find(wrong.arguments.begin(), wrong.arguments.end(), "--spool") != wrong.arguments.end())
      arguments = {"--headless", "--seconds", "0.2", "--trainee", "tom"};
    arguments.insert(arguments.end(), wrong.arguments.begin(), wrong.arguments.end());
    Process station("needlelab-station", arguments, lab_.path("wrong" + std::to_string(number++) + ".log"));
    EXPECT_EQ(station.wait(), wrong.code) << wrong.said << ": " << station.said();
    EXPECT_THAT(station.said(), HasSubstr(wrong.said));
  }
  // the server continues to serve the others
  EXPECT_EQ(lab_.startStation("good", {"--exercise", "ball-free-practice", "--seconds", "0.3"})->wait(),
            kExitDone);
}

// the four recordings, through the ball
class RecordedHand : public testing::TestWithParam<const char*> {};

TEST_P(RecordedHand, isExportedUnchanged) {
  const Recordings recordings = preferredRecordings();
  SCOPED_TRACE(recordings.name());
  const std::filesystem::path file = recordings.folder / "virtuose" / (std::string(GetParam()) + ".csv");
  const PoseTrack track = *readPoseTrack(file);

  // the ball's centre is half-way along the stroke; the needle points along the stroke there
  double length = 0, so_far = 0;
  for (std::size_t i = 1; i < track.X_WH.size(); ++i) length += norm(track.X_WH[i].p - track.X_WH[i - 1].p);
  std::size_t middle = 1, before = 0;
  for (; middle < track.X_WH.size() && so_far < length / 2; ++middle)
    so_far += norm(track.X_WH[middle].p - track.X_WH[middle - 1].p);
  while (norm(track.X_WH[middle].p - track.X_WH[before + 1].p) > 0.05) ++before;
  const Vec3 along = normalized(track.X_WH[middle].p - track.X_WH[before].p);
  const Quat to_axis = orientationAlong(along);
  const Pose X_HT{{0, 0, 0}, normalized(conjugate(track.X_WH[middle].q) * to_axis)};
  const Pose X_WL{track.X_WH[middle].p + Vec3{0, 0, 0.025}, {}};

  Lab lab;
  lab.startServer();
  auto station = lab.startStation(
      "station", {"--exercise", "ball-free-practice", "--device", "recording:" + file.string(),
                  "--tool=" + poseOptionText(X_HT), "--placement=" + poseOptionText(X_WL)});
  ASSERT_EQ(station->wait(), kExitDone) << station->said();
  const auto summary = lab.summary("station");
  EXPECT_EQ(summary["state"], "COMPLETE");
  EXPECT_GE(summary["events"].value("entries into the tissue", 0), 1) << "the ball is in the stroke's way";
  const StoredSession stored = lab.stored(summary["session_id"]);
  expectPlayed(stored.samples, track, 1000, X_HT, summary["missed_ticks"], true);
  EXPECT_LE(summary["bytes_per_sample"], 8);
  RecordProperty("bytes_per_sample", summary["bytes_per_sample"].dump());
}

INSTANTIATE_TEST_SUITE_P(Virtuose, RecordedHand, testing::ValuesIn(kPoseRecordings),
                         [](const auto& each) { return std::string(each.param); });

}  // namespace
}  // namespace needlelab::test
