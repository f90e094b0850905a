#include "client/instructor/model/session_search.h"

#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

TEST(SessionQuery, daysBecomeMoments) {
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
