// Force curves from untrusted files.
#include "common/curves/curve_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "tests/support/recordings/recordings.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using test::TempFolder;
using testing::HasSubstr;

/// One row per 0.5 mm, 100 N/m.
std::string rows(int count, const std::string& behind = "", double step_m = 5e-4) {
  std::string text;
  for (int i = 0; i < count; ++i)
    text += std::to_string(i * step_m) + "," + std::to_string(100 * i * step_m) + behind + "\n";
  return text;
}

const std::string kHeader = "depth_m,force_n,specimen,needle,tissue,speed_m_s\n";
const std::string kWords = ",s1,18G,liver,0.003";

/// Rows of one phase, 10 ms apart, from 5 mm on in steps of `step_m` (an insertion: up to 5 mm, from the
/// surface on).
std::string phaseRows(const std::string& phase, int from, int count, double step_m = 0) {
  std::string text;
  for (int i = 0; i < count; ++i)
    text += phase + "," + std::to_string((from + i) * 0.01) + "," +
            std::to_string(phase == "insert" ? i * 0.005 / (count - 1) : 0.005 + i * step_m) + "," +
            std::to_string(0.1 * (from + i)) + kWords + "\n";
  return text;
}

std::string faultOf(const TempFolder& folder) {
  const auto set = readCurveSet(folder.path());
  if (set.ok()) return "no fault";
  EXPECT_EQ(set.error().code, ErrorCode::kInvalidInput);
  return set.error().message;
}

TEST(CurveSet, columnsSayAllThatIsKnown) {
  const TempFolder folder;
  folder.write("b.csv", kHeader + rows(10, kWords) + rows(11, ",s2,20G,liver,0.003"));
  folder.write("a.csv",
               "\xEF\xBB\xBF force_n , depth_m,remark,specimen,needle,tissue,speed_m_s\r\n"
               "0,0,x,s0,18G,gel,0.01\r\n1,0.001,,s0,18G,gel,0.01\r\n2,0.002,y,s0,18G,gel,0.01\r\n\r\n"
               "4,0.004,,s0,18G,gel,0.01\r\n3,0.0037,,s0,18G,gel,0.01\r\n5,0.005,,s0,18G,gel,0.01\r\n"
               "6,0.006,,s0,18G,gel,0.01\r\n7,0.007,,s0,18G,gel,0.01");
  const auto set = readCurveSet(folder.path());
  ASSERT_TRUE(set.ok()) << set.error().message;
  ASSERT_EQ(set->curves.size(), 3u);
  EXPECT_EQ(set->curves[0].tissue, "gel");
  EXPECT_EQ(set->curves[0].speed_mps, 0.01);
  // the row that goes back is sorted in, with its force
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_DOUBLE_EQ(set->curves[0].depth_m[i], i == 3 ? 0.0037 : 0.001 * static_cast<double>(i));
    EXPECT_DOUBLE_EQ(set->curves[0].force_N[i], static_cast<double>(i));
  }
  EXPECT_EQ(set->curves[1].specimen, "s1");
  EXPECT_EQ(set->curves[2].needle, "20G");
  EXPECT_EQ(set->licence, "not said");
}

TEST(CurveSet, recedingRowsAreAWithdrawalADigitisationOrRefused) {
  const TempFolder folder;
  const auto write = [&](const std::vector<double>& depths_mm, bool digitised = false) {
    std::string text = "depth_m,force_n,specimen,needle,tissue,speed_m_s\n";
    for (const double depth : depths_mm) text += std::to_string(depth / 1000) + ",1,s0,18G,gel,0.01\n";
    folder.write("a.csv", text);
    return readCurveSet(folder.path(), {}, {.digitised = digitised});
  };
  const auto back = write({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0});
  ASSERT_TRUE(back.ok()) << back.error().message;
  EXPECT_EQ(back->curves[0].depth_m.size(), 10u);
  EXPECT_EQ(back->curves[0].withdrawal.depth_m.size(), 9u);
  EXPECT_THAT(back->notes.back(), testing::HasSubstr("1 of 1 curves were split"));
  const std::vector<double> any_order = {0, 1, 2, 3, 9, 5, 6, 7, 8, 4, 10, 11};
  const auto mixed = write(any_order);
  ASSERT_FALSE(mixed.ok());
  EXPECT_THAT(mixed.error().message, testing::HasSubstr("row 6 is at 0.005 m after 0.009 m"));
  const auto points = write(any_order, true);
  ASSERT_TRUE(points.ok()) << points.error().message;
  EXPECT_DOUBLE_EQ(points->curves[0].depth_m[4], 0.004);
  EXPECT_THAT(points->notes.front(), testing::HasSubstr("is digitised"));
}

