#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/text/csv.h"
#include "common/gesture/chunk.h"
#include "common/gesture/recording.h"
#include "common/gesture/sample.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/motion/dtw.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab {
namespace {

using nlohmann::json;
using test::sim;
using testing::HasSubstr;

// straight down from 10 mm above the skin to `depth_m`, a second of rest, and back out; 40 mm/s
std::string strokeCsv(double depth_m) {
  std::string text = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
  const double way_s = (depth_m + 0.01) / 0.04;
  for (int k = 0; k * 1e-3 <= 2 * way_s + 1; ++k) {
    const double t = k * 1e-3;
    const double down = t < way_s ? 0.04 * t : t < way_s + 1 ? 0.04 * way_s : 0.04 * (2 * way_s + 1 - t);
    appendNumber(text, t);
    text += ",0,0,";
    appendNumber(text, 0.01 - down);
    text += ",1,0,0,0\n";
  }
  return text;
}

double valueOf(const json& whole, const std::string& measure) {
  for (const auto& row : whole.at("rows"))
    if (row.at("measure") == measure) return row.at("value");
  return std::nan("");
}

TEST(ScoreCommand, warnsOfANeedleThatEntersHubFirst) {
  const test::TempFolder folder;
  std::string csv = strokeCsv(0.03);
  const auto score = [&](const std::string& text) {
    const auto file = folder.write("t.csv", text);
    return sim({"score", "--profile", (test::kSamples / "paper-1dof.json").string(), "--trajectory",
                file.string(), "--json"});
  };
  EXPECT_EQ(score(csv).err.find("points out of the skin"), std::string::npos);
  for (std::size_t at = csv.find(",1,0,0,0\n"); at != std::string::npos; at = csv.find(",1,0,0,0\n", at))
    csv.replace(at, 9, ",0,0,0,1\n");
  const auto outcome = score(csv);
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("warning: row 25"));
  EXPECT_THAT(outcome.err, HasSubstr("180° from straight in"));
}

TEST(ScoreCommand, measuresAStrokeThatIsKnown) {
  const test::TempFolder folder;
  const auto trajectory = folder.write("t.csv", strokeCsv(0.03));
  const auto outcome = sim({"score", "--profile", (test::kSamples / "paper-1dof.json").string(),
                            "--trajectory", trajectory.string(), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json whole = json::parse(outcome.out);
  EXPECT_EQ(whole.at("version"), programVersion());
  EXPECT_FALSE(whole.at("machine").get<std::string>().empty());
  EXPECT_NEAR(valueOf(whole, "elapsed_s"), 3, 0.002);
  EXPECT_NEAR(valueOf(whole, "path_length_m"), 0.08, 1e-3);
  EXPECT_NEAR(valueOf(whole, "time_in_tissue_s"), 1 + 2 * 0.03 / 0.04, 0.01);
  EXPECT_NEAR(valueOf(whole, "peak_force_n"), 1, 1e-6);
  EXPECT_EQ(valueOf(whole, "entries"), 1);
  EXPECT_EQ(valueOf(whole, "target_reached"), 1);
}

TEST(ScoreCommand, aTableForPeopleAndAFileForPrograms) {
  const test::TempFolder folder;
  const auto trajectory = folder.write("t.csv", strokeCsv(0.02)).string();
  const auto profile = (test::kSamples / "paper-1dof.json").string();
  const auto table = sim({"score", "--profile", profile, "--trajectory", trajectory});
  EXPECT_EQ(table.code, 0);
  EXPECT_THAT(table.out, HasSubstr("peak_force_n"));
  const auto file = folder.path() / "score.json";
  const auto to_file =
      sim({"score", "--profile", profile, "--trajectory", trajectory, "--json", file.string()});
  EXPECT_EQ(to_file.code, 0);
  EXPECT_EQ(to_file.out, "");
  EXPECT_EQ(valueOf(json::parse(*readWholeFile(file)), "entries"), 1);
}

TEST(ScoreCommand, comparesWithReferences) {
  const test::TempFolder folder;
  const auto trajectory = folder.write("t.csv", strokeCsv(0.03)).string();
  const auto other = folder.write("o.csv", strokeCsv(0.02)).string();
  const auto profile = (test::kSamples / "paper-1dof.json").string();
  const auto distance = [&](std::vector<std::string> more) {
    std::vector<std::string> line = {"score", "--profile", profile, "--trajectory", trajectory, "--json"};
    line.insert(line.end(), more.begin(), more.end());
    const auto outcome = sim(line);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return valueOf(json::parse(outcome.out), "dtw_distance_m");
  };
  EXPECT_EQ(distance({"--reference", trajectory}), 0);
  EXPECT_GT(distance({"--reference", other}), 1e-3);
  EXPECT_EQ(distance({"--reference", other, "--reference", trajectory}), 0);

  const auto above = folder.write("a.csv", strokeCsv(-0.005)).string();
  const auto refused = sim({"score", "--profile", profile, "--trajectory", trajectory, "--reference", above});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("never in tissue"));
}

TEST(ScoreCommand, scoresARecordingUnchanged) {
  // Samples as a device records them give the same score, bit for bit, as a recording, as exported CSV, and
  // directly through the server's code.
  std::vector<GestureSample> samples(3000);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    GestureSample& s = samples[i];
    const double t = static_cast<double>(i) * 1e-3, depth = -0.01 + 0.04 * std::sin(t);
    s.tick = 17 + i;
    s.time_ns = static_cast<std::int64_t>(i) * 1'000'000;
    s.p_WT_m[0] = 1e-3 * std::sin(7 * t), s.p_WT_m[2] = -depth;
    s.q_WT[0] = 1, s.q_WT[3] = 0;
    s.layer = depth > 0 ? 0 : -1;
    s.insertion_m = std::max(0.0, depth);
    s.force_W_N[0] = 0.1 * std::cos(3 * t), s.force_W_N[2] = depth > 0 ? 1 + t / 3 : 0;
    s.plunger = std::min(1.0, t / 2);
  }
  const auto loaded = loadProfile(test::kSamples / "paper-1dof.json");
  ASSERT_TRUE(loaded.ok());
  const TipPath path = tipPathOf(samples, 1000, {});
  const auto expected = scoreGesture(samples, 1000, *loaded, {}, nullptr, std::span(&path, 1));

  const test::TempFolder folder;
  std::string text;
  appendSampleCsvHeader(text);
  for (const GestureSample& s : samples) appendSampleCsvRow(text, s, 0);
  const auto csv = folder.write("samples.csv", text).string();
  const auto recording = (folder.path() / "session.nlrec").string();
  auto writer = RecordingWriter::create(recording, "{}");
  ASSERT_TRUE(writer.ok());
  ASSERT_TRUE(writer->append(encodeChunk(Resolution::lossless(), samples)).ok());
  ASSERT_TRUE(writer->finish().ok());

  for (const std::string& file : {csv, recording}) {
    const auto outcome = sim({"score", "--profile", (test::kSamples / "paper-1dof.json").string(),
                              "--recorded", file, "--reference", file, "--json"});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const json whole = json::parse(outcome.out);
    EXPECT_EQ(whole.at("definition_version"), kScoreDefinitionVersion);
    ASSERT_EQ(whole.at("rows").size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_EQ(whole.at("rows")[i].at("measure"), expected[i].name);
      EXPECT_EQ(whole.at("rows")[i].at("value").get<double>(), expected[i].value) << expected[i].name;
    }
  }
  // exactly one of the two options, and complete rows
  const auto profile = (test::kSamples / "paper-1dof.json").string();
  EXPECT_EQ(sim({"score", "--profile", profile}).code, 2);
  EXPECT_EQ(sim({"score", "--profile", profile, "--recorded", csv, "--trajectory", csv}).code, 2);
  std::string broken = text;
  broken.replace(broken.rfind(",0,0,0"), 6, ",0,0.5,0");
  const auto refused =
      sim({"score", "--profile", profile, "--recorded", folder.write("b.csv", broken).string()});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("line 3001"));
}

