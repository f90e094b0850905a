// The report on made-up rows: table, CSV, sentences, the picture's data.
#include "client/sim/accuracy/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <tuple>

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::Not;

AccuracyRow rowOf(Comparator comparator, const std::string& model, double error_N) {
  AccuracyRow row;
  row.comparator = comparator;
  row.scene = "made-up scene";
  row.model = model;
  row.against = "a made-up force";
  row.cannot_show = "anything else";
  row.error_N = MeanInterval{error_N, 0.5 * error_N, 1.5 * error_N, 4};
  row.beyond = 0.125;
  row.rate_hz = 1000;
  row.encoder_m = 1e-5;
  row.time = LoopTimes{1000, 900, 1200, 3000};
  row.margin = 2.5;
  return row;
}

AccuracyRow meshRow(double nodes, double stations, double error_N) {
  AccuracyRow row = rowOf(Comparator::kRefinement, "FEM", error_N);
  row.nodes = nodes;
  row.stations = stations;
  return row;
}

TEST(AccuracyReport, hasErrorIntervalShareTickAndMargin) {
  AccuracyRows rows = {rowOf(Comparator::kVerification, "DIRECT", 0.02)};
  rows[0].greatest_N = 0.07;
  rows[0].delay_s = 0.00125;
  rows[0].instructions = 209;
  const std::string text = accuracyTable(rows);
  EXPECT_THAT(
      text,
      HasSubstr("DIRECT  20.00 (10.00–30.00)  70             1.25            12.5 %      1.00 (0.90–1.20)"));
  EXPECT_THAT(text, HasSubstr("209           2.5"));
  EXPECT_THAT(text, Not(HasSubstr("before [s]"))) << "no row has it";
  EXPECT_THAT(text, HasSubstr("against a made-up force"));
  EXPECT_THAT(text, HasSubstr("cannot show: anything else"));
  EXPECT_EQ(accuracyTable({}), "");
}

TEST(AccuracyReport, onlyAnIntervalStandsInBrackets) {
  AccuracyRow mesh = meshRow(1000, 15, 0.02);
  mesh.error_N->high = std::numeric_limits<double>::infinity();
  mesh.greatest_N = 1.4;
  mesh.greatest_at = "at the turn";
  mesh.prepare_s = 0.25;
  EXPECT_THAT(accuracyTable({mesh}),
              HasSubstr("15 stations  20.00       1400 (at the turn)  12.5 %      0.25"));
}

TEST(AccuracyReport, ofTheVerificationHasTheStationsRateAndEncoderOnly) {
  AccuracyRows rows = {rowOf(Comparator::kVerification, "DIRECT", 0.02),
                       rowOf(Comparator::kVerification, "DIRECT", 0.77)};
  rows[1].rate_hz = 250;
  EXPECT_THAT(accuracyTable(rows), Not(HasSubstr("770.00")));
  EXPECT_THAT(accuracyCsv(rows), HasSubstr("0.77"));
}

TEST(AccuracyCsv, everyRowHasAsManyCellsAsTheHeader) {
  AccuracyRow row = rowOf(Comparator::kReplay, "DIRECT", 1);
  row.cannot_show = "words, with a comma and \"quotes\"";
  const std::string csv = accuracyCsv({row});
  EXPECT_THAT(csv, HasSubstr("\"words, with a comma and \"\"quotes\"\"\""));
  const auto cells = [](const std::string& line) {
    std::size_t count = 1;
    bool quoted = false;
    for (const char c : line) {
      if (c == '"') quoted = !quoted;
      count += c == ',' && !quoted;
    }
    return count;
  };
  const auto end = csv.find('\n');
  EXPECT_EQ(cells(csv.substr(0, end)), cells(csv.substr(end + 1)));
  EXPECT_EQ(csv.rfind("comparator,scene,model", 0), 0u);
}

TEST(Sentences, ofTheVerificationFollowItsRows) {
  AccuracyRows rows;
  for (const auto& [model, at_1kHz_N, at_4kHz_N] :
       {std::tuple{"A", 0.003, 0.001}, std::tuple{"B", 0.005, 0.002}, std::tuple{"C", 0.03, 0.08}}) {
    rows.push_back(rowOf(Comparator::kVerification, model, at_1kHz_N));
    rows.push_back(rowOf(Comparator::kVerification, model, at_4kHz_N));
    rows.back().rate_hz = 4000;
    rows.push_back(rowOf(Comparator::kVerification, model, 0.9));
    rows.back().encoder_m = 1e-6;
  }
  rows[0].delay_s = 0.0012;
  rows[1].delay_s = 0.7;
  EXPECT_EQ(
      sentenceOf(Comparator::kVerification, rows),
      "At 1 kHz the laws miss 3 to 30 mN between jumps, 2 of 3 less than the 20.8 mN that a hand notices, "
      "and a jump is at most 1.2 ms late; 4 kHz takes the median from 5 to 2 mN, but C to 80 mN.");
  EXPECT_EQ(sentenceOf(Comparator::kRefinement, rows), "") << "no rows, no sentence";
  EXPECT_EQ(sentenceOf(Comparator::kReplay, {rowOf(Comparator::kReplay, "A", 0.1)}), "");
}

TEST(Sentences, ofMeshesSayWhatTheBestCostsAndWhatFewerStationsMiss) {
  AccuracyRows rows = {meshRow(1000, 15, 0.3), meshRow(4000, 15, 0.15), meshRow(1000, 60, 0.2),
                       meshRow(4000, 60, 0.05)};
  rows[3].prepare_s = 0.25;
  rows[3].time = LoopTimes{4000, 3900, 4100, 6000};
  rows[0].greatest_N = 1.4;
  rows[0].greatest_at = "at the turn";
  EXPECT_EQ(
      sentenceOf(Comparator::kRefinement, rows),
      "FEM: 60 stations on 4000 nodes, 0.25 s before the lesson and 4 µs a tick, miss 50 mN, 15 stations "
      "150 mN; 15 stations on 1000 nodes miss up to 1.4 N, at the turn.");
}

TEST(AccuracyPicture, hasALineForEachLawAndEachNumberOfStations) {
  AccuracyRows rows = {rowOf(Comparator::kVerification, "DIRECT", 0.02),
                       rowOf(Comparator::kVerification, "DIRECT", 0.01),
                       rowOf(Comparator::kReplay, "DAHL", 0.02),
                       meshRow(1000, 15, 0.3),
                       meshRow(4000, 15, 0.2),
                       meshRow(1000, 60, 0.2)};
  rows[1].rate_hz = 4000;
  rows[5].instructions = 3700;
  const auto variables = accuracyPicture(rows);
  const auto is = [&](const std::string& name, const PlotVariable::second_type& value) {
    const auto at = std::find_if(variables.begin(), variables.end(),
                                 [&](const PlotVariable& variable) { return variable.first == name; });
    return at != variables.end() && at->second == value;
  };
  EXPECT_TRUE(is("laws", std::vector<std::string>{"DIRECT"}));
  EXPECT_TRUE(is("stations", std::vector<std::string>{"15 stations, 1 µs a tick",
                                                      "60 stations, 1 µs a tick (3700 instructions)"}));
  EXPECT_TRUE(is("noticed_mN", 20.8));
}

}  // namespace
}  // namespace needlelab