TEST(CurveSet, timeTimesSpeedIsDepthFromTheFirstRowOnWhereItSaysWhereTheNeedleStops) {
  const TempFolder folder;
  std::string text = "t_s,force_n,specimen,needle,tissue,speed_m_s\n";
  for (int i = 0; i < 20; ++i) text += std::to_string(5 + 0.1 * i) + ",1" + kWords + "\n";
  folder.write("time.csv", text);
  EXPECT_THAT(faultOf(folder),
              testing::AllOf(HasSubstr("where the needle stops or turns"), HasSubstr("'phase'"),
                             HasSubstr("'depth_m'"), HasSubstr("'insertion_s'")));
  folder.write("data_set.json", R"({"curves": [{"file": "time.csv", "insertion_s": 1.25}]})");
  const auto set = readCurveSet(folder.path());
  ASSERT_TRUE(set.ok()) << set.error().message;
  ASSERT_EQ(set->curves[0].depth_m.size(), 13u) << "rows up to 1.25 s after the first";
  for (std::size_t i = 0; i < 13; ++i)
    EXPECT_NEAR(set->curves[0].depth_m[i], 0.0003 * static_cast<double>(i), 1e-9);
}

TEST(CurveSet, namesInCapitalsAndTextsAreReadAndWhatIsLeftOutIsNamed) {
  const TempFolder folder;
  folder.write("A.CSV", kHeader + rows(10, kWords));
  folder.write("b.TXT", kHeader + rows(11, kWords));
  folder.write("README.txt", "two insertions, \"by hand\n");
  folder.write("._A.CSV", "\x05\x16\x07");
  folder.write("photo.jpg", "x");
  const auto set = readCurveSet(folder.path());
  ASSERT_TRUE(set.ok()) << set.error().message;
  EXPECT_EQ(set->curves.size(), 2u);
  EXPECT_THAT(set->notes, testing::UnorderedElementsAre(HasSubstr("2 of 5 files in the folder are left out"),
                                                        HasSubstr("README.txt is omitted")));
  EXPECT_THAT(set->notes[0], HasSubstr("._A.CSV, photo.jpg"));
}

TEST(CurveSet, curvesWithTheSameNumbersCountOnceUnderAnyName) {
  const TempFolder folder;
  folder.write("a (1).csv", kHeader + rows(10, kWords));
  folder.write("a.csv", kHeader + rows(10, kWords));
  folder.write("other.csv", kHeader + rows(10, ",s9,18G,liver,0.003"));
  folder.write("b.csv", kHeader + rows(11, kWords));
  const auto set = readCurveSet(folder.path());
  ASSERT_TRUE(set.ok()) << set.error().message;
  EXPECT_EQ(set->curves.size(), 2u);
  EXPECT_THAT(set->notes.back(),
              testing::AllOf(HasSubstr("2 of 4"), HasSubstr("a (1).csv is a copy of a.csv"),
                             HasSubstr("other.csv is a copy of a.csv")));
}

// From 5 mm above the skin to 20 mm below it in steps of 0.25 mm: 1 N/mm in tissue, on a zero that goes from
// `first_N` on by `drift_N`.
std::string withZero(double first_N, double drift_N) {
  std::string text = kHeader;
  for (int i = 0; i <= 100; ++i) {
    const double depth_m = -0.005 + 0.00025 * i, noise_N = i % 2 == 0 ? 0.01 : -0.01;
    text += std::to_string(depth_m) + "," +
            std::to_string(400 * std::max(0.0, depth_m) + first_N + drift_N * i / 100 + noise_N) + kWords +
            "\n";
  }
  return text;
}

TEST(CurveSet, aSensorThatWasNotTaredIsNamedAndTaredOnDemand) {
  const struct {
    double first_N, drift_N;
    std::string said;
  } cases[] = {{0.8, 0, "0.80 N"}, {-0.5, 0.42, "the zero drifts by 0.4"}};
  for (const auto& one : cases) {
    const TempFolder folder;
    folder.write("a.csv", withZero(one.first_N, one.drift_N));
    const auto as_it_is = readCurveSet(folder.path()),
               tared = readCurveSet(folder.path(), {}, {.tare = true});
    ASSERT_TRUE(as_it_is.ok() && tared.ok());
    EXPECT_THAT(as_it_is->notes.back(),
                testing::AllOf(HasSubstr(one.said), HasSubstr("--tare takes it off")));
    EXPECT_THAT(tared->notes.back(), HasSubstr("it is taken off"));
    const ForceCurve& curve = tared->curves[0];
    for (std::size_t i = 0; i < curve.depth_m.size(); ++i)
      EXPECT_NEAR(curve.force_N[i], 400 * std::max(0.0, curve.depth_m[i]), 0.05) << i;
  }
  const TempFolder folder;
  folder.write("a.csv", withZero(0, 0));
  EXPECT_THAT(readCurveSet(folder.path())->notes, testing::IsEmpty()) << "a tared sensor is not named";
}

