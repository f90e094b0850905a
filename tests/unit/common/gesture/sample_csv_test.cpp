#include "common/gesture/sample.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "common/base/text/csv.h"
#include "tests/unit/common/gesture/gesture_samples.h"

namespace needlelab {
namespace {

GestureSample exampleSample() {
  GestureSample s;
  s.tick = 18'446'744'073'709'551'615u;
  s.time_ns = 9'000'000'001'500'000;
  s.p_WT_m[0] = 0.1;
  s.q_WT[2] = -0.5;
  s.speed_mps = 0.25;
  s.force_W_N[1] = -3;
  s.torque_W_Nm[2] = 1e-4;
  s.insertion_m = 0.02;
  s.lateral_error_m = 0.001;
  s.plunger = 1;
  s.buttons = 5;
  s.device_ns = -7;
  s.engine_ns = 20;
  s.flags = 65536;
  s.layer = -1;
  s.phase = 3;
  s.fault = 2;
  return s;
}

TEST(SampleCsv, headerNamesColumnsAndUnits) {
  std::string text;
  appendSampleCsvHeader(text);
  EXPECT_EQ(text,
            "t_s,tick,time_ns,px_m,py_m,pz_m,qx,qy,qz,qw,speed_m_s,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,wx_m,wy_"
            "m,wz_m,phase,layer,"
            "insertion_m,lateral_error_m,plunger,buttons,device_ns,engine_ns,flags,fault\n");
}

TEST(SampleCsv, rowIsWrittenAsExpected) {
  std::string text;
  appendSampleCsvRow(text, exampleSample(), 9'000'000'000'000'000);
  EXPECT_EQ(text,
            "0.0015,18446744073709551615,9000000001500000,0.1,0,0,0,0,-0.5,1,0.25,0,-3,0,0,0,"
            "0.0001,nan,nan,nan,3,-1,0.02,0.001,1,5,-7,20,65536,2\n");
}

TEST(SampleCsv, aRoundedRowHasTheDecimalsOfItsColumnsAndEmptyCells) {
  GestureSample s = exampleSample();
  std::ranges::copy(std::vector{0.03123449, -0.0000004, 2.0}, s.p_WT_m);
  s.q_WT[0] = 1.0 / 3;
  std::ranges::copy(std::vector{2.533004, -0.0004, 1e3}, s.force_W_N);
  std::string text;
  appendRoundedCsvRow(text, s, 9'000'000'000'000'000);
  EXPECT_EQ(
      text,
      "0.0015,18446744073709551615,9000000001500000,0.031234,0,2,0.33333,0,-0.5,1,0.25,2.533,0,1000,0,0,"
      "0.0001,,,,3,-1,0.02,0.001,1,5,-7,20,65536,2\n");
}

TEST(SampleCsv, jsonHasTheSameNamesAndNoNan) {
  std::string text;
  GestureSample s = exampleSample();
  s.force_W_N[0] = std::numeric_limits<double>::infinity();
  appendSampleJson(text, s, 9'000'000'001'500'000);
  EXPECT_EQ(
      text,
      R"({"t_s":0,"tick":18446744073709551615,"time_ns":9000000001500000,"px_m":0.1,"py_m":0,"pz_m":0,)"
      R"("qx":0,"qy":0,"qz":-0.5,"qw":1,"speed_m_s":0.25,"fx_n":null,"fy_n":-3,"fz_n":0,"tx_nm":0,"ty_nm":0,"tz_nm":0.0001,)"
      R"("wx_m":null,"wy_m":null,"wz_m":null,"phase":3,"layer":-1,"insertion_m":0.02,"lateral_error_m":0.001,"plunger":1,)"
      R"("buttons":5,"device_ns":-7,"engine_ns":20,"flags":65536,"fault":2})");
}

TEST(SampleCsv, writtenNumbersReadBackBitForBit) {
  const auto samples = test::smoothGesture(200);
  std::string text;
  appendSampleCsvHeader(text);
  for (const auto& s : samples) appendSampleCsvRow(text, s, samples[0].time_ns);
  const auto path = std::filesystem::temp_directory_path() / "needlelab_sample_csv_test.csv";
  std::ofstream(path) << text;
  const auto table = readCsv(path, {"t_s", "px_m", "qw", "fx_n", "layer"});
  std::filesystem::remove(path);
  ASSERT_TRUE(table.ok()) << table.error().message;
  ASSERT_EQ(table->rows(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(table->columns[static_cast<std::size_t>(table->find("px_m"))][i], samples[i].p_WT_m[0]);
    EXPECT_EQ(table->columns[static_cast<std::size_t>(table->find("qw"))][i], samples[i].q_WT[3]);
    EXPECT_EQ(table->columns[static_cast<std::size_t>(table->find("fx_n"))][i], samples[i].force_W_N[0]);
    EXPECT_EQ(table->columns[static_cast<std::size_t>(table->find("layer"))][i], samples[i].layer);
  }
}

TEST(SampleCsv, nonFiniteNumbersAreWrittenAsSpecifiedAndRefusedForScores) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  GestureSample s = exampleSample();
  s.p_WT_m[1] = -0.0;
  s.wall_W_m[0] = kInfinity;
  s.wall_W_m[1] = -kInfinity;
  s.wall_W_m[2] = -std::numeric_limits<double>::quiet_NaN();
  std::string text;
  appendSampleCsvHeader(text);
  appendSampleCsvRow(text, s, s.time_ns);
  EXPECT_NE(text.find(",-0,"), std::string::npos) << text;
  EXPECT_NE(text.find(",inf,-inf,nan,"), std::string::npos) << text;
  const auto path = std::filesystem::temp_directory_path() / "needlelab_sample_csv_not_finite.csv";
  // ticks beyond 2^53 do not fit in a double, so this test uses a smaller one
  s.tick = 3;
  text.clear();
  appendSampleCsvHeader(text);
  appendSampleCsvRow(text, s, s.time_ns);
  std::ofstream(path) << text;
  const auto scored = readSampleCsv(path);
  ASSERT_TRUE(scored.ok()) << "scores need no wall";
  EXPECT_TRUE(std::isnan(scored->front().wall_W_m[0]));
  const auto walled = readSampleCsv(path, WallColumns::kRead);
  ASSERT_TRUE(walled.ok()) << walled.error().message;
  EXPECT_EQ(walled->front().wall_W_m[0], kInfinity);
  EXPECT_EQ(walled->front().wall_W_m[1], -kInfinity);
  EXPECT_TRUE(std::isnan(walled->front().wall_W_m[2]));
  s.force_W_N[0] = kInfinity;
  text.clear();
  appendSampleCsvHeader(text);
  appendSampleCsvRow(text, s, s.time_ns);
  std::ofstream(path, std::ios::trunc) << text;
  const auto refused = readSampleCsv(path);
  std::filesystem::remove(path);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("fx_n"), std::string::npos) << refused.error().message;
}

TEST(SampleCsv, timeBeforeTheFirstSampleIsNegative) {
  std::string text;
  GestureSample s;
  s.time_ns = -250'000'000;
  appendSampleCsvRow(text, s, 250'000'000);
  EXPECT_EQ(text.substr(0, 5), "-0.5,");
}

}  // namespace
}  // namespace needlelab
