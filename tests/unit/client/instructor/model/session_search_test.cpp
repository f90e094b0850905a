#include "client/instructor/model/session_search.h"
#include "tests/support/time_zone.h"

#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

TEST(SessionQuery, daysBecomeMoments) {
  const test::WithZone zone("UTC");
  SessionQuery query;
  query.search = "tin";
  query.from = "2026-11-20";
  query.to = "2026-11-21";
  query.verdict = pb::ListSessions::FAILED;
  const auto list = messageOf(query);
  ASSERT_TRUE(list.ok()) << list.error().message;
  // 20,777 days after 1970-01-01, by the calendar's own count
  EXPECT_EQ(list->from_unix_ns(), 1'795'132'800'000'000'000);
  EXPECT_EQ(list->to_unix_ns() - list->from_unix_ns(), 2 * 86'400'000'000'000)
      << "the second day is included";
  EXPECT_EQ(list->search(), "tin");
  EXPECT_EQ(list->verdict(), pb::ListSessions::FAILED);
  EXPECT_EQ(messageOf({})->from_unix_ns(), 0);
}

TEST(SessionQuery, daysAreThoseOfThisPlace) {
  const test::WithZone zone(test::kStJohns);
  SessionQuery query;
  query.from = query.to = "2026-07-01";
  constexpr std::int64_t kHour_ns = 3'600'000'000'000;
  const auto summer = messageOf(query);
  ASSERT_TRUE(summer.ok());
  // 20,635 days after 1970-01-01; midnight comes 2 h 30 min later than in UTC
  EXPECT_EQ(summer->from_unix_ns(), 20'635 * 24 * kHour_ns + 2 * kHour_ns + kHour_ns / 2);
  EXPECT_EQ(summer->to_unix_ns() - summer->from_unix_ns(), 24 * kHour_ns);
  // summer time ends
  query.from = query.to = "2026-11-01";
  const auto longest = messageOf(query);
  ASSERT_TRUE(longest.ok());
  EXPECT_EQ(longest->to_unix_ns() - longest->from_unix_ns(), 25 * kHour_ns);
}

TEST(SessionQuery, whatIsNoDayIsNamed) {
  for (const char* text :
       {"yesterday", "2026-13-01", "2026-02-30", "2026-11-21x", "1960-01-01", "21.11.2026"}) {
    SessionQuery query;
    query.from = text;
    const auto list = messageOf(query);
    ASSERT_FALSE(list.ok()) << text;
    EXPECT_NE(list.error().message.find(text), std::string::npos);
  }
  SessionQuery query;
  query.from = "2026-11-21";
  query.to = "2026-11-20";
  EXPECT_FALSE(messageOf(query).ok());
}

TEST(SessionRow, figuresByName) {
  pb::SessionInfo row;
  auto& force = *row.add_figures();
  force.set_measure("peak_force_n");
  force.set_value(3.5);
  row.add_figures()->set_measure("elapsed_s");
  EXPECT_EQ(figureOf(row, "peak_force_n"), 3.5);
  EXPECT_TRUE(std::isnan(figureOf(row, "elapsed_s"))) << "it could not be measured";
  EXPECT_TRUE(std::isnan(figureOf(row, "other")));
}

}  // namespace
}  // namespace needlelab