TEST(CurveSet, aForceBeyondNeedlesIsTakenOnlyWithItsUnit) {
  const TempFolder folder;
  folder.write("a.csv", kHeader + rows(10, kWords) + "0.01,36" + kWords + "\n");
  EXPECT_THAT(faultOf(folder), testing::AllOf(HasSubstr("line 12"), HasSubstr("gram-force"),
                                              HasSubstr("0.353039 N"), HasSubstr("--force-unit")));
  EXPECT_EQ(readCurveSet(folder.path(), {}, {.force_unit_N = 1})->curves[0].force_N.back(), 36);
  EXPECT_NEAR(readCurveSet(folder.path(), {}, {.force_unit_N = 9.80665e-3})->curves[0].force_N.back(),
              0.3530394, 1e-12);
}

TEST(CurveSet, lettersOfAnotherEncodingMatterOnlyInWordsThatAreRead) {
  const TempFolder folder;
  const std::string header = kHeader.substr(0, kHeader.size() - 1) +
                             ",temperature [\xb0"
                             "C]\n";
  folder.write("a.csv", header + rows(10, kWords + ",21"));
  EXPECT_TRUE(readCurveSet(folder.path()).ok());
  folder.write("a.csv", kHeader + rows(10, ",K\xf6hler,18G,liver,0.003"));
  EXPECT_THAT(faultOf(folder),
              testing::AllOf(HasSubstr("line 2"), HasSubstr("specimen"), HasSubstr("--encoding")));
  EXPECT_EQ(readCurveSet(folder.path(), {}, {.encoding = TextEncoding::kWindows1252})->curves[0].specimen,
            "Köhler");
}

TEST(CurveSet, depthAndTimeTogetherGiveTheSpeed) {
  const TempFolder folder;
  std::string text = "t_s,depth_m,force_n,specimen,needle,tissue\n";
  for (int i = 0; i < 20; ++i)
    text += std::to_string(0.1 * i) + "," + std::to_string(0.0005 * i) + ",1,s1,18G,liver\n";
  folder.write("both.csv", text);
  const auto set = readCurveSet(folder.path());
  ASSERT_TRUE(set.ok()) << set.error().message;
  EXPECT_NEAR(set->curves[0].speed_mps, 0.005, 1e-9);
}

TEST(CurveSet, phasesAreReadFromTheirColumn) {
  const TempFolder folder;
  folder.write("one.csv", "phase,t_s," + kHeader + phaseRows("insert", 0, 11) + phaseRows("hold", 11, 50) +
                              phaseRows("withdraw", 61, 10, -5e-4));
  const auto set = readCurveSet(folder.path());
  ASSERT_TRUE(set.ok()) << set.error().message;
  const ForceCurve& curve = set->curves.at(0);
  EXPECT_EQ(curve.force_N.size(), 11u);
  EXPECT_EQ(curve.speed_mps, 0.003) << "as the column says";
  EXPECT_EQ(curve.hold.depth_m, 0.005);
  ASSERT_EQ(curve.hold.t_s.size(), 50u);
  EXPECT_EQ(curve.hold.t_s.front(), 0);
  EXPECT_NEAR(curve.hold.t_s.back(), 0.49, 1e-9);
  EXPECT_EQ(curve.hold.force_N.front(), 1.1);
  // sorted by depth: the last row first
  ASSERT_EQ(curve.withdrawal.depth_m.size(), 10u);
  EXPECT_NEAR(curve.withdrawal.depth_m.front(), 0.0005, 1e-12);
  EXPECT_EQ(curve.withdrawal.force_N.front(), 7);
  EXPECT_NEAR(curve.withdrawal.speed_mps, 0.05, 1e-9);
}

