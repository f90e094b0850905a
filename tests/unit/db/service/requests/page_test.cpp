// Lists that exceed a message are sent in pages, and nothing is cut off.
#include <set>

#include "db/sessions/session_results.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

class PageTest : public test::ServiceTest {
 protected:
  /// All pages; each must fit in a message, and there must be more than one.
  template <typename Ask, typename Take>
  int walk(const Principal& who, const Ask& ask, const Take& take) {
    std::string page;
    int count = 0;
    do {
      pb::Request request;
      ask(request, page);
      const pb::Reply reply = get(who, request);
      EXPECT_LT(reply.ByteSizeLong(), (1u << 20) - 100) << "a message of the wire";
      page = take(reply);
      ++count;
    } while (!page.empty() && count < 100);
    return count;
  }
};

TEST_F(PageTest, usersStationsAndAssignments) {
  constexpr int kMany = 15'000;
  ASSERT_OK(change([](Connection& c) -> Status {
    for (int i = 0; i < kMany; ++i) {
      const std::string name = "person with quite a long name " + std::to_string(i);
      if (auto done = PeopleStore(c).add({name, pb::TRAINEE, "", false, 1, "and a full name of " + name});
          !done)
        return done;
      if (auto done = c.run("INSERT INTO assignments (trainee, exercise_id, by_whom, created_unix_ns) VALUES "
                            "(?, ?, 'somebody with a long name, too', ?)",
                            name, "exercise-" + std::string(40, 'x'), i / 7);
          !done)
        return done;
      if (i % 3 == 0) {
        if (auto done = StationStore(c).add(name, StationKeyBytes{}, 1); !done) return done;
      }
    }
    return {};
  }));
  std::set<std::string> names, stations, assigned;
  EXPECT_GT(walk(
                admin, [](auto& r, const auto& page) { r.mutable_list_users()->set_page(page); },
                [&](const pb::Reply& reply) {
                  for (const auto& user : reply.users().users())
                    EXPECT_TRUE(names.insert(user.name()).second);
                  return reply.users().next_page();
                }),
            1);
  EXPECT_EQ(names.size(), kMany);
  EXPECT_GT(walk(
                admin, [](auto& r, const auto& page) { r.mutable_list_stations()->set_page(page); },
                [&](const pb::Reply& reply) {
                  for (const auto& one : reply.stations().stations())
                    EXPECT_TRUE(stations.insert(one.name()).second);
                  return reply.stations().next_page();
                }),
            1);
  EXPECT_EQ(stations.size(), kMany / 3);
  EXPECT_GT(walk(
                admin, [](auto& r, const auto& page) { r.mutable_list_assignments()->set_page(page); },
                [&](const pb::Reply& reply) {
                  for (const auto& one : reply.assignments().assignments())
                    EXPECT_TRUE(assigned.insert(one.trainee()).second);
                  return reply.assignments().next_page();
                }),
            1);
  EXPECT_EQ(assigned.size(), kMany);
}

TEST_F(PageTest, sessionsInOrder) {
  addStation();
  ASSERT_OK(change([](Connection& c) -> Status {
    for (int i = 0; i < 2500; ++i) {
      auto d = test::describe(makeUuidV7());
      d.set_started_unix_ns(1 + i / 10);  // several begin at the same moment
      for (int n = 0; n < 6; ++n) d.add_device_notes(std::string(200, 'n'));
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
    }
    return {};
  }));
  for (const std::uint32_t limit : {0u, 100u, 250u}) {
    std::set<std::string> ids;
    std::int64_t last = INT64_MAX;
    const int pages = walk(
        instructor,
        [&](auto& r, const auto& page) {
          r.mutable_list_sessions()->set_limit(limit);
          r.mutable_list_sessions()->set_page(page);
        },
        [&](const pb::Reply& reply) {
          for (const auto& one : reply.sessions().sessions()) {
            EXPECT_TRUE(ids.insert(one.description().session_id()).second);
            EXPECT_LE(one.description().started_unix_ns(), last);
            last = one.description().started_unix_ns();
          }
          return reply.sessions().next_page();
        });
    EXPECT_EQ(ids.size(), 2500u) << limit;
    EXPECT_GE(pages, limit == 0 ? 4 : static_cast<int>(2500 / limit));
  }
  pb::Request bad;
  bad.mutable_list_sessions()->set_page("x");
  EXPECT_EQ(refusal(instructor, bad), ErrorCode::kInvalidInput);
}

