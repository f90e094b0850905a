// `run --recorded`: replays a recording in the engine and reports how far the result is from the recording.
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "client/sim/tools/recorded_run.h"
#include "common/base/files/files.h"
#include "common/gesture/chunk.h"
#include "common/gesture/recording.h"
#include "common/gesture/sample.h"
#include "common/haptics/body/path_snapshot.h"
#include "common/haptics/gate/force_gate.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/anatomy/bodies.h"
#include "tests/support/scenes/motions.h"
#include "tests/support/scenes/scenes.h"
#include "tests/support/scenes/stored_sample.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab {
namespace {

using nlohmann::json;
using test::Motion;
using test::MotionBuilder;
using test::sim;
using testing::AllOf;
using testing::HasSubstr;

constexpr double kRateHz = 1000;

const std::filesystem::path kProfile = test::kSamples / "shoulder-adult.json";

SceneModel shoulder() {
  return *compile(*sceneSpecOf(*loadProfile(kProfile)), kRateHz);
}

// 4 mm in at 12 mm/s, which arms a stop, then on at 3 mm/s, which is v_stop, with 30 µm of tremor
Motion atTheThreshold(std::uint64_t seed) {
  const test::Site site = test::defaultSite();
  MotionBuilder builder(kRateHz, site.p_surface_m - site.inward * 0.002, site.inward);
  builder.slideTo(site.p_surface_m + site.inward * 0.004, 0.012)
      .slideTo(site.p_surface_m + site.inward * 0.019, 0.003);
  return test::withTremor(builder.take(), kRateHz, 30e-6, seed);
}

// what the station records of this motion
std::vector<GestureSample> recorded(const SceneModel& model, const Motion& motion,
                                    const Resolution& resolution) {
  const auto state = std::make_unique<SimState>();
  std::vector<GestureSample> samples;
  StepReport report;
  for (std::size_t k = 0; k < motion.size(); ++k) {
    step(model, motion[k], *state, report);
    samples.push_back(test::storedSample(k, motion[k], report));
  }
  return *decodeChunk(encodeChunk(resolution, samples));
}

std::string csvOf(const std::vector<GestureSample>& samples) {
  std::string text;
  appendSampleCsvHeader(text);
  for (const GestureSample& s : samples) appendSampleCsvRow(text, s, samples.front().time_ns);
  return text;
}

std::filesystem::path recordingOf(const std::filesystem::path& file,
                                  const std::vector<GestureSample>& samples, const Resolution& resolution) {
  auto writer = RecordingWriter::create(file, "{}");
  EXPECT_TRUE(writer.ok());
  for (std::size_t at = 0; at < samples.size(); at += 1000) {
    const std::size_t count = std::min<std::size_t>(1000, samples.size() - at);
    EXPECT_TRUE(writer->append(encodeChunk(resolution, std::span(samples).subspan(at, count))).ok());
  }
  EXPECT_TRUE(writer->finish().ok());
  return file;
}

json rowOf(const std::vector<std::string>& input, const std::filesystem::path& out) {
  std::vector<std::string> line = {"run",        "--profile", kProfile.string(), "--out",
                                   out.string(), "--replace", "--json"};
  line.insert(line.end(), input.begin(), input.end());
  const auto outcome = sim(line);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  return json::parse(outcome.out).at("rows").at(0);
}

RecordedDifference differenceOf(const SceneModel& model, const std::vector<GestureSample>& samples) {
  RecordedRun run(model);
  for (const GestureSample& sample : samples) run.step(sample);
  return run.difference();
}

// ticks in which the engine alone, from the first sample on, deviates more from the recording
std::size_t differsAlone(const SceneModel& model, const std::vector<GestureSample>& samples) {
  const auto state = std::make_unique<SimState>();
  StepReport report;
  std::size_t ticks = 0;
  for (const GestureSample& s : samples) {
    step(model, test::tipOf(s), *state, report);
    const Vec3 force_W_N{s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]};
    ticks += norm(report.wrench_W.force_N - force_W_N) > kDiffers_N ? 1u : 0u;
  }
  return ticks;
}