TEST(CurveSet, phasesAreRecognisedFromDepthOverTime) {
  const TempFolder folder;
  // 10 mm in 2 s, 3 s of rest with 20 µm of tremor, 10 mm out in 1 s; one row per 20 ms
  std::string text = "t_s,depth_m,force_n,specimen,needle,tissue\n";
  for (int i = 0; i <= 300; ++i) {
    const double t = 0.02 * i;
    const double depth = t <= 2 ? 0.005 * t : t <= 5 ? 0.01 - (i % 2) * 2e-5 : 0.01 - 0.01 * (t - 5);
    text +=
        std::to_string(t) + "," + std::to_string(depth) + "," + std::to_string(0.01 * i) + ",s1,18G,liver\n";
  }
  folder.write("all.csv", text);
  const auto set = readCurveSet(folder.path());
  ASSERT_TRUE(set.ok()) << set.error().message;
  const ForceCurve& curve = set->curves.at(0);
  EXPECT_NEAR(curve.speed_mps, 0.005, 1e-4);
  EXPECT_NEAR(curve.hold.t_s.back(), 3, 0.05);
  EXPECT_NEAR(curve.hold.depth_m, 0.01, 1e-4);
  EXPECT_NEAR(curve.withdrawal.speed_mps, 0.01, 1e-4);
  EXPECT_NEAR(static_cast<double>(curve.withdrawal.depth_m.size()), 50, 2);
  EXPECT_NEAR(static_cast<double>(curve.depth_m.size()), 100, 2);
}

TEST(CurveSet, aTurningPointIsNoHoldABriefReversalNoWithdrawal) {
  const TempFolder folder;
  std::string text = "t_s,depth_m,force_n,specimen,needle,tissue\n";
  for (int i = 0; i <= 100; ++i)
    text += std::to_string(0.02 * i) + "," + std::to_string(1e-4 * (i == 100 ? 97 : i)) + ",1,s1,18G,liver\n";
  folder.write("in.csv", text);
  const auto set = readCurveSet(folder.path());
  ASSERT_TRUE(set.ok()) << set.error().message;
  EXPECT_EQ(set->curves.at(0).depth_m.size(), 101u);
  EXPECT_TRUE(set->curves[0].hold.t_s.empty());
  EXPECT_TRUE(set->curves[0].withdrawal.depth_m.empty());
}

TEST(CurveSet, aDescriptionGivesWhatColumnsOmit) {
  const TempFolder folder;
  folder.write("one.csv", "depth_m,force_n\n" + rows(10));
  folder.write("other.csv", "height\n1\n");
  folder.write("data_set.json", R"({"name": "gels", "licence": "CC-BY-4.0", "curves": [{"file": "one.csv",
      "specimen": "g1", "needle": "18G", "needle_diameter_m": 0.00127, "tissue": "gel", "speed_m_s": 0.003}]})");
  const auto set = readCurveSet(folder.path());
  ASSERT_TRUE(set.ok()) << set.error().message;
  EXPECT_EQ(set->name, "gels");
  EXPECT_EQ(set->licence, "CC-BY-4.0");
  ASSERT_EQ(set->curves.size(), 1u);
  EXPECT_EQ(set->curves[0].diameter_m, 0.00127);
  ASSERT_EQ(set->notes.size(), 2u);
  EXPECT_THAT(set->notes[1], HasSubstr("other.csv is omitted: it says nothing of force_n"));
}

TEST(CurveSet, aKnownDataSetNeedsNoDescription) {
  for (const test::Recordings& recordings : test::allRecordings()) {
    const auto set = readCurveSet(recordings.folder / "needle_force");
    ASSERT_TRUE(set.ok()) << set.error().message;
    ASSERT_EQ(set->curves.size(), 1u) << "of the other files neither depth nor speed is known";
    EXPECT_EQ(set->curves[0].force_N.size(), 371u);
    EXPECT_EQ(set->curves[0].speed_mps, 0.003);
    EXPECT_THAT(set->notes[0], HasSubstr("built in"));
    const bool has_others = std::ranges::any_of(
        std::filesystem::directory_iterator(recordings.folder / "needle_force"), [](const auto& file) {
          return file.path().extension() != ".csv" && file.path().filename() != "data_set.json";
        });
    EXPECT_EQ(set->notes.size(), has_others ? 5u : 4u)
        << "two tables are left out, each with its reason, one is digitised, and other files are named";
    EXPECT_THAT(set->licence, HasSubstr("none"));
  }
}

