// When a class practises: in order, in the past, at hours at which people are there.
#include "tests/class/timetable.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

namespace needlelab {
namespace {

constexpr std::int64_t kMinute = 60'000'000'000, kHour = 60 * kMinute, kDay = 24 * kHour;
// Friday, 20 November 2026, 20:16 UTC
constexpr std::int64_t kNow = 1'795'205'760'000'000'000;

const std::vector<ClassTrainee> kThree = {{"anna", 0}, {"ben", 0.5}, {"liam", 1}};

TEST(Timetable, everybodyDoesEverythingInOrderAndInThePast) {
  TimetableOptions options;
  const auto plan = planClass(kThree, options, kNow);
  ASSERT_EQ(plan.size(), 3u * 6 * 3);
  std::map<std::size_t, std::size_t> next;
  std::set<std::uint64_t> seeds;
  const PlannedAttempt* last = nullptr;
  for (const PlannedAttempt& attempt : plan) {
    const std::size_t k = next[attempt.trainee]++;
    EXPECT_EQ(attempt.exercise, k / 3);
    EXPECT_EQ(attempt.number, k % 3);
    EXPECT_LE(attempt.started_unix_ns, kNow - kHour);
    EXPECT_GE(attempt.started_unix_ns, kNow - 4 * 7 * kDay - 5 * kDay)
        << "a weekend before it, and a part of a day";
    if (last != nullptr && last->trainee == attempt.trainee) {
      EXPECT_GE(attempt.started_unix_ns, last->started_unix_ns + 5 * kMinute);
    }
    EXPECT_TRUE(seeds.insert(attempt.seed).second);
    last = &attempt;
  }
}

TEST(Timetable, nobodyComesAtNightOrOnWeekends) {
  TimetableOptions options;
  options.weeks = 8;
  for (std::int64_t day = 0; day < 7; ++day) {
    for (const PlannedAttempt& attempt : planClass(kThree, options, kNow + day * kDay)) {
      const std::int64_t days = attempt.started_unix_ns / kDay, hour = attempt.started_unix_ns % kDay / kHour;
      // 1 January 1970 was a Thursday: Saturday is day 2, Sunday day 3 of a week that begins there
      EXPECT_TRUE(days % 7 != 2 && days % 7 != 3) << days;
      EXPECT_TRUE(hour >= 8 && hour < 18) << hour;
    }
  }
}

TEST(Timetable, practiceTakesItsShareOfWhatIsMissing) {
  TimetableOptions options;
  options.practice = 0.1;
  const auto plan = planClass(kThree, options, kNow);
  double missing = 1;
  for (std::size_t k = 0; k < 18; ++k, missing *= 0.9) EXPECT_NEAR(plan[k].skill, 1 - missing, 1e-12);
  for (std::size_t k = 36; k < 54; ++k) EXPECT_EQ(plan[k].skill, 1) << "an expert stays one";
}

TEST(Timetable, isTheSameForTheSameSeed) {
  TimetableOptions options;
  const auto one = planClass(kThree, options, kNow), two = planClass(kThree, options, kNow);
  options.seed = 2;
  const auto other = planClass(kThree, options, kNow);
  std::size_t moved = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].started_unix_ns, two[i].started_unix_ns);
    EXPECT_EQ(one[i].seed, two[i].seed);
    moved += one[i].started_unix_ns != other[i].started_unix_ns;
  }
  EXPECT_GT(moved, one.size() / 2);
}

TEST(Timetable, moreAttemptsThanDaysHoldStayInThePastAndApart) {
  TimetableOptions options;
  options.attempts = 50, options.weeks = 0.2;
  const auto plan = planClass({{"anna", 0}}, options, kNow);
  for (std::size_t k = 1; k < plan.size(); ++k)
    EXPECT_GE(plan[k].started_unix_ns, plan[k - 1].started_unix_ns + 5 * kMinute);
  EXPECT_LE(plan.back().started_unix_ns, kNow - kHour);
}

TEST(Timetable, traineesAreNamesWithASkill) {
  const auto tom = parseTrainee("tom=0.25");
  ASSERT_TRUE(tom.ok());
  EXPECT_EQ(tom->name, "tom");
  EXPECT_EQ(tom->skill, 0.25);
  EXPECT_EQ(parseTrainee("a=b=1")->name, "a=b");
  for (const char* const text : {"tom", "tom=", "=0.5", "tom=1.1", "tom=-0.1", "tom=nan", "tom=0.5x"}) {
    const auto refused = parseTrainee(text);
    ASSERT_FALSE(refused.ok()) << text;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(refused.error().message.find(text), std::string::npos);
  }
}

}  // namespace
}  // namespace needlelab
