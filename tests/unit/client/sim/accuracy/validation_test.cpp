// Models compared with measured curves: baselines in each question, and the limits of what a curve shows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "client/sim/accuracy/report.h"
#include "client/sim/accuracy/study.h"
#include "tests/support/recordings/recordings.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

// One test, because the rows take seconds.
TEST(Validation, rowsHaveBaselinesAsLinesHoldWithdrawalAndNoRank) {
  AccuracyOptions options;
  options.data = test::preferredRecordings().folder;
  std::vector<std::string> notes;
  const auto rows = validationRows(
      options, [](std::string_view, double) {}, notes);
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  std::map<std::string, std::pair<int, int>> lines_and_models;
  for (const AccuracyRow& row : *rows) {
    auto& [lines, models] = lines_and_models[row.scene];
    ++(row.line ? lines : models);
    EXPECT_GT(row.error_N->mean, 0) << row.model;
    EXPECT_TRUE(row.beyond && !row.against.empty() && !row.cannot_show.empty()) << row.model;
  }
  EXPECT_EQ(lines_and_models.size(), 4u) << "two questions to the insertion, the hold, the withdrawal";
  for (const auto& [scene, count] : lines_and_models) {
    EXPECT_GE(count.first, 2) << scene;
    EXPECT_GE(count.second, 1) << scene;
  }
  const std::string sentence = sentenceOf(Comparator::kValidation, *rows);
  EXPECT_THAT(sentence, HasSubstr("4 questions to curves of one specimen each cannot rank models"));
  EXPECT_THAT(sentence, HasSubstr("Buy no model"));
}

TEST(Validation, withoutRecordingsRowsSayWhatToDo) {
  AccuracyOptions options;
  options.data = "/nonexistent";
  std::vector<std::string> notes;
  const auto rows = validationRows(
      options, [](std::string_view, double) {}, notes);
  ASSERT_TRUE(rows.ok());
  EXPECT_TRUE(rows->empty());
  EXPECT_THAT(notes, testing::ElementsAre(HasSubstr("NEEDLELAB_DATA")));
}

}  // namespace
}  // namespace needlelab