TEST(CurveSet, whatIsWrongIsNamedWithFileLineFieldAndValue) {
  const struct {
    std::string text;
    std::vector<std::string> named;
  } cases[] = {
      {"", {"bad.csv line 1", "is empty"}},
      {kHeader, {"bad.csv line 1", "no rows"}},
      {kHeader + "0,0,s1,18G,liver,0.003\n48.2,1,s1,18G,liver,0.003\n",
       {"bad.csv line 3", "'depth_m'", "'48.2'", "[-0.05, 1]", "looks like millimetres", "0.0482 m"}},
      {kHeader + "0,nan,s1,18G,liver,0.003\n", {"line 2", "'force_n'", "'nan'", "[-100, 100]"}},
      {kHeader + "0,1e999,s1,18G,liver,0.003\n", {"line 2", "'force_n'", "1e999"}},
      {kHeader + "0,ten,s1,18G,liver,0.003\n", {"line 2", "'force_n'", "'ten'", "not a number"}},
      {kHeader + "0,1,s1,18G,liver,3\n", {"line 2", "'speed_m_s'", "'3'", "[1e-04, 1]"}},
      {kHeader + "0,1,s1,18G,liver,0\n", {"line 2", "'speed_m_s'", "'0'"}},
      {kHeader + "0,1,s1,18G,liver\n", {"line 2", "5 cells", "6"}},
      {kHeader + "0,1,,18G,liver,0.003\n", {"line 2", "specimen"}},
      {kHeader + "0,1,s\x01,18G,liver,0.003\n", {"line 2", "specimen"}},
      {kHeader + "0,1," + std::string(300, 's') + ",18G,liver,0.003\n", {"line 2", "specimen"}},
      {"depth_m,depth_m,force_n\n0,0,0\n", {"line 1", "'depth_m'", "twice"}},
      {kHeader + rows(7, kWords), {"line 2", "7 rows", "at least 8"}},
      {"phase,t_s," + kHeader + "pull,0,0,0" + kWords + "\n",
       {"line 2", "'phase'", "'pull'", "insert, hold or withdraw"}},
      {"phase,t_s," + kHeader + "hold,0,0,0" + kWords + "\ninsert,1,0,0" + kWords + "\n",
       {"line 3", "'phase'", "'insert' comes after 'hold'"}},
      {"phase," + kHeader + "hold,0,0" + kWords + "\n", {"line 2", "'phase'", "'t_s'"}},
      {"phase,t_s,force_n,specimen,needle,tissue,speed_m_s\nwithdraw,0,0" + kWords + "\n",
       {"line 2", "'phase'", "'depth_m'"}},
      {"phase,t_s," + kHeader + phaseRows("insert", 0, 10) + phaseRows("hold", 10, 9, 0),
       {"line 2", "hold lasts 0.0", "[0.2, 600]"}},
      {"phase,t_s," + kHeader + phaseRows("insert", 0, 10) + phaseRows("hold", 10, 30, 2e-4),
       {"hold goes from", "at most 0.001 m"}},
      {"phase,t_s," + kHeader + phaseRows("insert", 0, 10) + phaseRows("withdraw", 10, 10, 5e-4),
       {"times of withdraw", "out of range [1e-04, 1]"}},
      {"phase,t_s," + kHeader + phaseRows("insert", 0, 10) + phaseRows("withdraw", 10, 3, -5e-4),
       {"withdraw has 3 rows"}},
      {kHeader + rows(10, kWords, 1e-5), {"line 2", "at least 0.002"}},
      {kHeader + rows(8, kWords) + "0.004,1,s1,18G,liver,0.005\n",
       {"line 10", "'speed_m_s'", "0.005", "0.003", "line 2", "'curve'"}},
      {"t_s,force_n,specimen,needle,tissue,speed_m_s\n1,0" + kWords + "\n0.5,0" + kWords + "\n",
       {"line 3", "'t_s'", "0.5", "must not go back"}},
      {"t_s,force_n,specimen,needle,tissue,speed_m_s,phase\n0,0,s,n,t,1,insert\n1,0,s,n,t,1,insert\n2,0,s,n,t,1,insert\n3,0,s,n,t,1,insert\n"
       "4,0,s,n,t,1,insert\n5,0,s,n,t,1,insert\n6,0,s,n,t,1,insert\n7,0,s,n,t,1,insert\n",
       {"line 2", "depth of 2 m", "[-0.05, 1]"}},
      {"depth_m,force_n\n0,0\n", {"no force curve", "specimen", "bad.csv is omitted"}},
  };
  for (const auto& one : cases) {
    const TempFolder folder;
    folder.write("bad.csv", one.text);
    const std::string fault = faultOf(folder);
    for (const std::string& part : one.named) EXPECT_THAT(fault, HasSubstr(part)) << one.text.substr(0, 200);
  }
}

