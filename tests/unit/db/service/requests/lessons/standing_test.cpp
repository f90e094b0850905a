// Changes of roles, uncounted attempts, completed exercises, access to standings, and trends of measures.
#include <map>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "db/service/requests/handlers.h"
#include "db/sessions/session_results.h"
#include "db/teaching/score_list.h"
#include "tests/support/store/password_cost.h"
#include "tests/unit/db/service/requests/results/teaching_fixture.h"

namespace needlelab {
namespace {

using Standing = test::TeachingTest;

TEST_F(Standing, aManagerTakesNoRoleFromAnother) {
  const auto add = [&](const std::string& name, pb::Role role) {
    ASSERT_OK(change([&](Connection& c) { return PeopleStore(c).add({name, role, "$hash", false, 1}); }));
  };
  add("max", pb::CURRICULUM_MANAGER);
  add("mia", pb::CURRICULUM_MANAGER);
  pb::Request lower;
  lower.mutable_change_user()->set_base_revision(1);
  lower.mutable_change_user()->set_role(pb::INSTRUCTOR);
  for (const char* name : {"max", "mia"}) {
    lower.mutable_change_user()->set_name(name);
    EXPECT_EQ(refusal(manager, lower), ErrorCode::kDenied) << name;
  }
  EXPECT_EQ(importPeople("name,role\nmax,instructor\n").faults(), 1u) << "nor by a table";
  EXPECT_EQ(count("SELECT role FROM accounts WHERE name = 'max'"), pb::CURRICULUM_MANAGER);
  pb::Request name;
  name.mutable_change_user()->set_base_revision(1);
  name.mutable_change_user()->set_name("max");
  name.mutable_change_user()->set_full_name("Max M");
  EXPECT_EQ(get(manager, name).user().full_name(), "Max M");
  lower.mutable_change_user()->set_name("max");
  lower.mutable_change_user()->set_base_revision(2);
  EXPECT_EQ(get(admin, lower).user().role(), pb::INSTRUCTOR) << "an administrator may";
}

TEST_F(Standing, aPromotionDuringAPasswordChangeKeepsTheOldPassword) {
  // The manager's call checks, hashes for a tenth of a second, and checks again when it stores.
  const test::ProductPasswordCost product;
  for (int round = 0; round < 3; ++round) {
    const std::string name = "ina" + std::to_string(round);
    ASSERT_OK(change([&](Connection& c) {
      return PeopleStore(c).add({name, pb::INSTRUCTOR, "$old", false, 1});
    }));
    pb::Request password, promote;
    password.mutable_set_password()->set_name(name);
    password.mutable_set_password()->set_password("another horse");
    promote.mutable_change_user()->set_name(name);
    promote.mutable_change_user()->set_base_revision(1);
    promote.mutable_change_user()->set_role(pb::ADMINISTRATOR);
    std::thread manager_asks([&] { (void)ask(manager, password); });
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    get(admin, promote);
    const std::int64_t promoted = count("SELECT max(id) FROM audit WHERE action = 'user change'");
    manager_asks.join();
    // In either order: a manager never sets a password after the promotion.
    EXPECT_EQ(
        count("SELECT count(*) FROM audit WHERE action = 'user passwd' AND id > " + std::to_string(promoted)),
        0);
  }
}

TEST_F(Standing, anImportAuditsEachChangedPersonAndGroup) {
  addPerson("anna", pb::TRAINEE);
  EXPECT_TRUE(importPeople("name,full_name,group\nanna,Anna A,class\nben,Ben B,class\n").done());
  const auto lines = [&](const std::string& action, const std::string& subject, const std::string& like) {
    return count("SELECT count(*) FROM audit WHERE action = '" + action + "' AND subject = '" + subject +
                 "' AND detail LIKE '" + like + "'");
  };
  EXPECT_EQ(lines("user import", refOf("anna"), "joins class; full name"), 1);
  EXPECT_EQ(lines("user import", refOf("ben"), "added as trainee, joins class"), 1);
  EXPECT_EQ(lines("group set", "class", "%joined: " + refOf("anna") + ", " + refOf("ben") + "%"), 1);
  // The imported table tells the second editor about the changes.
  pb::Request edit;
  edit.mutable_change_user()->set_name("anna");
  edit.mutable_change_user()->set_base_revision(1);
  edit.mutable_change_user()->set_full_name("Other");
  const auto conflict = ask(manager, edit);
  ASSERT_TRUE(conflict.error.has_value());
  EXPECT_NE(conflict.error->message.find("What came first: joins class; full name"), std::string::npos)
      << conflict.error->message;
}

TEST_F(Standing, anExcusedAttemptDoesNotPassEither) {
  addStation();
  putCourse({{"second", {{"prerequisites", {"first"}}}}});
  addPerson("anna", pb::TRAINEE);
  attempt("anna", "first", false);
  const Uuid passed = attempt("anna", "first", true);
  EXPECT_FALSE(lesson("second").has_value());
  pb::Request excuse;
  excuse.mutable_excuse_attempt()->set_session_id(test::bytesOfId(passed));
  excuse.mutable_excuse_attempt()->set_excused(true);
  get(instructor, excuse);
  EXPECT_TRUE(lesson("second").has_value()) << "what does not count unlocks nothing";
  const auto cell = results(instructor).rows(0).cells(0);
  EXPECT_EQ(cell.attempts(), 1u);
  EXPECT_TRUE(cell.has_passed());
  EXPECT_FALSE(cell.passed());
  EXPECT_NE(cell.best().session_id(), test::bytesOfId(passed));
  excuse.mutable_excuse_attempt()->set_excused(false);
  get(instructor, excuse);
  EXPECT_FALSE(lesson("second").has_value());
}

TEST_F(Standing, anExerciseThatAsksForNothingIsDoneWhenItWasTried) {
  addStation();
  putCourse({{"first", {{"requirements", nlohmann::json::array()}, {"due_unix_ms", 1'700'000'000'000}}},
             {"second", {{"prerequisites", {"first"}}, {"due_unix_ms", 1'700'000'000'000}}}});
  addPerson("anna", pb::TRAINEE);
  attempt("anna", "third", true);
  EXPECT_TRUE(results(instructor).rows(0).cells(0).overdue());
  EXPECT_TRUE(lesson("second").has_value());
  const Uuid id = makeUuidV7();
  ASSERT_OK(change([&](Connection& c) -> Status {
    auto d = test::describe(id);
    d.set_exercise_id("first");
    if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
    const auto closed = SessionStore(c).close(test::closeOf(id, 0), 2);
    return closed ? Status() : Status(closed.error());
  }));
  const auto row = results(instructor).rows(0);
  EXPECT_FALSE(row.cells(0).has_passed());
  EXPECT_FALSE(row.cells(0).overdue());
  EXPECT_TRUE(row.cells(1).overdue());
  EXPECT_FALSE(lesson("second").has_value());
  // A date that does not fit 64-bit nanoseconds is refused on input.
  pb::Request far;
  far.mutable_import_curriculum()->set_json(
      R"({"id":"far","name":"F","exercises":[{"id":"f","name":"F","profile_id":"knee-adult","due_unix_ms":32503680000000}]})");
  EXPECT_EQ(refusal(manager, far), ErrorCode::kInvalidInput);
}

TEST_F(Standing, aTraineeSeesNoOtherStanding) {
  putCourse({{"first", {{"attempts", 2}}}});
  addPerson("ben", pb::TRAINEE);
  pb::Request request;
  request.mutable_get_lesson()->set_exercise_id("first");
  request.mutable_get_lesson()->set_trainee("ben");
  EXPECT_EQ(refusal(trainee, request), ErrorCode::kDenied);
  get(instructor, request);
  request.mutable_get_lesson()->set_trainee("anna");
  EXPECT_EQ(get(trainee, request).lesson().attempts_left(), 2u);
}

TEST_F(Standing, progressTellsHowEachMeasureWent) {
  addStation();
  putCourse();
  for (int i = 0; i < 6; ++i) {
    const Uuid id = attempt("anna", "first", true);
    // version 2, falling by 0.5 N with each attempt; the third does not count, the fifth was not rescored
    const std::string measures =
        R"([{"measure":"peak_force_n","unit":"N","words":"","value":)" + std::to_string(5 - 0.5 * i) + "}]";
    if (i != 4)
      ASSERT_OK(change([&](Connection& c) { return ScoreStore(c).put(test::scoreOf(id, measures, 2)); }));
    if (i != 2) continue;
    pb::Request excuse;
    excuse.mutable_excuse_attempt()->set_session_id(test::bytesOfId(id));
    excuse.mutable_excuse_attempt()->set_excused(true);
    get(instructor, excuse);
  }
  pb::Request ask_progress;
  ask_progress.mutable_get_progress()->set_trainee("anna");
  EXPECT_EQ(get(trainee, ask_progress).progress().measures_json(), "") << "of all exercises at once: none";
  ask_progress.mutable_get_progress()->set_exercise_id("first");
  const auto progress = get(trainee, ask_progress).progress();
  EXPECT_EQ(progress.attempts_size(), 6);
  const auto rows = nlohmann::json::parse(progress.measures_json());
  ASSERT_EQ(rows.size(), 1u) << progress.measures_json();
  EXPECT_EQ(rows[0]["measure"], "peak_force_n");
  EXPECT_EQ(rows[0]["values"], (nlohmann::json{5.0, 4.5, 3.5, 2.5}));
  EXPECT_NEAR(rows[0]["trend"]["tau"].get<double>(), -1, 1e-12);
}

/// `count` attempts without samples, alternating between these exercises, in one commit, each with a score.
class ManyAttempts : public test::TeachingTest {
 protected:
  void attempts(const std::string& who, const std::vector<std::string>& exercises, int count) {
    ASSERT_OK(change([&](Connection& c) -> Status {
      for (int i = 0; i < count; ++i) {
        auto d = test::describe(makeUuidV7());
        d.set_trainee(who);
        d.set_exercise_id(exercises[static_cast<std::size_t>(i) % exercises.size()]);
        d.set_started_unix_ns(++begun_);
        if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
        const Uuid id = *handlers::sessionId(d.session_id());
        if (auto closed = SessionStore(c).close(test::closeOf(id, 0), 2); !closed) return closed.error();
        if (auto put = ScoreStore(c).put(test::scoreOf(id, "[]")); !put) return put;
      }
      return {};
    }));
  }
  /// The number of statements the request runs on its reader, the one returned last.
  int statementsOf(const Principal& who, const pb::Request& request) {
    int statements = 0;
    const auto trace = [&](unsigned what) {
      auto reader = store->readers().borrow();
      ASSERT_OK(reader);
      sqlite3_trace_v2((*reader)->handle(), what,
                       [](unsigned, void* counted, void*, void*) { return ++*static_cast<int*>(counted), 0; },
                       &statements);
    };
    trace(SQLITE_TRACE_STMT);
    get(who, request);
    const int counted = statements;
    trace(0);
    return counted;
  }

