// Lists: a page costs the same number of statements however many rows it has, and all pages together are the
// whole list.
#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "db/people/people.h"
#include "tests/unit/db/service/requests/results/teaching_fixture.h"

namespace needlelab {
namespace {

class WholeLists : public test::TeachingTest {
 protected:
  static std::string nameAt(int i) { return fmt::format("trainee{:03}", i); }
  static std::string groupAt(int i) { return fmt::format("class-{:02}", i); }

  /// Every third consents and then withdraws, every fifth consents twice; both leave a note.
  void addPeople(int from, int to) {
    ASSERT_OK(change([&](Connection& c) -> Status {
      for (int i = from; i < to; ++i) {
        RETURN_IF_ERROR(
            PeopleStore(c).add({nameAt(i), pb::TRAINEE, "", false, 1, fmt::format("Number {}", i)}));
        for (int said = 0; said < (i % 3 == 0 ? 2 : i % 5 == 0 ? 1 : 0); ++said) {
          pb::Consent consent;
          consent.set_given(said == 0);
          consent.set_note(fmt::format("{} says {}", i, said));
          consent.set_recorded_by("mia");
          consent.set_unix_ns(10 + said);
          RETURN_IF_ERROR(ConsentStore(c).add(nameAt(i), consent));
        }
      }
      return {};
    }));
  }
  void expectUser(const pb::User& user, int i, const std::vector<std::string>& groups) {
    EXPECT_EQ(user.name(), nameAt(i));
    EXPECT_EQ(user.full_name(), fmt::format("Number {}", i));
    EXPECT_EQ(std::vector<std::string>(user.groups().begin(), user.groups().end()), groups) << i;
    EXPECT_EQ(user.has_consent(), i % 3 == 0 || i % 5 == 0) << i;
    if (user.has_consent()) {
      EXPECT_EQ(user.consent().note(), fmt::format("{} says {}", i, i % 3 == 0 ? 1 : 0));
    }
  }

  /// The number of statements of a request on its reader, which has prepared them before: with PostgreSQL the
  /// round trips.
  std::uint64_t statementsOf(const Principal& who, const pb::Request& request) {
    get(who, request);
    std::uint64_t statements = 0;
    const auto trace = [&](unsigned what) {
      auto reader = store->readers().borrow();
      ASSERT_OK(reader);
      sqlite3_trace_v2(
          (*reader)->handle(), what,
          [](unsigned, void* counted, void*, void*) { return ++*static_cast<std::uint64_t*>(counted), 0; },
          &statements);
    };
    const auto roundTrips = [&] {
      auto reader = store->readers().borrow();
      EXPECT_OK(reader);
      return (*reader)->roundTrips();
    };
    if (test::onPostgres()) {
      const std::uint64_t before = roundTrips();
      get(who, request);
      return roundTrips() - before;
    }
    trace(SQLITE_TRACE_STMT);
    get(who, request);
    const std::uint64_t counted = statements;
    trace(0);
    return counted;
  }

