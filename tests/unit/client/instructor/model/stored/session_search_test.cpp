#include "client/instructor/model/stored/session_search.h"
#include "tests/support/time_zone.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

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
  // 20,777 days after 1970-01-01, counted in the calendar
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

/// A search whose requests wait until the test answers them.
struct AskedSearch {
  struct Asked {
    pb::Request request;
    LabConnection::Answer answer;
  };
  std::vector<Asked> asked;
  SessionSearch search{[this](pb::Request request, LabConnection::Answer answer) {
    asked.push_back({std::move(request), std::move(answer)});
  }};
  void answer(int rows, const std::string& next_page = {}) {
    pb::Reply reply;
    for (int i = 0; i < rows; ++i) reply.mutable_sessions()->add_sessions();
    reply.mutable_sessions()->set_next_page(next_page);
    asked.back().answer(std::move(reply));
  }
};

TEST(SessionSearch, anInvalidDayIsNoSearchWithoutAMatch) {
  AskedSearch asked;
  asked.search.search({});
  EXPECT_EQ(asked.search.countText(), "looking …");
  asked.answer(2, "p2");
  EXPECT_EQ(asked.search.countText(), "2 sessions so far");
  SessionQuery wrong;
  wrong.from = "yesterday";
  asked.search.search(wrong);
  EXPECT_EQ(asked.asked.size(), 1u) << "the server is not asked";
  EXPECT_NE(asked.search.trouble().find("yesterday"), std::string::npos);
  EXPECT_FALSE(asked.search.nothingMatches());
  EXPECT_TRUE(asked.search.rows().empty()) << "the rows of another search are not the answer";
  EXPECT_EQ(asked.search.countText(), "");
  asked.search.search({});
  asked.answer(0);
  EXPECT_TRUE(asked.search.nothingMatches());
  EXPECT_EQ(asked.search.countText(), "0 sessions");
}

TEST(SessionSearch, thePageTokenOfASearchDoesNotGoWithAnother) {
  AskedSearch asked;
  asked.search.search({});
  asked.answer(3, "of the first query");
  SessionQuery next;
  next.search = "tina";
  asked.search.search(next);
  EXPECT_FALSE(asked.search.hasMore());
  asked.asked.back().answer(Error{ErrorCode::kFailed, "the disk is full"});
  EXPECT_EQ(asked.search.trouble(), "the disk is full");
  const std::size_t before = asked.asked.size();
  asked.search.more();
  EXPECT_EQ(asked.asked.size(), before);
}

TEST(SessionSearch, aPageThatFailsCanBeAskedForAgain) {
  AskedSearch asked;
  asked.search.search({});
  asked.answer(1, "p2");
  asked.search.more();
  asked.asked.back().answer(Error{ErrorCode::kFailed, "away"});
  EXPECT_EQ(asked.search.rows().size(), 1u);
  EXPECT_EQ(asked.search.countText(), "1 session so far");
  asked.search.more();
  EXPECT_EQ(asked.asked.back().request.list_sessions().page(), "p2");
  asked.answer(0);
  EXPECT_EQ(asked.search.trouble(), "");
  EXPECT_EQ(asked.search.countText(), "1 session");
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