 private:
  std::int64_t begun_ = 1000;
};

TEST_F(ManyAttempts, progressIsReadByPagesOfAttemptsAndAnExerciseOnce) {
  addStation();
  putCourse({{"second", {{"prerequisites", {"first"}}}}});
  addPerson("anna", pb::TRAINEE);
  pb::Request request;
  request.mutable_get_progress()->set_trainee("anna");
  attempts("anna", {"first", "second"}, 4);
  const int few = statementsOf(trainee, request);
  EXPECT_GT(few, 0);
  attempts("anna", {"first", "second"}, 146);
  EXPECT_EQ(statementsOf(trainee, request), few) << "of two exercises, however many attempts";

  attempts("anna", {"first", "second"}, 350);
  std::map<std::string, std::uint32_t> last;
  std::vector<int> pages;
  std::int64_t before = 0;
  do {
    const auto progress = get(trainee, request).progress();
    pages.push_back(progress.attempts_size());
    for (const auto& one : progress.attempts()) {
      EXPECT_EQ(one.number(), ++last[one.exercise_id()]) << "numbered within the exercise, over all pages";
      EXPECT_GT(one.started_unix_ns(), before);
      before = one.started_unix_ns();
    }
    request.mutable_get_progress()->set_page(progress.next_page());
  } while (!request.get_progress().page().empty() && pages.size() < 10);
  EXPECT_EQ(pages, (std::vector<int>{200, 200, 100}));
  EXPECT_EQ(last, (std::map<std::string, std::uint32_t>{{"first", 250}, {"second", 250}}));

  // a page token of another exercise's or another person's list is invalid
  pb::Request other;
  other.mutable_get_progress()->set_trainee("anna");
  other.mutable_get_progress()->set_exercise_id("second");
  other.mutable_get_progress()->set_page(get(trainee, other).progress().attempts(0).session_id());
  EXPECT_EQ(get(trainee, other).progress().attempts_size(), 200);
  other.mutable_get_progress()->set_exercise_id("first");
  EXPECT_EQ(refusal(trainee, other), ErrorCode::kInvalidInput);
}

TEST_F(ManyAttempts, aPrerequisiteIsReadOnceForAllItsExercises) {
  constexpr int kExercises = 40;
  const auto statements = [&](bool with_prerequisites) {
    nlohmann::json course{{"id", "course"}, {"name", "A course"}, {"exercises", nlohmann::json::array()}};
    for (int i = 0; i < kExercises; ++i) {
      nlohmann::json exercise{
          {"id", "e" + std::to_string(i)}, {"name", "An exercise"}, {"profile_id", "knee-adult"}};
      exercise["requirements"] = {{{"measure", "peak_force_n"}, {"max", 5}}};
      exercise["prerequisites"] = nlohmann::json::array();
      for (int before = 0; with_prerequisites && before < i; ++before)
        exercise["prerequisites"].push_back("e" + std::to_string(before));
      course["exercises"].push_back(exercise);
    }
    pb::Request put;
    put.mutable_import_curriculum()->set_json(course.dump());
    get(manager, put);
    pb::Request request;
    request.mutable_get_results()->set_course_id("course");
    request.mutable_get_results()->set_trainee("anna");
    return statementsOf(trainee, request);
  };
  addPerson("anna", pb::TRAINEE);
  const int without = statements(false);
  const int with = statements(true);
  EXPECT_GT(with, without);
  EXPECT_LE(with, without + 2 * kExercises) << "its text and her attempts, once each";
  const auto row = results(trainee).rows(0);
  EXPECT_EQ(row.cells(0).locked_by_size(), 0);
  EXPECT_EQ(row.cells(kExercises - 1).locked_by_size(), kExercises - 1);
}

// somebody with a station's key can add any number
TEST_F(ManyAttempts, resultsCostTheSameHoweverManySessionsWait) {
  addStation();
  putCourse();
  pb::Request give;
  give.mutable_assign()->set_course_id("course");
  for (const char* name : {"anna", "ben"}) {
    addPerson(name, pb::TRAINEE);
    give.mutable_assign()->set_trainee(name);
    get(instructor, give);
  }
  attempts("anna", {"first", "second"}, 4);
  pb::Request request;
  request.mutable_get_results()->set_course_id("course");
  const auto steps = [&] {
    EXPECT_EQ(get(instructor, request).results().rows_size(), 2);
    auto reader = store->readers().borrow();
    EXPECT_OK(reader);
    return test::stepsOfStatements(**reader);
  };
  attempts("ben", {"elsewhere"}, 300);
  const auto wait = [&](const char* which) {
    ASSERT_OK(change([&](Connection& c) {
      return c.run(std::string("INSERT INTO unknown_trainees (session, given)"
                               " SELECT number, trainee FROM sessions WHERE trainee = 'ben' AND number ") +
                   which + " (SELECT min(number) FROM sessions WHERE trainee = 'ben')");
    }));
  };
  wait("=");  // if any are waiting, it looks up whether the name exists
  (void)steps();
  const int few = steps();
  EXPECT_GT(few, 0);
  wait(">");
  (void)steps();
  EXPECT_EQ(steps(), few);
}

TEST_F(ManyAttempts, aListOfScoresReadsManyAttemptsAtOnce) {
  addStation();
  putCourse();
  pb::Request request;
  request.mutable_list_scores()->set_course_id("course");
  attempts("anna", {"first"}, 2);
  attempts("ben", {"first", "second"}, 4);
  const int of_six = statementsOf(instructor, request);
  attempts("anna", {"first"}, 100);
  EXPECT_LE(statementsOf(instructor, request) - of_six, 2) << "64 attempts a statement";
  std::map<std::string, std::uint32_t> last;
  const auto scores = get(instructor, request).scores();
  ASSERT_EQ(scores.scores_size(), 106);
  for (const auto& row : scores.scores()) {
    EXPECT_EQ(row.attempt().number(), ++last[row.attempt().trainee() + " " + row.attempt().exercise_id()]);
    EXPECT_EQ(row.attempt().score_json(), "") << "the score stands beside it";
  }
}

TEST_F(ManyAttempts, aPageOfScoresReadsOnlyItsOwnRows) {
  addStation();
  putCourse();
  addPerson("anna", pb::TRAINEE);
  addPerson("zoe", pb::TRAINEE);
  get(manager, putGroup("class", {"anna"}, 0));
  attempts("anna", {"first", "second"}, 6);
  attempts("zoe", {"elsewhere", "third"}, 4);
  attempts("ben", {"elsewhere"}, 1);
  pb::Request of_course, of_group;
  of_course.mutable_list_scores()->set_course_id("course");
  of_group.mutable_list_scores()->set_group_id("class");
  const auto steps = [&](const pb::Request& request, int scores) {
    EXPECT_EQ(get(instructor, request).scores().scores_size(), scores);
    auto reader = store->readers().borrow();
    EXPECT_OK(reader);
    return test::stepsOfStatements(**reader);
  };
  for (int warm = 0; warm < 2; ++warm) (void)steps(of_course, 8), (void)steps(of_group, 6);
  const int few = steps(of_course, 8), of_few = steps(of_group, 6);
  EXPECT_GT(few, 0);
  attempts("ben", {"elsewhere"}, 300);
  (void)steps(of_course, 8), (void)steps(of_group, 6);
  EXPECT_EQ(steps(of_course, 8), few) << "of a course: nobody's attempts elsewhere";
  EXPECT_EQ(steps(of_group, 6), of_few) << "of a group: no one else's";
}

TEST_F(ManyAttempts, scoresAreTheSameInPiecesAsAFullReadGives) {
  addStation();
  putCourse();
  addPerson("anna", pb::TRAINEE);
  addPerson("ben", pb::TRAINEE);
  addPerson("cleo", pb::TRAINEE);
  get(manager, putGroup("class", {"anna", "cleo"}, 0));
  for (const char* name : {"anna", "ben", "cleo"}) attempts(name, {"first", "elsewhere", "second"}, 9);
  attempts("anna", {"second"}, 150);
  ASSERT_OK(change([](Connection& c) -> Status {
    RETURN_IF_ERROR(c.run("DELETE FROM scores WHERE session % 7 = 0"));
    RETURN_IF_ERROR(
        c.run("INSERT INTO scores (session, definition_version, measures, passed, first, engine_version,"
              " made_unix_ns) SELECT session, 7, '[]', 1, 0, 'x', 5 FROM scores WHERE session % 5 = 0"));
    return c.run(
        "INSERT INTO unknown_trainees (session, given, code_unchecked) SELECT number, trainee, 1 FROM "
        "sessions"
        " WHERE number % 11 = 0");
  }));
  using Line = std::tuple<std::string, std::string, std::int64_t, std::int64_t>;
  for (const std::string course : {"", "course"}) {
    for (const std::string group : {"", "class"}) {
      // the same, by definition: ranks among all attempts that count for somebody
      std::vector<Line> expected, found;
      ASSERT_OK(change([&](Connection& c) -> Status {
        ASSIGN_OR_RETURN(
            expected,
            c.query("SELECT a.trainee, a.exercise_id, a.place, s.definition_version FROM (SELECT *,"
                    " row_number() OVER (PARTITION BY trainee, exercise_id ORDER BY started_unix_ns, number)"
                    " AS place FROM sessions WHERE number % 11 <> 0) a JOIN scores s ON s.session = a.number"
                    " WHERE (?1 = '' OR a.exercise_id IN ('first', 'second', 'third'))"
                    " AND (?2 = '' OR a.trainee IN (SELECT person FROM group_members)) ORDER BY (SELECT name "
                    "FROM called"
                    " WHERE ref = a.trainee), 2, 3, 4",
                    course, group)
                .all([](const Statement& row) {
                  return Line{row.text(0), row.text(1), row.integer(2), row.integer(3)};
                }));
        return {};
      }));
      auto reader = store->readers().borrow();
      ASSERT_OK(reader);
      // each score on its own page, which begins after the previous one
      ScoreKey key;
      for (;;) {
        ScoreList list(**reader, key, course, group);
        const auto row = list.next();
        ASSERT_OK(row);
        if (!*row) break;
        key = list.key();
        const auto& attempt = (*row)->attempt();
        found.emplace_back(attempt.trainee(), attempt.exercise_id(), attempt.number(),
                           (*row)->score().definition_version());
      }
      EXPECT_EQ(found, expected) << course << " " << group;
      std::size_t at_once = 0;
      ScoreList whole(**reader, {}, course, group);
      for (auto row = whole.next(); row.ok() && *row; row = whole.next()) {
        ASSERT_LT(at_once, expected.size());
        EXPECT_EQ((*row)->attempt().number(), std::get<2>(expected[at_once++]));
      }
      EXPECT_EQ(at_once, expected.size());
    }
  }
}

TEST_F(ManyAttempts, trendsAreReadByOneStatementAndKnowTheirAttempts) {
  addStation();
  putCourse();
  addPerson("anna", pb::TRAINEE);
  pb::Request request;
  request.mutable_get_progress()->set_trainee("anna");
  request.mutable_get_progress()->set_exercise_id("first");
  attempts("anna", {"first"}, 5);
  const int few = statementsOf(trainee, request);
  attempts("anna", {"first"}, 300);
  EXPECT_EQ(statementsOf(trainee, request), few);
  for (int i = 0; i < 4; ++i) attemptWith("anna", "first", true, std::to_string(4 - i));
  const auto progress = get(trainee, request).progress();
  EXPECT_EQ(progress.attempts(199).number(), 200u);
  const auto rows = nlohmann::json::parse(progress.measures_json());
  ASSERT_EQ(rows.size(), 1u) << progress.measures_json();
  EXPECT_EQ(rows[0]["attempts"], (nlohmann::json{305, 306, 307, 308})) << "from 0, of all 309";
  EXPECT_EQ(rows[0]["values"], (nlohmann::json{4.0, 3.0, 2.0, 1.0}));
}

}  // namespace
}  // namespace needlelab