  template <typename Set, typename Take>
  void allPages(pb::Request request, const Set& setPage, const Take& take) {
    for (int pages = 0; pages < 1000; ++pages) {
      const std::string next = take(get(instructor, request));
      if (next.empty()) return;
      setPage(request, next);
    }
    FAIL() << "there is no end";
  }
};

TEST_F(WholeLists, peopleLoadGroupsAndConsentInAFixedNumberOfStatements) {
  addPeople(0, 3);
  get(manager, putGroup("b", {nameAt(0), nameAt(2)}, 0));
  get(manager, putGroup("a", {nameAt(2)}, 0));
  pb::Request request;
  request.mutable_list_users()->set_limit(90);
  const std::uint64_t few = statementsOf(instructor, request);
  EXPECT_GT(few, 0u);
  addPeople(3, 90);
  EXPECT_EQ(get(instructor, request).users().users_size(), 90);
  EXPECT_EQ(statementsOf(instructor, request), few);
  // each hundred costs as much as the first
  addPeople(90, 350);
  request.mutable_list_users()->set_limit(349);
  EXPECT_LE(statementsOf(instructor, request), 4 * few);

  int at = 0;
  request.mutable_list_users()->set_limit(120);
  allPages(
      request, [](pb::Request& next, const std::string& page) { next.mutable_list_users()->set_page(page); },
      [&](const pb::Reply& reply) {
        for (const pb::User& user : reply.users().users()) {
          expectUser(user, at,
                     at == 0   ? std::vector<std::string>{"b"}
                     : at == 2 ? std::vector<std::string>{"a", "b"}
                               : std::vector<std::string>{});
          ++at;
        }
        return reply.users().next_page();
      });
  EXPECT_EQ(at, 350);
}

TEST_F(WholeLists, resultsComeInAsManyStatementsHoweverManyTraineesThereAre) {
  addStation();
  putCourse({{"second", {{"prerequisites", {"first"}}}}});
  addPeople(0, 60);
  std::vector<std::string> all;
  for (int i = 0; i < 60; ++i) all.push_back(nameAt(i));
  get(manager, putGroup("few", {all[0], all[1]}, 0));
  get(manager, putGroup("all", all, 0));
  for (const char* group : {"few", "all"}) {
    pb::Request give;
    give.mutable_assign()->set_course_id("course");
    give.mutable_assign()->set_group_id(group);
    give.mutable_assign()->set_due_unix_ns(group == std::string("few") ? 5'000 : 3'000);
    get(instructor, give);
  }
  std::map<std::string, Uuid> best;
  for (int i = 0; i < 60; ++i) {
    attempt(all[static_cast<std::size_t>(i)], "first", false, 1'000 + i);
    if (i % 2 == 0) best[nameAt(i)] = attempt(all[static_cast<std::size_t>(i)], "first", true, 4'000 + i);
  }
  pb::Request of_few, of_all;
  of_few.mutable_get_results()->set_course_id("course");
  of_few.mutable_get_results()->set_group_id("few");
  of_all = of_few;
  of_all.mutable_get_results()->set_group_id("all");
  EXPECT_EQ(statementsOf(instructor, of_all), statementsOf(instructor, of_few));
  for (pb::Request* request : {&of_all, &of_few}) request->mutable_get_results()->set_with_measures(true);
  EXPECT_EQ(statementsOf(instructor, of_all), statementsOf(instructor, of_few)) << "180 cells at once";
  of_all.mutable_get_results()->set_with_measures(false);

  const pb::Results results = get(instructor, of_all).results();
  ASSERT_EQ(results.rows_size(), 60);
  for (int i = 0; i < 60; ++i) {
    const pb::ResultRow& row = results.rows(i);
    EXPECT_EQ(row.trainee(), nameAt(i));
    EXPECT_EQ(row.full_name(), fmt::format("Number {}", i));
    const pb::ResultCell& first = row.cells(0);
    EXPECT_EQ(first.attempts(), i % 2 == 0 ? 2u : 1u);
    EXPECT_EQ(first.passed(), i % 2 == 0);
    EXPECT_EQ(first.due_unix_ns(), i < 2 ? 5'000 : 3'000) << "the latest of the groups'";
    EXPECT_EQ(row.cells(1).locked_by_size(), i % 2 == 0 ? 0 : 1);
    if (i % 2 == 0) {
      EXPECT_EQ(first.best().session_id(), test::bytesOfId(best[nameAt(i)]));
      EXPECT_EQ(first.best().number(), 2u);
      EXPECT_EQ(first.best().late(), i >= 2) << "begun at " << 4'000 + i;
    } else {
      EXPECT_EQ(first.best().number(), 1u);
      EXPECT_FALSE(first.best().late());
    }
  }
}

TEST_F(WholeLists, groupsAreFoundByPartOfIdOrName) {
  addPeople(0, 40);
  std::map<std::string, std::vector<std::string>> members;
  const auto add = [&](int i) {
    auto& list = members[groupAt(i)];
    for (int k = 0; k < i; ++k) list.push_back(nameAt(k));
    pb::Request put = putGroup(groupAt(i), list, 0);
    put.mutable_put_group()->mutable_group()->set_name(i % 2 == 0 ? "Even Ones" : "The odd");
    get(manager, put);
  };
  for (int i = 0; i < 2; ++i) add(i);
  pb::Request request;
  request.mutable_list_groups();
  const std::uint64_t few = statementsOf(instructor, request);
  for (int i = 2; i < 30; ++i) add(i);
  EXPECT_EQ(statementsOf(instructor, request), few);

  for (const bool brief : {false, true}) {
    for (const std::uint32_t limit : {0u, 1u, 7u, 30u}) {
      request.mutable_list_groups()->set_brief(brief);
      request.mutable_list_groups()->set_limit(limit);
      std::vector<std::string> ids;
      allPages(
          request,
          [](pb::Request& next, const std::string& page) { next.mutable_list_groups()->set_page(page); },
          [&](const pb::Reply& reply) {
            for (const pb::Group& group : reply.groups().groups()) {
              ids.push_back(group.id());
              const auto& expected = members[group.id()];
              EXPECT_EQ(group.has_member_count(), brief);
              if (brief) {
                EXPECT_EQ(group.member_count(), expected.size());
                EXPECT_EQ(group.members_size(), 0);
              } else {
                EXPECT_EQ(std::vector<std::string>(group.members().begin(), group.members().end()), expected);
              }
            }
            EXPECT_TRUE(limit == 0 || reply.groups().groups_size() <= static_cast<int>(limit));
            return reply.groups().next_page();
          });
      EXPECT_EQ(ids.size(), 30u) << limit;
      EXPECT_TRUE(std::is_sorted(ids.begin(), ids.end()));
    }
  }
  pb::Request search;
  const auto found = [&](const std::string& text) {
    search.mutable_list_groups()->set_search(text);
    return get(instructor, search).groups().groups_size();
  };
  EXPECT_EQ(found("even"), 15);
  EXPECT_EQ(found("CLASS-2"), 10);
  EXPECT_EQ(found("class-07"), 1);
  EXPECT_EQ(found("nothing"), 0);
  search.mutable_list_groups()->set_search(std::string(65, 'x'));
  EXPECT_EQ(refusal(instructor, search), ErrorCode::kInvalidInput);
}

TEST_F(WholeLists, assignmentsComeByPagesNewestFirstWithTheGroupsNames) {
  putCourse();
  addPeople(0, 25);
  pb::Request group = putGroup("g", {nameAt(0)}, 0);
  group.mutable_put_group()->mutable_group()->set_name("The class");
  get(manager, group);
  std::vector<std::uint64_t> ids;
  for (int i = 0; i < 26; ++i) {
    pb::Request give;
    give.mutable_assign()->set_course_id("course");
    if (i == 25)
      give.mutable_assign()->set_group_id("g");
    else
      give.mutable_assign()->set_trainee(nameAt(i));
    ids.insert(ids.begin(), get(instructor, give).assignments().assignments(0).id());
  }
  for (const std::uint32_t limit : {0u, 1u, 5u, 13u, 26u, 900u}) {
    pb::Request request;
    request.mutable_list_assignments()->set_limit(limit);
    std::vector<std::uint64_t> listed;
    std::size_t pages = 0;
    allPages(
        request,
        [](pb::Request& next, const std::string& page) { next.mutable_list_assignments()->set_page(page); },
        [&](const pb::Reply& reply) {
          ++pages;
          for (const pb::Assignment& one : reply.assignments().assignments()) {
            listed.push_back(one.id());
            EXPECT_EQ(one.group_name(), one.group_id() == "g" ? "The class" : "");
          }
          return reply.assignments().next_page();
        });
    EXPECT_EQ(listed, ids) << limit;
    EXPECT_EQ(pages, limit == 0 || limit > 26 ? 1u : (26 + limit - 1) / limit) << limit;
  }
  // a station sees those of groups and trainees
  addStation();
  pb::Request by_station;
  by_station.mutable_list_assignments()->set_limit(7);
  std::size_t seen = 0;
  for (int pages = 0; pages < 10; ++pages) {
    const auto list = get(station, by_station).assignments();
    seen += static_cast<std::size_t>(list.assignments_size());
    if (list.next_page().empty()) break;
    by_station.mutable_list_assignments()->set_page(list.next_page());
  }
  EXPECT_EQ(seen, 26u);
}

TEST_F(WholeLists, attemptsComeNewestFirstAndEachIsFoundByItsSession) {
  addStation();
  putCourse();
  addPerson("anna", pb::TRAINEE);
  std::vector<Uuid> of_first;
  ASSERT_OK(change([&](Connection& c) -> Status {
    for (int i = 0; i < 420; ++i) {
      of_first.push_back(makeUuidV7());
      auto d = test::describe(of_first.back());
      d.set_exercise_id("first");
      d.set_started_unix_ns(1'000 + i);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      if (auto closed = SessionStore(c).close(test::closeOf(of_first.back(), 0), 2); !closed)
        return closed.error();
      RETURN_IF_ERROR(ScoreStore(c).put(test::scoreOf(
          of_first.back(),
          R"([{"measure":"peak_force_n","value":3,"unit":"N","max":5,"passed":true,"words":""}])")));
    }
    return {};
  }));
  const Uuid other = attempt("anna", "second", true, 5'000);
  pb::Request excuse;
  excuse.mutable_excuse_attempt()->set_session_id(test::bytesOfId(of_first[400]));
  excuse.mutable_excuse_attempt()->set_excused(true);
  get(instructor, excuse);
  ASSERT_OK(change([&](Connection& c) {
    return c.run(
        "INSERT INTO unknown_trainees (session, given, code_unchecked) SELECT number, trainee, 1 FROM "
        "sessions"
        " WHERE id = ?",
        ByteView(of_first[419]));
  }));

  pb::Request request;
  request.mutable_get_progress()->set_trainee("anna");
  request.mutable_get_progress()->set_newest_first(true);
  EXPECT_EQ(refusal(trainee, request), ErrorCode::kInvalidInput) << "of which exercise?";
  request.mutable_get_progress()->set_exercise_id("first");
  std::vector<int> pages;
  int at = 419;  // the 420th waits and is not an attempt
  do {
    const pb::Progress progress = get(trainee, request).progress();
    pages.push_back(progress.attempts_size());
    EXPECT_EQ(progress.measures_json().empty(), pages.size() > 1) << "with the first page";
    for (const pb::Attempt& one : progress.attempts()) {
      EXPECT_EQ(one.number(), static_cast<std::uint32_t>(at));
      EXPECT_EQ(one.session_id(), test::bytesOfId(of_first[static_cast<std::size_t>(--at)]));
      EXPECT_EQ(one.excused(), at == 400);
      EXPECT_FALSE(one.score_json().empty());
    }
    request.mutable_get_progress()->set_page(progress.next_page());
  } while (!request.get_progress().page().empty() && pages.size() < 10);
  EXPECT_EQ(at, 0);
  EXPECT_EQ(pages, (std::vector<int>{200, 200, 19}));

  pb::Request tried;
  tried.mutable_list_tried()->set_trainee("anna");
  const auto list = get(trainee, tried).tried_exercises();
  ASSERT_EQ(list.exercises_size(), 2);
  EXPECT_EQ(list.exercises(0).exercise_id(), "second") << "tried last";
  EXPECT_EQ(list.exercises(0).newest_unix_ns(), 5'000);
  EXPECT_EQ(list.exercises(1).attempts(), 419u);
  EXPECT_EQ(list.exercises(1).newest_unix_ns(), 1'000 + 418);

  pb::Request one;
  const auto attemptOf = [&](const Uuid& id) -> pb::Request& {
    one.mutable_get_attempt()->set_session_id(test::bytesOfId(id));
    return one;
  };
  const pb::Attempt found = get(trainee, attemptOf(of_first[400])).attempt();
  EXPECT_EQ(found.number(), 401u);
  EXPECT_TRUE(found.excused());
  EXPECT_EQ(get(instructor, attemptOf(other)).attempt().number(), 1u);
  EXPECT_EQ(refusal(trainee, attemptOf(of_first[419])), ErrorCode::kNotFound) << "it waits";
  EXPECT_EQ(refusal(instructor, attemptOf(makeUuidV7())), ErrorCode::kNotFound);
  const Principal ben{"ben", pb::TRAINEE};
  EXPECT_EQ(refusal(ben, attemptOf(other)), ErrorCode::kDenied);
  EXPECT_EQ(refusal(ben, tried), ErrorCode::kDenied);
  tried.mutable_list_tried()->set_trainee("ben");
  EXPECT_EQ(get(ben, tried).tried_exercises().exercises_size(), 0);
}

}  // namespace
}  // namespace needlelab