TEST(CurveSet, aDescriptionIsNotTrustedEither) {
  const std::string good = R"("specimen": "g1", "needle": "18G", "tissue": "gel", "speed_m_s": 0.003)";
  const struct {
    std::string text;
    std::vector<std::string> named;
  } cases[] = {
      {"[", {"data_set.json"}},
      {"[]", {"data_set.json", "object"}},
      {R"({"curves": []})", {"curves", "1 to 500"}},
      {R"({"curves": [{"file": "../secret.csv"}]})", {"curves[0].file"}},
      {R"({"curves": [{}]})", {"curves[0].file"}},
      {R"({"curves": [{"file": "one.csv", "speed": 3}]})", {"curves[0]", "speed", "speed_m_s"}},
      {R"({"curves": [{"file": "one.csv", "speed_m_s": 3}]})", {"speed_m_s", "3", "[1e-04, 1]"}},
      {R"({"curves": [{"file": "one.csv", "speed_m_s": "3"}]})", {"speed_m_s", "number"}},
      {R"({"curves": [{"file": "one.csv", "needle_diameter_m": 1.27}]})", {"needle_diameter_m", "1.27"}},
      {R"({"curves": [{"file": "gone.csv", )" + good + "}]}", {"gone.csv", "not there"}},
      {R"({"curves": [{"file": "one.csv", )" + good + R"(}, {"file": "one.csv"}]})",
       {"curves[1].file", "twice"}},
      {R"({"curves": [{"file": "one.csv", "specimen": "g1"}]})", {"one.csv", "speed_m_s, needle, tissue"}},
  };
  for (const auto& one : cases) {
    const TempFolder folder;
    folder.write("one.csv", "depth_m,force_n\n" + rows(10));
    folder.write("data_set.json", one.text);
    const std::string fault = faultOf(folder);
    for (const std::string& part : one.named) EXPECT_THAT(fault, HasSubstr(part)) << one.text;
  }
}

TEST(CurveSet, aFactMayBeGivenOnlyOnce) {
  const TempFolder folder;
  folder.write("one.csv", kHeader + rows(10, kWords));
  folder.write("data_set.json", R"({"curves": [{"file": "one.csv", "needle": "20G"}]})");
  const std::string fault = faultOf(folder);
  EXPECT_THAT(fault, HasSubstr("'needle'"));
  EXPECT_THAT(fault, HasSubstr("description"));
}

TEST(CurveSet, aNeedleHasOneDiameter) {
  const TempFolder folder;
  const std::string header = "depth_m,force_n,specimen,needle,tissue,speed_m_s,needle_diameter_m\n";
  folder.write("a.csv", header + rows(10, kWords + ",0.00127"));
  folder.write("b.csv", header + rows(10, ",s2,18G,liver,0.003,0.0013"));
  EXPECT_THAT(faultOf(folder), HasSubstr("0.0013"));
}

TEST(CurveSet, aPipeInTheFolderIsRefusedAndNotWaitedFor) {
  const TempFolder folder;
  ASSERT_EQ(::mkfifo((folder.path() / "pipe.csv").c_str(), 0600), 0);
  EXPECT_THAT(faultOf(folder), HasSubstr("pipe.csv"));
}

TEST(CurveSet, tooManyFilesAreRefused) {
  const TempFolder folder;
  for (std::size_t i = 0; i <= kMaxCurveFiles; ++i) folder.write(std::to_string(i) + ".csv", "x\n");
  EXPECT_THAT(faultOf(folder), HasSubstr("more than 500"));
}

TEST(CurveSet, theOrderOfTheFolderDoesNotMatter) {
  const TempFolder one, two;
  for (const char* specimen : {"s1", "s2", "s3"})
    one.write(std::string(specimen) + ".csv",
              kHeader + rows(10 + (specimen[1] - '0'), std::string(",") + specimen + ",18G,liver,0.003"));
  for (const char* specimen : {"s3", "s1", "s2"})
    two.write(std::string(specimen) + ".csv",
              kHeader + rows(10 + (specimen[1] - '0'), std::string(",") + specimen + ",18G,liver,0.003"));
  const auto a = readCurveSet(one.path()), b = readCurveSet(two.path());
  ASSERT_TRUE(a.ok() && b.ok());
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(a->curves[i].name, b->curves[i].name);
}

}  // namespace
}  // namespace needlelab