TEST(ScoreCommand, aDamagedRecordingIsRefusedOrScoredWithItsHolesNamed) {
  std::vector<GestureSample> samples(3000);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = 17 + i;
    samples[i].time_ns = static_cast<std::int64_t>(i) * 1'000'000;
    samples[i].p_WT_m[2] = -0.04 * std::sin(1e-3 * static_cast<double>(i));
    samples[i].q_WT[0] = 1, samples[i].q_WT[3] = 0;
  }
  const test::TempFolder folder;
  const auto recording = folder.path() / "session.nlrec";
  auto writer = RecordingWriter::create(recording, "{}");
  ASSERT_TRUE(writer.ok());
  for (std::size_t at = 0; at < samples.size(); at += 1000)
    ASSERT_TRUE(
        writer->append(encodeChunk(Resolution::standard(), std::span(samples).subspan(at, 1000))).ok());
  ASSERT_TRUE(writer->finish().ok());
  std::string bytes = *readWholeFile(recording);
  const auto offset = RecordingReader::open(recording)->entries()[1].offset;
  bytes[offset + 5] = static_cast<char>(bytes[offset + 5] ^ 1);
  bytes.resize(bytes.size() - 1);
  const auto damaged = folder.write("damaged.nlrec", bytes).string();

  const auto profile = (test::kSamples / "paper-1dof.json").string();
  const auto refused = sim({"score", "--profile", profile, "--recorded", damaged});
  EXPECT_NE(refused.code, 0);
  EXPECT_EQ(refused.out, "") << "no measure of a part may pass for the whole's";
  EXPECT_THAT(refused.err, testing::AllOf(HasSubstr("damaged.nlrec"), HasSubstr("ticks 1017 to 2016"),
                                          HasSubstr("2000 samples"), HasSubstr("--damaged")));
  const auto scored = sim({"score", "--profile", profile, "--recorded", damaged, "--damaged", "--json"});
  ASSERT_EQ(scored.code, 0) << scored.err;
  EXPECT_THAT(scored.err, HasSubstr("damaged: " + damaged + ": ticks 1017 to 2016"));
  EXPECT_THAT(json::parse(scored.out).at("holes").at(0).get<std::string>(), HasSubstr("ticks 1017 to 2016"));
  EXPECT_EQ(sim({"score", "--profile", profile, "--trajectory", damaged, "--damaged"}).code, 2);
}