TEST(RecordedRun, whatIsNotRoundedIsTheSameToTheBit) {
  const test::TempFolder folder;
  const SceneModel model = shoulder();
  const auto samples = recorded(model, atTheThreshold(1), Resolution::lossless());
  const auto csv = folder.write("s.csv", csvOf(samples)).string();
  const auto recording = recordingOf(folder.path() / "s.nlrec", samples, Resolution::lossless()).string();
  const json plain = rowOf({"--trajectory", csv}, folder.path() / "plain.csv");
  EXPECT_FALSE(plain.contains("differing_ticks"));
  for (const std::string& file : {csv, recording}) {
    const json row = rowOf({"--recorded", file}, folder.path() / "again.csv");
    EXPECT_EQ(row.at("hash"), plain.at("hash")) << file;
    EXPECT_EQ(row.at("ticks"), samples.size());
    EXPECT_EQ(row.at("differing_ticks"), 0);
    EXPECT_GT(row.at("compared_ticks"), 4000);
    EXPECT_EQ(row.at("max_difference_n"), 0.0);
  }
}

// one second after the engine's decision differed, the recording matches again
TEST(RecordedRun, eachSecondStartsFromTheRecordedState) {
  const SceneModel model = shoulder();
  std::size_t alone = 0, again = 0, hard = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto samples = recorded(model, atTheThreshold(seed), Resolution::standard());
    const std::size_t ticks = differsAlone(model, samples);
    alone += ticks;
    hard += ticks > 1000 ? 1u : 0u;
    again += differenceOf(model, samples).differing_ticks;
  }
  EXPECT_GE(hard, 1u) << "these gestures are not hard ones";
  EXPECT_LT(again, alone / 2);
}

TEST(RecordedRun, countsTheTicksThatDifferAndByHowMuch) {
  const SceneModel model = shoulder();
  auto samples = recorded(model, atTheThreshold(1), Resolution::lossless());
  std::vector<GestureSample*> inside;
  for (GestureSample& sample : samples)
    if (sample.layer >= 0) inside.push_back(&sample);
  // of a hundred ticks in tissue, the first is off by half a newton, two by an imperceptible amount
  inside.resize(100);
  samples.resize(static_cast<std::size_t>(inside.back() - samples.data()) + 1);
  inside[0]->force_W_N[0] += 0.5;
  inside[1]->force_W_N[1] += 0.019;
  inside[2]->force_W_N[1] += 0.019;
  auto difference = differenceOf(model, samples);
  EXPECT_EQ(difference.compared_ticks, 100u);
  EXPECT_EQ(difference.differing_ticks, 1u);
  EXPECT_EQ(difference.median_N, 0);
  EXPECT_NEAR(difference.p99_N, 0.5, 1e-12);
  EXPECT_NEAR(difference.greatest_N, 0.5, 1e-12);
  EXPECT_EQ(
      differenceText(difference),
      "ticks in tissue or with the cap on that differ by more than 0.02 N from the recorded force: 1 of 100\n"
      "difference: 0.0000 N in the median, 0.5000 N at the 99th percentile, 0.5000 N at most\n");

  // the force after the gate is not the engine's
  inside[0]->flags |= kGateThermalLimited;
  difference = differenceOf(model, samples);
  EXPECT_EQ(difference.compared_ticks, 99u);
  EXPECT_EQ(difference.gate_ticks, 1u);
  EXPECT_EQ(difference.differing_ticks, 0u);
  EXPECT_NEAR(difference.greatest_N, 0.019, 1e-12);
  EXPECT_THAT(differenceText(difference), HasSubstr("the gate changed, not compared: 1\n"));
  EXPECT_THAT(differenceText({}), HasSubstr("no tick"));
}

TEST(RecordedRun, aTickThatTheStationDidNotStepIsNotStepped) {
  const SceneModel model = shoulder();
  auto samples = recorded(model, atTheThreshold(1), Resolution::lossless());
  GestureSample repeated = samples[1000];
  repeated.flags |= kFlagNotStepped;
  samples.insert(samples.begin() + 1001, 50, repeated);
  RecordedRun run(model);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const StepReport& report = run.step(samples[k]);
    ASSERT_EQ((report.flags & kFlagNotStepped) != 0, k > 1000 && k <= 1050) << k;
  }
  EXPECT_EQ(run.difference().greatest_N, 0);
}

