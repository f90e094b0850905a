// The report on made-up rows: table, CSV, sentences, the picture's data.
#include "client/sim/accuracy/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

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
  row.time = LoopTimes{1000, 2000, 3000};
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
  AccuracyRows rows = {rowOf(Comparator::kReplay, "DIRECT", 0.02)};
  rows[0].instructions = 209;
  const std::string text = accuracyTable(rows);
  EXPECT_THAT(text, HasSubstr("DIRECT  20.00 (10.00–30.00)  12.5 %      1.00–3.00"));
  EXPECT_THAT(text, HasSubstr("209           2.5"));
  EXPECT_THAT(text, HasSubstr("against a made-up force"));
  EXPECT_THAT(text, HasSubstr("cannot show: anything else"));
  EXPECT_THAT(text, HasSubstr("→ In 4 recorded hands"));
  EXPECT_EQ(accuracyTable({}), "");
}

TEST(AccuracyReport, missingIntervalsAreMarked) {
  AccuracyRows rows = {rowOf(Comparator::kReplay, "DIRECT", 0.02)};
  rows[0].error_N->high = std::numeric_limits<double>::infinity();
  EXPECT_THAT(accuracyTable(rows), HasSubstr("20.00 (no interval)"));
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

TEST(Sentences, followTheirRows) {
  AccuracyRows rows = {
      rowOf(Comparator::kVerification, "A", 0.02), rowOf(Comparator::kVerification, "A", 0.005),
      rowOf(Comparator::kVerification, "A", 0.015), rowOf(Comparator::kVerification, "A", 0.004)};
  rows[1].rate_hz = rows[3].rate_hz = 4000;
  rows[2].encoder_m = rows[3].encoder_m = 1e-6;
  EXPECT_THAT(
      sentenceOf(Comparator::kVerification, rows),
      HasSubstr(
          "20 mN, falls to 5 mN at 4 kHz, to 15 mN with 1 µm, to 4 mN with both: pay for the rate first"));
  rows[1].error_N->mean = 0.09;
  EXPECT_THAT(sentenceOf(Comparator::kVerification, rows), HasSubstr("pay for the encoder first"));
  EXPECT_THAT(sentenceOf(Comparator::kVerification, rows),
              HasSubstr("A gets worse with the rate alone (90 mN)"));
  EXPECT_EQ(sentenceOf(Comparator::kReplay, rows), "") << "no rows, no sentence";
}

TEST(Sentences, ofMeshesSayWhatToBuyFirst) {
  AccuracyRows rows = {meshRow(1000, 15, 0.3), meshRow(4000, 15, 0.15), meshRow(1000, 60, 0.2),
                       meshRow(4000, 60, 0.05)};
  EXPECT_THAT(sentenceOf(Comparator::kRefinement, rows), HasSubstr("buy nodes first"));
  rows[1].error_N->mean = 0.25;
  EXPECT_THAT(sentenceOf(Comparator::kRefinement, rows), HasSubstr("buy stations first"));
  rows[3].time = LoopTimes{4000, 5000, 6000};
  EXPECT_THAT(femSentence(rows),
              HasSubstr("15 stations take 1.0 µs and miss 250 mN, 60 take 4.0 µs and miss 50 mN"));
}

// a line closer than the best model: do not choose a model for its rank
TEST(Sentences, ofCurvesDoNotRankModels) {
  AccuracyRows rows = {rowOf(Comparator::kValidation, "VOIGT", 0.1),
                       rowOf(Comparator::kValidation, "DIRECT", 0.2),
                       rowOf(Comparator::kValidation, "CONNECT_THE_DOTS", 0.08)};
  rows[2].line = true;
  const std::string text = sentenceOf(Comparator::kValidation, rows);
  EXPECT_THAT(text, HasSubstr("cannot rank models: in 1 of them"));
  EXPECT_THAT(text, HasSubstr("100/80"));
}

TEST(Sentences, ofCostOrderTicksBeyondTheirPrintedRangesOnly) {
  AccuracyRows rows = {rowOf(Comparator::kReplay, "DIRECT", 0.1), rowOf(Comparator::kReplay, "VOIGT", 0.1)};
  rows[1].time = LoopTimes{2500, 50'000, 90'000};
  rows[1].margin = 0.5;
  EXPECT_THAT(costSentence(rows), HasSubstr("takes 1 to 2.5 µs in the median"));
  EXPECT_THAT(costSentence(rows), HasSubstr("99 % take below 50 µs, 5.0 % of the millisecond"));
  EXPECT_THAT(costSentence(rows), HasSubstr("time does not rank them"));
  EXPECT_THAT(costSentence(rows), HasSubstr("K margin: 0.5 (VOIGT)"));
  rows[1].time->p50_ns = 4000;
  EXPECT_THAT(costSentence(rows), HasSubstr("DIRECT is quicker than VOIGT"));
  EXPECT_EQ(costSentence({}), "");
}

TEST(AccuracyPicture, showsDotsForRowsCurvesForMeshesAndBaselinesAsLines) {
  AccuracyRows rows = {rowOf(Comparator::kVerification, "DIRECT", 0.02),
                       rowOf(Comparator::kReplay, "DIRECT", 0.02),
                       rowOf(Comparator::kValidation, "VOIGT", 0.1),
                       rowOf(Comparator::kValidation, "HOLD_THE_LAST", 0.08),
                       meshRow(1000, 15, 0.3),
                       meshRow(1000, 60, 0.2)};
  rows[3].line = true;
  rows[4].instructions = 1600;
  rows[5].instructions = 3700;
  const AccuracyPicture picture = accuracyPicture(rows);
  EXPECT_THAT(picture.data, HasSubstr("dots 0 1;"));
  EXPECT_THAT(picture.data, HasSubstr("dots 1 1;"));
  EXPECT_THAT(picture.data, HasSubstr("dots 2 1;"));
  EXPECT_THAT(picture.data, HasSubstr("lines 2 1;"));
  EXPECT_THAT(picture.data, HasSubstr("curve 3 2;"));
  EXPECT_THAT(picture.data, HasSubstr("curve 5 2;"));
  EXPECT_THAT(picture.data, Not(HasSubstr("curve 3 3;")));
  EXPECT_EQ(accuracyPicture({}).data, "");
}

}  // namespace
}  // namespace needlelab