TEST_F(PageTest, attemptPagesContinueDespiteALateOlderAttempt) {
  addStation();
  const auto attempt = [this](std::int64_t started) {
    const Uuid id = addSession("anna", 1);
    EXPECT_OK(change([&](Connection& c) -> Status {
      if (auto done = c.run("UPDATE sessions SET started_unix_ns = ? WHERE id = ?", started, ByteView(id));
          !done)
        return done;
      if (auto closed = SessionStore(c).close(test::closeOf(id, 1), 1); !closed) return closed.error();
      return ScoreStore(c).put(test::scoreOf(id, R"([{"measure":"elapsed_s","value":1,"unit":"s","words":")" +
                                                     std::string(20'000, 'w') + "\"}]"));
    }));
    return test::bytesOfId(id);
  };
  std::set<std::string> wanted, seen;
  for (int i = 0; i < 120; ++i) wanted.insert(attempt(1000 + i));
  pb::Request request;
  request.mutable_get_progress()->set_trainee("anna");
  int pages = 0;
  do {
    const pb::Reply reply = get(instructor, request);
    for (const auto& one : reply.progress().attempts()) EXPECT_TRUE(seen.insert(one.session_id()).second);
    request.mutable_get_progress()->set_page(reply.progress().next_page());
    if (++pages == 1) {
      (void)attempt(1);  // from a station that was offline: earlier than all others
    }
    ASSERT_LT(pages, 50);
  } while (!request.get_progress().page().empty());
  EXPECT_GT(pages, 1);
  EXPECT_EQ(seen, wanted) << "none twice, none left out";
  request.mutable_get_progress()->set_page("17");
  EXPECT_EQ(refusal(instructor, request), ErrorCode::kInvalidInput);
}

TEST_F(PageTest, auditAndRemarks) {
  addStation();
  const Uuid id = addSession("anna", 1);
  ASSERT_OK(change([&](Connection& c) -> Status {
    for (int i = 0; i < 2500; ++i) {
      if (auto done = AuditStore(c).add({0, i, "who", "action", "subject", std::string(900, 'd')}); !done)
        return done;
      StoredAnnotation remark{
          0, id, static_cast<std::uint64_t>(i % 50), std::string(900, 'r') + std::to_string(i), "ina", 1};
      if (auto added = AnnotationStore(c).add(remark); !added) return added.error();
    }
    return {};
  }));
  std::uint64_t rows = 0, last = UINT64_MAX;
  walk(
      admin, [](auto& r, const auto& page) { r.mutable_list_audit()->set_page(page); },
      [&](const pb::Reply& reply) {
        for (const auto& one : reply.audit().entries()) {
          EXPECT_LT(one.id(), last);
          last = one.id();
          ++rows;
        }
        return reply.audit().next_page();
      });
  EXPECT_EQ(last, 1u);
  EXPECT_GE(rows, 2500u);
  std::set<std::uint64_t> remarks;
  EXPECT_GT(walk(
                instructor,
                [&](auto& r, const auto& page) {
                  r.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
                  r.mutable_list_annotations()->set_page(page);
                },
                [&](const pb::Reply& reply) {
                  for (const auto& one : reply.annotations().annotations())
                    EXPECT_TRUE(remarks.insert(one.id()).second);
                  return reply.annotations().next_page();
                }),
            1);
  EXPECT_EQ(remarks.size(), 2500u);
  for (const char* page : {"17", "17.", ".3", "1.2.3", "-1.3", "18446744073709551615.1", "1.x"}) {
    pb::Request request;
    request.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
    request.mutable_list_annotations()->set_page(page);
    EXPECT_EQ(refusal(instructor, request), ErrorCode::kInvalidInput) << page;
  }
}

TEST_F(PageTest, aWelcomeListsTheNewestOpenSessionsOnly) {
  addStation();
  std::vector<Uuid> ids;
  ASSERT_OK(change([&](Connection& c) -> Status {
    for (std::uint32_t i = 0; i < kMaxWelcomed + 5; ++i) {
      ids.push_back(makeUuidV7());
      if (auto opened = SessionStore(c).open(test::describe(ids.back()), 1); !opened) return opened.error();
    }
    return {};
  }));
  auto reader = store->readers().borrow();
  const auto open = SessionStore(**reader).openSessions("station-1");
  ASSERT_OK(open);
  ASSERT_EQ(open->size(), kMaxWelcomed);
  EXPECT_EQ(open->front().session_id(), test::bytesOfId(ids[5]));
  EXPECT_EQ(open->back().session_id(), test::bytesOfId(ids.back()));
}

}  // namespace
}  // namespace needlelab