TEST(ScoreCommand, checksAnExercisesRequirements) {
  const test::TempFolder folder;
  const auto trajectory = folder.write("t.csv", strokeCsv(0.02)).string();
  const auto profile = (test::kSamples / "paper-1dof.json").string();
  const auto exercise = folder.write("e.json", R"({"id": "e", "name": "Gently", "profile_id": "paper-1dof",
      "requirements": [{"measure": "peak_force_n", "max": 0.5}, {"measure": "entries", "max": 1}]})");
  const auto outcome = sim(
      {"score", "--profile", profile, "--trajectory", trajectory, "--exercise", exercise.string(), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  int checked = 0;
  const json whole = json::parse(outcome.out);
  for (const auto& row : whole.at("rows")) {
    if (!row.contains("passed")) continue;
    EXPECT_EQ(row.at("passed"), row.at("measure") == "entries");
    ++checked;
  }
  EXPECT_EQ(checked, 2);
}

TEST(ScoreCommand, measuresAgainstTheExercisesPlan) {
  const test::TempFolder folder;
  const auto trajectory = folder.write("t.csv", strokeCsv(0.02)).string();
  const auto profile = (test::kSamples / "paper-1dof.json").string();
  // 3 and 4 mm beside the stroke, which goes straight down at (0, 0)
  const auto scoredWith = [&](const std::string& z) {
    const auto exercise = folder.write("e.json", R"({"id": "e", "name": "Planned", "profile_id": "paper-1dof",
        "plan": {"frame": "LIMB", "entry_m": {"x": 0.003, "y": 0.004, "z": )" +
                                                     z + R"(}, "direction": {"x": 0, "y": 0, "z": -5}}})");
    return sim({"score", "--profile", profile, "--trajectory", trajectory, "--exercise", exercise.string(),
                "--json"});
  };
  const auto outcome = scoredWith("0");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json whole = json::parse(outcome.out);
  EXPECT_NEAR(valueOf(whole, "planned_entry_error_m"), 0.005, 1e-9);
  const auto refused = scoredWith("0.01");
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("e.json: plan.entry_m: (3, 4, 10) mm is 10 mm above the skin"));
}

TEST(ScoreCommand, tellsWhatTheSyringeDidByThePlungerColumn) {
  const test::TempFolder folder;
  // down to 30 mm at 40 mm/s, 8 s of rest with aspiration and injection
  std::string text = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw,plunger\n";
  for (int k = 0; k <= 9000; ++k) {
    const double t = k * 1e-3;
    const double plunger = t < 3   ? 0.2
                           : t < 4 ? 0.2 - 0.1 * (t - 3)
                           : t < 5 ? 0.1
                                   : std::min(0.9, 0.1 + 0.4 * (t - 5));
    appendNumber(text, t);
    text += ",0,0,";
    appendNumber(text, 0.01 - std::min(0.04, 0.04 * t));
    text += ",1,0,0,0,";
    appendNumber(text, plunger);
    text += "\n";
  }
  const auto profile = (test::kSamples / "paper-1dof.json").string();
  const auto trajectory = folder.write("t.csv", text).string();
  const auto outcome = sim({"score", "--profile", profile, "--trajectory", trajectory, "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json whole = json::parse(outcome.out);
  ASSERT_EQ(whole.at("events").size(), 2u);
  const json& aspiration = whole.at("events")[0];
  EXPECT_EQ(aspiration.at("event"), "ASPIRATION");
  const json& injection = whole.at("events")[1];
  EXPECT_EQ(injection.at("event"), "INJECTION");
  EXPECT_NEAR(injection.at("end_s").get<double>(), 7, 0.03);
  const auto said = sim({"score", "--profile", profile, "--trajectory", trajectory});
  EXPECT_THAT(said.out, HasSubstr("injection of 80 % at 5.0 s"));
}

TEST(ScoreCommand, aTrajectoryThatJumpsIsNoGesture) {
  const test::TempFolder folder;
  std::string text = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
  for (int k = 0; k < 20; ++k)
    text += std::to_string(k * 1e-3) + (k < 10 ? ",0,0,0.5,1,0,0,0\n" : ",0,0,-0.01,1,0,0,0\n");
  const auto outcome = sim({"score", "--profile", (test::kSamples / "paper-1dof.json").string(),
                            "--trajectory", folder.write("t.csv", text).string(), "--json"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("row 16"));  // five rejected samples after the jump in row 11
  EXPECT_THAT(outcome.err, HasSubstr("jumped"));
  EXPECT_EQ(outcome.out, "");
}

TEST(ScoreCommand, refusesWrongInputAsRunDoes) {
  const test::TempFolder folder;
  const auto outcome = sim({"score", "--profile", (test::kSamples / "paper-1dof.json").string(),
                            "--trajectory", folder.write("t.csv", "t_s\n0\n").string()});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("'px_m'"));
}

}  // namespace
}  // namespace needlelab