// the station's paths are not those that a run finds, so without them the forces differ
TEST(RecordedRun, inABodyItTakesTheRecordingsPaths) {
  const SceneModel model = *compile(test::sceneIn(test::arm()), kRateHz);
  class PathsBeside final : public PathMaker {
   public:
    explicit PathsBeside(const SceneModel& body) : in_place_(body) {}
    void ask(const PathAsk& ask) noexcept override {
      PathAsk aside = ask;
      // another path than a run finds
      aside.p_tip_W_m = aside.p_tip_W_m + Vec3{0, 3e-3, 0};
      aside.p_entry_W_m = aside.p_entry_W_m + Vec3{0, 3e-3, 0};
      in_place_.ask(aside);
    }
    bool take(PathStack*& made) noexcept override { return in_place_.take(made); }
    void retire(PathStack* path) noexcept override { in_place_.retire(path); }

   private:
    PathsInPlace in_place_;
  } paths(model);
  SceneEngine engine(model, &paths);
  std::vector<GestureSample> samples;
  std::vector<Bytes> lists(1);
  StepReport report;
  const Motion motion = test::randomGesture(11, kRateHz, test::defaultSite());
  for (std::uint64_t tick = 0; tick < motion.size(); ++tick) {
    engine.step(motion[tick], report);
    samples.push_back(test::storedSample(tick, motion[tick], report));
    const bool begins = engine.state().inside && (report.flags & (kFlagNewPath | kFlagEntry)) != 0;
    if (!begins) continue;
    ASSERT_TRUE(appendPath({tick, engine.pathInUse()}, lists.back()));
    if (lists.back().size() > 500) lists.emplace_back();  // as in the next chunk
  }
  ASSERT_GT(lists.size(), 3u);
  RecordedRun with_paths(model), without(model);
  with_paths.takePaths(lists);
  for (const GestureSample& sample : samples) {
    with_paths.step(sample);
    without.step(sample);
  }
  EXPECT_GT(with_paths.difference().compared_ticks, 1000u);
  EXPECT_EQ(with_paths.difference().greatest_N, 0);
  EXPECT_GT(without.difference().differing_ticks, 100u);
}

TEST(RecordedRun, reportsInPlainWordsAndRefusesUnusableInput) {
  const test::TempFolder folder;
  const auto samples = recorded(shoulder(), atTheThreshold(1), Resolution::standard());
  const std::string text = csvOf(samples);
  const auto csv = folder.write("s.csv", text).string();
  const auto out = (folder.path() / "o.csv").string(), profile = kProfile.string();
  const auto said = sim({"run", "--profile", profile, "--recorded", csv, "--out", out});
  EXPECT_EQ(said.code, 0) << said.err;
  EXPECT_THAT(said.out, AllOf(HasSubstr("differ by more than 0.02 N from the recorded force: "),
                              HasSubstr("median"), HasSubstr("99th percentile"), HasSubstr("at most")));
  ASSERT_TRUE(std::filesystem::remove(out));

  std::string no_wall = text;
  no_wall.replace(no_wall.find("wy_m"), 4, "wy_x");
  std::string damaged =
      *readWholeFile(recordingOf(folder.path() / "s.nlrec", samples, Resolution::standard()));
  damaged.resize(damaged.size() - 1);
  const auto wall = folder.write("wall.csv", no_wall).string();
  const auto cut = folder.write("cut.nlrec", damaged).string();
  const auto refuse = [&](std::vector<std::string> input) {
    input.insert(input.begin(), {"--profile", profile, "--out", out});
    return input;
  };
  test::expectRefused("run", {{refuse({"--recorded", wall}), {"wall.csv line 1", "'wy_m' is missing"}},
                              {refuse({}), {"--trajectory", "--recorded"}},
                              {refuse({"--recorded", csv, "--trajectory", csv}), {"--recorded"}},
                              {refuse({"--recorded", csv, "--tool", "0,0,0.1,0,0,0,1"}), {"--tool"}},
                              {refuse({"--recorded", folder.path().string() + "/none.csv"}), {"none.csv"}}});
  const auto not_whole = sim({"run", "--profile", profile, "--recorded", cut, "--out", out});
  EXPECT_NE(not_whole.code, 0);
  EXPECT_THAT(not_whole.err, HasSubstr("cut.nlrec"));
  EXPECT_FALSE(std::filesystem::exists(out));
}

}  // namespace
}  // namespace needlelab
