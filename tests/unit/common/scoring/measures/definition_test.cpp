// A measure's definition is fixed: the table matches the README, and results do not change within a version.
#include <gtest/gtest.h>

#include <cinttypes>
#include <cstdlib>
#include <set>

#include "common/base/files/files.h"
#include "common/gesture/chunk.h"
#include "common/gesture/recording.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/motion/dtw.h"
#include "tests/unit/common/scoring/continuous_gesture.h"

namespace needlelab {
namespace {

const std::string kGestureFolder = NEEDLELAB_SCORING_DATA;
constexpr int kGoldenGestures = 3;

std::string golden(int number) {
  return kGestureFolder + "/gesture-" + std::to_string(number) + ".nlrec";
}

TEST(MeasureTable, isTheOneInTheReadme) {
  const auto readme = readWholeFile(NEEDLELAB_SCORING_README, 1u << 20);
  ASSERT_TRUE(readme.ok());
  EXPECT_NE(readme->find(measureTableMarkdown()), std::string::npos)
      << "put this into common/scoring/README.md:\n"
      << measureTableMarkdown();
}

TEST(MeasureTable, everyRowOfAScoreIsInItInItsOrder) {
  const ContinuousGesture gesture(3);
  const pb::Exercise exercise = plannedExercise();
  const auto score = scoreGesture(gesture.samples(500), 500, gesture.profile(), {}, &exercise,
                                  std::vector<TipPath>{tipPathOf(gesture.samples(500), 500, {})});
  const MeasureKind* last = nullptr;
  for (const Measure& row : score) {
    const MeasureKind* const kind = measureKind(row.name);
    ASSERT_NE(kind, nullptr) << row.name;
    EXPECT_EQ(row.unit, kind->unit);
    EXPECT_TRUE(last == nullptr || kind >= last) << row.name << " stands in another place in the table";
    last = kind;
  }
}

TEST(MeasureTable, namesAreOnceAndUnitsAreInThem) {
  std::set<std::string_view> names;
  for (const MeasureKind& kind : measureKinds()) {
    EXPECT_TRUE(names.insert(kind.name).second) << kind.name;
    EXPECT_FALSE(kind.definition.empty());
    EXPECT_LE(kind.name.size(), 64u) << "the longest that a requirement may name";
    const std::string suffix = kind.unit == "m"     ? "_m"
                               : kind.unit == "s"   ? "_s"
                               : kind.unit == "N"   ? "_n"
                               : kind.unit == "m/s" ? "_m_s"
                               : kind.unit == "m^2" ? "_m2"
                               : kind.unit == "J"   ? "_j"
                               : kind.unit == "rad" ? "_rad"
                                                    : "";
    EXPECT_TRUE(kind.name.ends_with(suffix)) << kind.name;
  }
  EXPECT_EQ(measureKind("peak_force_layer_K_n"), nullptr);
  EXPECT_EQ(measureWords("peak_force_layer_13_n"), "Peak force in layer 13");
  const std::vector<std::string> layers = {"skin", "dura"};
  EXPECT_EQ(measureWords("peak_force_layer_2_n", layers), "Peak force in dura");
  EXPECT_EQ(measureWords("mean_force_layer_1_n", layers), "Mean force in skin");
  EXPECT_EQ(measureWords("peak_force_layer_3_n", layers), "Peak force in layer 3") << "the profile has two";
  EXPECT_EQ(measureWords("entries", layers), "Entries");
  EXPECT_EQ(measureWords("entries"), "Entries");
  EXPECT_EQ(measureWords("of no kind"), "of no kind");
  EXPECT_EQ(measureKind("mean_force_layer_3_n")->name, "mean_force_layer_K_n");
  EXPECT_EQ(betterOf("mean_force_layer_3_n"), Better::kLess);
  EXPECT_EQ(betterOf("no such thing"), Better::kNeither);
}

/// FNV-1a over names and values rounded to seven digits: this detects every change of a definition, but not
/// the differences between compilers and C libraries.
std::uint64_t hashOf(const std::vector<Measure>& score, std::uint64_t hash) {
  for (const Measure& row : score) {
    char text[96];
    const double value = std::abs(row.value) < 1e-9 ? 0 : row.value;
    std::snprintf(text, sizeof text, "%s=%.7g %s;", row.name.c_str(), value, row.unit.c_str());
    for (const char* c = text; *c != '\0'; ++c)
      hash = (hash ^ static_cast<unsigned char>(*c)) * 1099511628211u;
  }
  return hash;
}

TEST(Definition, resultsOverCommittedGesturesAreThoseOfTheVersion) {
  // one line per version, oldest first: never change one; add one for the next version
  struct Golden {
    std::uint32_t version;
    std::uint64_t hash;
  };
  constexpr Golden kGolden[] = {{2, 0x776e140e1821d363},
                                {3, 0xaf07763e88679d6a},
                                // without a plan the rows are those of version 3
                                {4, 0xaf07763e88679d6a},
                                {5, 0x4dd8381adb1a80e9},
                                {6, 0x72c3c92e5b005096},
                                // the profile's targets name no tissues
                                {7, 0x72c3c92e5b005096},
                                // the profile has no landmark
                                {8, 0x72c3c92e5b005096},
                                // depths in a body; the profile has layers
                                {9, 0x72c3c92e5b005096},
                                {10, 0x72c3c92e5b005096},
                                // no tick of these gestures enters or leaves on the end of a step
                                {11, 0x72c3c92e5b005096},
                                // time from the first contact; layers that the tip was never in
                                {12, 0xc7ebb23ee52841f5}};
  if (std::getenv("NEEDLELAB_WRITE_GESTURES") != nullptr) {
    for (int i = 1; i <= kGoldenGestures; ++i) {
      auto writer = RecordingWriter::create(golden(i), "{}");
      ASSERT_TRUE(writer.ok());
      const auto samples = ContinuousGesture(static_cast<std::uint64_t>(100 + i)).samples(200 + 100 * i);
      ASSERT_TRUE(writer->append(encodeChunk(Resolution{}, samples)).ok());
      ASSERT_TRUE(writer->finish().ok());
    }
  }
  std::uint64_t hash = 14695981039346656037u;
  std::vector<TipPath> references;
  for (int i = 1; i <= kGoldenGestures; ++i) {
    const auto recording = RecordingReader::open(golden(i));
    ASSERT_TRUE(recording.ok()) << recording.error().message;
    const auto samples = recording->allSamples();
    ASSERT_TRUE(samples.ok());
    const ContinuousGesture made(static_cast<std::uint64_t>(100 + i));
    const double rate_hz = 200 + 100 * i;
    hash = hashOf(scoreGesture(*samples, rate_hz, made.profile(), {}, nullptr, references), hash);
    references.push_back(tipPathOf(*samples, rate_hz, {}));
  }
  const Golden& newest = std::end(kGolden)[-1];
  ASSERT_EQ(newest.version, kScoreDefinitionVersion) << "a new version needs a line in kGolden";
  char text[32];
  std::snprintf(text, sizeof text, "0x%016" PRIx64, hash);
  EXPECT_EQ(hash, newest.hash)
      << "the scores of the committed gestures changed, to " << text
      << ": if that was meant, raise kScoreDefinitionVersion (measure_rows.cpp) and add a "
         "line here, so that stored "
         "sessions can be scored again; if not, it is a fault";
}

TEST(Definition, errorsAgainstAPlanAreThoseOfTheVersion) {
  // from the formulas in measures_in_tissue.cpp, by a Python script using the reader in
  // tests/durability/judge
  struct Errors {
    double entry_m, angle_rad, mean_m, largest_m;
  };
  constexpr Errors kErrors[kGoldenGestures] = {
      {0.003612018658, 0.1113410143, 0.003980459987, 0.005456239209},
      {0.003654412187, 0.1113410143, 0.004172846160, 0.006143142053},
      {0.003625012141, 0.1113410143, 0.004462903288, 0.006519230691}};
  const pb::Exercise exercise = plannedExercise();
  for (int i = 1; i <= kGoldenGestures; ++i) {
    const auto recording = RecordingReader::open(golden(i));
    ASSERT_TRUE(recording.ok()) << recording.error().message;
    const auto samples = recording->allSamples();
    ASSERT_TRUE(samples.ok());
    const ContinuousGesture made(static_cast<std::uint64_t>(100 + i));
    const auto score = scoreGesture(*samples, 200 + 100 * i, made.profile(), {}, &exercise);
    const Errors& expected = kErrors[i - 1];
    EXPECT_NEAR(valueOf(score, "planned_entry_error_m"), expected.entry_m, 1e-10);
    EXPECT_NEAR(valueOf(score, "planned_angle_error_rad"), expected.angle_rad, 1e-9);
    EXPECT_NEAR(valueOf(score, "mean_planned_line_error_m"), expected.mean_m, 1e-10);
    EXPECT_NEAR(valueOf(score, "largest_planned_line_error_m"), expected.largest_m, 1e-10);
  }
}

TEST(ScoreJson, survivesARoundTrip) {
  const ContinuousGesture gesture(5);
  pb::Exercise exercise;
  auto& requirement = *exercise.add_requirements();
  requirement.set_measure("peak_force_n");
  requirement.set_max(2);
  exercise.add_requirements()->set_measure("dtw_distance_m");
  exercise.mutable_requirements(1)->set_max(0.01);
  const auto score = scoreGesture(gesture.samples(500), 500, gesture.profile(), {}, &exercise);
  const auto back = parseScore(scoreJson(score));
  ASSERT_TRUE(back.ok());
  ASSERT_EQ(back->size(), score.size());
  for (std::size_t i = 0; i < score.size(); ++i) {
    EXPECT_EQ((*back)[i].name, score[i].name);
    EXPECT_EQ((*back)[i].value, score[i].value) << "bit for bit";
    EXPECT_EQ((*back)[i].measured, score[i].measured);
    EXPECT_EQ((*back)[i].passed, score[i].passed);
    EXPECT_EQ((*back)[i].max, score[i].max);
    EXPECT_EQ((*back)[i].words, score[i].words);
  }
  for (const char* const wrong : {"", "{}", "[1]", "[{\"measure\":1}]", "nonsense"})
    EXPECT_FALSE(parseScore(wrong).ok()) << wrong;
}

}  // namespace
}  // namespace needlelab
