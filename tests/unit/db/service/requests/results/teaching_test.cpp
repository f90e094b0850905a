// The managers' permissions, concurrent edits, classes from tables, locks, results.
#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "tests/support/anatomy/ball_profiles.h"
#include "tests/support/time_zone.h"
#include "tests/unit/db/service/requests/results/teaching_fixture.h"

namespace needlelab {
namespace {

using Teaching = test::TeachingTest;

TEST_F(Teaching, aManagerManagesOnlyRolesBelowItsOwn) {
  const auto add = [](const std::string& name, pb::Role role) {
    pb::Request request;
    request.mutable_add_user()->set_name(name);
    request.mutable_add_user()->set_role(role);
    request.mutable_add_user()->set_password("correct horse");
    return request;
  };
  EXPECT_EQ(refusal(manager, add("eve", pb::ADMINISTRATOR)), ErrorCode::kDenied);
  EXPECT_EQ(refusal(manager, add("eve", pb::RESEARCHER)), ErrorCode::kDenied);
  get(manager, add("ira", pb::INSTRUCTOR));
  get(admin, add("adam", pb::ADMINISTRATOR));
  get(admin, add("rita", pb::RESEARCHER));
  get(admin, add("max", pb::CURRICULUM_MANAGER));
  pb::Request change;
  change.mutable_change_user()->set_base_revision(1);
  for (const char* name : {"adam", "rita"}) {
    change.mutable_change_user()->set_name(name);
    change.mutable_change_user()->set_role(pb::TRAINEE);
    EXPECT_EQ(refusal(manager, change), ErrorCode::kDenied) << name;
    pb::Request password;
    password.mutable_set_password()->set_name(name);
    password.mutable_set_password()->set_password("another horse");
    EXPECT_EQ(refusal(manager, password), ErrorCode::kDenied) << name;
  }
  change.mutable_change_user()->set_name("ira");
  change.mutable_change_user()->set_role(pb::ADMINISTRATOR);
  EXPECT_EQ(refusal(manager, change), ErrorCode::kDenied) << "no one is made more than its maker";
  change.mutable_change_user()->set_role(pb::CURRICULUM_MANAGER);
  EXPECT_EQ(get(manager, change).user().revision(), 2u);
  pb::Request password;
  password.mutable_set_password()->set_name("max");
  password.mutable_set_password()->set_password("another horse");
  EXPECT_EQ(refusal(manager, password), ErrorCode::kDenied) << "a manager's password is its own";
}

TEST_F(Teaching, whoComesSecondHearsWhoChangedWhatWhenAndNothingIsLost) {
  for (const char* name : {"anna", "ben", "zoe"}) addPerson(name, pb::TRAINEE);
  get(manager, putGroup("class", {"anna"}, 0));
  const Principal other{"max", pb::CURRICULUM_MANAGER};
  get(other, putGroup("class", {"anna", "ben"}, 1));
  // the zone's name in winter and in summer
  const test::WithZone zone("NST3:30");
  const Outcome late = ask(manager, putGroup("class", {"anna", "zoe"}, 1));
  ASSERT_TRUE(late.error.has_value());
  EXPECT_EQ(late.error->code, ErrorCode::kConflict);
  EXPECT_EQ(late.error->current_revision, 2u);
  for (const char* words : {"'max'", "revision 2", "joined: ben", " NST"})
    EXPECT_NE(late.error->message.find(words), std::string::npos) << words << ": " << late.error->message;

  // profiles name the part
  pb::Request read;
  read.mutable_get_profile()->set_id("knee-adult");
  auto json = nlohmann::json::parse(get(manager, read).profile().json());
  pb::Request import;
  import.mutable_import_profile()->set_base_revision(1);
  json["name"] = "Renamed";
  json["layers"][0]["cutting_force_n"] = 0.25;
  import.mutable_import_profile()->set_json(json.dump());
  get(other, import);
  json["description"] = "mine";
  import.mutable_import_profile()->set_json(json.dump());
  const Outcome profile = ask(manager, import);
  ASSERT_TRUE(profile.error.has_value());
  EXPECT_EQ(profile.error->code, ErrorCode::kConflict);
  for (const char* words : {"'max'", "layers", "name"})
    EXPECT_NE(profile.error->message.find(words), std::string::npos)
        << words << ": " << profile.error->message;
}

TEST_F(Teaching, ofManyWhoEditAtOnceExactlyOneWinsEachRound) {
  constexpr int kThreads = 4, kRounds = 15;
  for (int i = 0; i < kThreads; ++i) addPerson("t" + std::to_string(i), pb::TRAINEE);
  get(manager, putGroup("class", {}, 0));
  std::atomic<int> won{0}, conflicts{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&, i] {
      const Principal who{"m" + std::to_string(i), pb::CURRICULUM_MANAGER};
      const std::string me = "t" + std::to_string(i);
      for (int round = 0; round < kRounds;) {
        pb::Request read;
        read.mutable_get_group()->set_id("class");
        const auto group = store->service().execute(who, read).reply.group();
        pb::Request put;
        *put.mutable_put_group()->mutable_group() = group;
        put.mutable_put_group()->set_base_revision(group.revision());
        // joins and leaves alternately, so that each successful edit is a new revision
        auto* members = put.mutable_put_group()->mutable_group()->mutable_members();
        const auto mine = std::find(members->begin(), members->end(), me);
        if (mine == members->end())
          *members->Add() = me;
        else
          members->erase(mine);
        const Outcome outcome = store->service().execute(who, put);
        if (!outcome.error) {
          ++won;
          ++round;
        } else {
          EXPECT_EQ(outcome.error->code, ErrorCode::kConflict) << outcome.error->message;
          ++conflicts;
        }
      }
    });
  }
  for (auto& thread : threads) thread.join();
  pb::Request read;
  read.mutable_get_group()->set_id("class");
  const auto group = get(manager, read).group();
  // No edit was lost: the revisions count them, and a user with an odd number of edits is a member.
  EXPECT_EQ(group.revision(), 1u + kThreads * kRounds);
  EXPECT_EQ(won, kThreads * kRounds);
  EXPECT_EQ(group.members_size(), kRounds % 2 == 1 ? kThreads : 0);
}

TEST_F(Teaching, aThousandPeopleAreImportedWhollyOrNotAtAll) {
  std::string csv = "name,full_name,role,group\n";
  for (int i = 0; i < 1000; ++i)
    csv += "s" + std::to_string(i) + ",\"Student, " + std::to_string(i) + "\",,class-a;all\r\n";
  const auto plan = importPeople(csv, true);
  EXPECT_EQ(plan.added(), 1000u);
  EXPECT_FALSE(plan.done());
  EXPECT_EQ(count("SELECT count(*) FROM people"), 0);
  EXPECT_TRUE(importPeople(csv).done());
  EXPECT_EQ(count("SELECT count(*) FROM people WHERE role = 1"), 1000);
  EXPECT_EQ(count("SELECT count(*) FROM group_members"), 2000);
  EXPECT_EQ(count("SELECT count(*) FROM accounts WHERE full_name = 'Student, 7'"), 1);
  // again: nothing to do, and no group gets a new revision
  const auto again = importPeople(csv);
  EXPECT_EQ(again.unchanged(), 1000u);
  EXPECT_EQ(count("SELECT max(revision) FROM groups"), 1);
}

TEST_F(Teaching, aTableWithFaultsNamesRowColumnAndReasonAndChangesNothing) {
  addPerson("anna", pb::TRAINEE);
  addPerson("adam", pb::ADMINISTRATOR);
  const auto report = importPeople(
      "role,name,password\n"
      "trainee,good,\n"
      "boss,bob,\n"
      ",anna,\n"
      "trainee,\n"
      "instructor,ida,\n"
      "instructor,ina2,short\n"
      "trainee,good,\n"
      "administrator,eve,correct horse\n"
      "trainee,adam,\n"
      "\n");
  EXPECT_FALSE(report.done());
  std::map<std::uint32_t, std::string> faults;
  for (const auto& row : report.rows())
    if (row.what() == pb::PeopleImport::FAULT) faults[row.line()] = row.column();
  const std::map<std::uint32_t, std::string> expected{
      {3, "role"}, {5, ""}, {6, "password"}, {7, "password"}, {8, "name"}, {9, "role"}, {10, "role"}};
  EXPECT_EQ(faults, expected) << report.DebugString();
  EXPECT_EQ(report.faults(), 7u);
  EXPECT_EQ(count("SELECT count(*) FROM people"), 2);
  for (const std::string& csv :
       {std::string(), std::string("name\n"), std::string("name,name\na,b\n"), std::string("name\n\"a\n"),
        std::string("name\n\"a\"b\n"), std::string("name\n\xff\n")}) {
    pb::Request request;
    request.mutable_import_people()->set_csv(csv);
    EXPECT_EQ(refusal(manager, request), ErrorCode::kInvalidInput) << csv;
  }
  // A user with a password can log in.
  EXPECT_TRUE(importPeople("name,role,password\nira,instructor,correct horse\ntom,,\n").done());
  EXPECT_OK(store->service().logins().loginPerson("ira", "correct horse"));
  EXPECT_FALSE(store->service().logins().loginPerson("tom", "").ok());
}

TEST_F(Teaching, coursesWithPrerequisitesInACircleAreRefusedWithTheCircle) {
  pb::Request request;
  const auto import = [&](const char* first, const char* second, const char* third) {
    nlohmann::json course{{"id", "course"}, {"name", "A course"}, {"exercises", nlohmann::json::array()}};
    for (const auto& [id, before] :
         std::map<std::string, std::string>{{"first", first}, {"second", second}, {"third", third}}) {
      nlohmann::json exercise{{"id", id}, {"name", id}, {"profile_id", "knee-adult"}};
      if (!before.empty()) exercise["prerequisites"] = {before};
      course["exercises"].push_back(exercise);
    }
    request.mutable_import_curriculum()->set_json(course.dump());
    return ask(manager, request).error;
  };
  const auto circle = import("third", "first", "second");
  ASSERT_TRUE(circle.has_value());
  EXPECT_EQ(circle->code, ErrorCode::kInvalidInput);
  EXPECT_NE(circle->message.find("\"first\" needs \"third\" needs \"second\" needs \"first\""),
            std::string::npos)
      << circle->message;
  const auto itself = import("", "second", "");
  ASSERT_TRUE(itself.has_value());
  EXPECT_NE(itself->message.find("\"second\" needs \"second\""), std::string::npos) << itself->message;
  const auto stranger = import("elsewhere", "", "");
  ASSERT_TRUE(stranger.has_value());
  EXPECT_NE(stranger->message.find("exercises[0].prerequisites[0]"), std::string::npos) << stranger->message;
  EXPECT_FALSE(import("", "first", "second").has_value());
}

TEST_F(Teaching, anExerciseIsLockedUntilWhatComesBeforeItIsPassed) {
  addStation();
  putCourse(
      {{"second", {{"prerequisites", {"first"}}}}, {"third", {{"prerequisites", {"first", "second"}}}}});
  EXPECT_FALSE(lesson("first").has_value());
  const auto locked = lesson("third");
  ASSERT_TRUE(locked.has_value());
  EXPECT_EQ(locked->code, ErrorCode::kDenied);
  EXPECT_EQ(locked->message, "\"The third\" is still locked: pass \"The first\", \"The second\" first");
  attempt("anna", "first", false);
  EXPECT_TRUE(lesson("second").has_value());
  attempt("anna", "first", true);
  EXPECT_FALSE(lesson("second").has_value());
  EXPECT_TRUE(lesson("second", "ben").has_value()) << "each for itself";
  EXPECT_FALSE(lesson("third", "").has_value()) << "no one in particular looks at anything";
  attempt("anna", "second", true);
  EXPECT_FALSE(lesson("third").has_value());
  // a later failure does not lock it again
  attempt("anna", "first", false);
  EXPECT_FALSE(lesson("third").has_value());
}

TEST_F(Teaching, attemptsAreCountedAndMayBeGivenBack) {
  addStation();
  putCourse({{"first", {{"attempts", 2}}}});
  addPerson("anna", pb::TRAINEE);
  pb::Request ask_lesson;
  ask_lesson.mutable_get_lesson()->set_exercise_id("first");
  ask_lesson.mutable_get_lesson()->set_trainee("anna");
  const auto fresh = get(station, ask_lesson).lesson();
  EXPECT_EQ(fresh.attempt(), 1u);
  EXPECT_EQ(fresh.attempts_left(), 2u);
  attempt("anna", "first", false);
  const Uuid last = attempt("anna", "first", false);
  const auto spent = lesson("first");
  ASSERT_TRUE(spent.has_value());
  EXPECT_NE(spent->message.find("all 2 attempts have been used"), std::string::npos) << spent->message;
  pb::Request excuse;
  excuse.mutable_excuse_attempt()->set_session_id(test::bytesOfId(last));
  excuse.mutable_excuse_attempt()->set_excused(true);
  excuse.mutable_excuse_attempt()->set_reason("the station stopped");
  EXPECT_TRUE(get(instructor, excuse).attempt().excused());
  const auto back = get(station, ask_lesson).lesson();
  EXPECT_EQ(back.attempt(), 3u);
  EXPECT_EQ(back.attempts_left(), 1u);
}

TEST_F(Teaching, anExercisesOwnNeedleIsTheLessons) {
  putCourse({{"first", {{"needle", {{"length_m", 0.05}, {"gauge", 22}}}}}});
  pb::Request request;
  request.mutable_get_lesson()->set_exercise_id("first");
  const auto lesson = nlohmann::json::parse(get(station, request).lesson().profile_json());
  EXPECT_EQ(lesson["needle"]["gauge"], 22);
  EXPECT_EQ(lesson["id"], "knee-adult");
  pb::Request wrong;
  wrong.mutable_import_curriculum()->set_json(
      R"({"id":"c2","name":"C","exercises":[{"id":"x","name":"X","profile_id":"knee-adult","needle":{"length_m":0.05,"gauge":22,"outer_diameter_m":0.003}}]})");
  EXPECT_EQ(refusal(manager, wrong), ErrorCode::kInvalidInput);
}

TEST_F(Teaching, theMatrixOfACourse) {
  addStation();
  putCourse({{"second", {{"prerequisites", {"first"}}, {"attempts", 3}}}});
  for (const char* name : {"anna", "ben", "zoe"}) addPerson(name, pb::TRAINEE);
  get(manager, putGroup("class", {"anna", "zoe"}, 0));
  pb::Request assign;
  assign.mutable_assign()->set_course_id("course");
  assign.mutable_assign()->set_group_id("class");
  assign.mutable_assign()->set_due_unix_ns(1'700'000'001'000'000'000);
  EXPECT_EQ(get(manager, assign).assignments().assignments_size(), 1);
  attempt("anna", "first", false);
  const Uuid best = attempt("anna", "first", true, 1'700'000'002'000'000'000);
  attempt("anna", "first", false, 1'700'000'003'000'000'000);
  attempt("ben", "first", false);
  const auto all = results(instructor);
  ASSERT_EQ(all.rows_size(), 3) << "those of the group, and who tried without";
  ASSERT_EQ(all.exercise_ids_size(), 3);
  const auto& anna = all.rows(0);
  EXPECT_EQ(anna.trainee(), "anna");
  EXPECT_EQ(anna.cells(0).attempts(), 3u);
  EXPECT_TRUE(anna.cells(0).passed());
  EXPECT_EQ(anna.cells(0).best().session_id(), test::bytesOfId(best)) << "a pass before what came after it";
  EXPECT_TRUE(anna.cells(0).best().late());
  EXPECT_FALSE(anna.cells(0).overdue());
  EXPECT_TRUE(anna.cells(2).overdue());
  EXPECT_EQ(anna.cells(1).attempts_left(), 3u);
  EXPECT_EQ(anna.cells(1).locked_by_size(), 0);
  EXPECT_EQ(all.rows(1).trainee(), "ben");
  EXPECT_EQ(all.rows(1).cells(0).due_unix_ns(), 0) << "no one gave it to ben";
  ASSERT_EQ(all.rows(1).cells(1).locked_by_size(), 1);
  EXPECT_EQ(all.rows(1).cells(1).locked_by(0), "first");
  EXPECT_EQ(results(instructor, "class").rows_size(), 2);
  ASSERT_EQ(results(trainee).rows_size(), 1) << "a trainee sees its own row";
  EXPECT_EQ(results(trainee).rows(0).trainee(), "anna");

  pb::Request progress;
  progress.mutable_get_progress()->set_trainee("anna");
  progress.mutable_get_progress()->set_exercise_id("first");
  const auto attempts = get(trainee, progress).progress();
  ASSERT_EQ(attempts.attempts_size(), 3);
  EXPECT_FALSE(attempts.attempts(0).late());
  EXPECT_EQ(attempts.attempts(1).number(), 2u);
  EXPECT_NE(attempts.attempts(1).score_json(), "");
  progress.mutable_get_progress()->set_trainee("ben");
  EXPECT_EQ(refusal(trainee, progress), ErrorCode::kDenied);
  const auto of_ben = get(instructor, progress).progress();
  ASSERT_EQ(of_ben.attempts_size(), 1);
  EXPECT_FALSE(of_ben.attempts(0).late()) << "without a date nothing is late";
  pb::Request unknown;
  unknown.mutable_get_results()->set_course_id("nothing");
  EXPECT_EQ(refusal(instructor, unknown), ErrorCode::kNotFound);
}

TEST_F(Teaching, aStationGetsNamesAndItsTraineesCells) {
  addStation();
  putCourse({{"second", {{"prerequisites", {"first"}}, {"attempts", 3}}},
             {"third", {{"requirements", nlohmann::json::array()}}}});
  for (const char* name : {"anna", "ben", "gone"}) addPerson(name, pb::TRAINEE);
  ASSERT_OK(change([](Connection& c) {
    PersonChange change;
    change.full_name = "Anna Adler";
    const auto changed = PeopleStore(c).change("anna", 1, change, "mara", 2);
    return changed ? Status() : Status(changed.error());
  }));
  ASSERT_OK(change([](Connection& c) { return PeopleStore(c).setDisabled("gone", true, "mara", 3); }));
  get(manager, putGroup("class", {"anna", "ben", "gone"}, 0));
  pb::Request assign;
  assign.mutable_assign()->set_course_id("course");
  assign.mutable_assign()->set_group_id("class");
  get(manager, assign);
  attempt("anna", "first", false);
  attempt("anna", "third", false);

  const auto names = results(station);
  ASSERT_EQ(names.rows_size(), 2) << "no one whose access has ended";
  EXPECT_EQ(names.rows(0).trainee(), "anna");
  EXPECT_EQ(names.rows(0).full_name(), "Anna Adler");
  EXPECT_EQ(names.rows(1).trainee(), "ben");
  for (const auto& row : names.rows()) EXPECT_EQ(row.cells_size(), 0) << row.trainee();

  pb::Request one;
  one.mutable_get_results()->set_course_id("course");
  one.mutable_get_results()->set_trainee("anna");
  const auto own = get(station, one).results();
  ASSERT_EQ(own.rows_size(), 1);
  ASSERT_EQ(own.rows(0).cells_size(), 3);
  const auto& cells = own.rows(0).cells();
  EXPECT_FALSE(cells[0].done());
  EXPECT_EQ(cells[0].attempts(), 1u);
  EXPECT_FALSE(cells[0].has_best()) << "a station shows no session";
  ASSERT_EQ(cells[1].locked_by_size(), 1);
  EXPECT_EQ(cells[1].attempts_left(), 3u);
  EXPECT_TRUE(cells[2].done()) << "nothing is required, and it was tried";

  // the same row for the trainee and for staff, with `best`; another's row not for a trainee
  EXPECT_TRUE(get(trainee, one).results().rows(0).cells(0).has_best());
  EXPECT_EQ(get(instructor, one).results().rows_size(), 1);
  one.mutable_get_results()->set_trainee("ben");
  EXPECT_EQ(refusal(trainee, one), ErrorCode::kDenied);
  // also for the guest, who needs no account
  one.mutable_get_results()->set_trainee("guest");
  EXPECT_EQ(get(station, one).results().rows(0).cells(1).locked_by_size(), 1);
}

TEST_F(Teaching, exportedResultsHaveGroupsExcusedAttemptsAndRequirements) {
  addStation();
  putCourse({{"second", {{"time_limit_s", 60}}},
             {"third", {{"requirements", {{{"measure", "greatest_depth_m"}, {"max", 0.02}}}}}}});
  for (const char* name : {"anna", "ben"}) addPerson(name, pb::TRAINEE);
  get(manager, putGroup("spring", {"anna"}, 0));
  get(manager, putGroup("autumn", {"anna"}, 0));
  attempt("anna", "first", false);
  // two rows of a score: the second measure is not required
  const Uuid best = attemptWith("anna", "first", true,
                                R"(2.5,"unit":"N","max":5,"passed":true,"words":"w"},)"
                                R"({"measure":"sparc","value":-3)");
  pb::Request excuse;
  excuse.mutable_excuse_attempt()->set_session_id(test::bytesOfId(attempt("ben", "first", false)));
  excuse.mutable_excuse_attempt()->set_excused(true);
  get(instructor, excuse);

  pb::Request ask;
  ask.mutable_get_results()->set_course_id("course");
  const auto plain = get(instructor, ask).results();
  EXPECT_EQ(plain.required_measures_size(), 0);
  EXPECT_EQ(plain.rows(0).groups_size(), 0);
  EXPECT_FALSE(plain.rows(0).cells(0).has_excused());
  EXPECT_EQ(plain.rows(0).cells(0).best().score_json(), "");
  EXPECT_EQ(count("SELECT count(*) FROM audit WHERE action = 'results'"), 0) << "a page on a screen";

  ask.mutable_get_results()->set_with_measures(true);
  const auto all = get(instructor, ask).results();
  EXPECT_THAT(all.required_measures(),
              testing::ElementsAre("peak_force_n", "needle_time_s", "greatest_depth_m"));
  ASSERT_EQ(all.rows_size(), 2);
  EXPECT_THAT(all.rows(0).groups(), testing::ElementsAre("autumn", "spring"));
  EXPECT_THAT(all.rows(1).groups(), testing::ElementsAre());
  const pb::ResultCell& cell = all.rows(0).cells(0);
  EXPECT_EQ(cell.best().session_id(), test::bytesOfId(best));
  EXPECT_EQ(cell.best().number(), 2u);
  EXPECT_EQ(nlohmann::json::parse(cell.best().score_json()),
            nlohmann::json::parse(
                R"([{"measure":"peak_force_n","value":2.5,"unit":"N","max":5.0,"passed":true,"words":""}])"));
  EXPECT_EQ(cell.excused(), 0u);
  EXPECT_EQ(all.rows(1).cells(0).attempts(), 0u);
  EXPECT_EQ(all.rows(1).cells(0).excused(), 1u);
  EXPECT_EQ(count("SELECT count(*) FROM audit WHERE action = 'results' AND subject = 'course'"), 1);

  // a trainee's own row does not reveal others' data; a station gets nothing of it
  ask.mutable_get_results()->set_trainee("anna");
  EXPECT_NE(get(trainee, ask).results().rows(0).cells(0).best().score_json(), "");
  EXPECT_EQ(count("SELECT count(*) FROM audit WHERE action = 'results'"), 1);
  const auto at_station = get(station, ask).results();
  EXPECT_EQ(at_station.required_measures_size(), 0);
  EXPECT_EQ(at_station.rows(0).groups_size(), 0);
  EXPECT_FALSE(at_station.rows(0).cells(0).has_best());
}

TEST_F(Teaching, scoresAndReferencesOfAnExercise) {
  addStation();
  putCourse();
  addPerson("anna", pb::TRAINEE);
  std::vector<Uuid> experts;
  for (const char* force_N : {"2.8", "2.9", "3", "3.1", "3.2"})
    experts.push_back(attemptWith("eva", "first", true, force_N));
  const Uuid own = attempt("anna", "first", false);
  pb::Request set;
  set.mutable_set_reference()->set_exercise_id("first");
  for (const Uuid& id : experts) set.mutable_set_reference()->add_session_ids(test::bytesOfId(id));
  const auto reference = get(instructor, set).reference();
  ASSERT_EQ(reference.bands_size(), 1);
  EXPECT_EQ(reference.bands(0).measure(), "peak_force_n");
  EXPECT_EQ(reference.bands(0).n(), 5u);
  EXPECT_DOUBLE_EQ(reference.bands(0).mean(), 3);
  EXPECT_NEAR(reference.bands(0).sd(), std::sqrt(0.1 / 4), 1e-12);
  EXPECT_EQ(refusal(instructor, set), ErrorCode::kConflict);
  pb::Request score;
  score.mutable_get_score()->set_session_id(test::bytesOfId(own));
  const auto got = get(trainee, score).score();
  EXPECT_TRUE(got.first());
  EXPECT_FALSE(got.passed());
  const auto comparison = nlohmann::json::parse(got.comparison_json());
  ASSERT_EQ(comparison.size(), 1u);
  EXPECT_EQ(comparison[0]["measure"], "peak_force_n");
  EXPECT_EQ(comparison[0]["place"], "above");
  score.mutable_get_score()->set_session_id(test::bytesOfId(experts[0]));
  EXPECT_EQ(refusal(trainee, score), ErrorCode::kNotFound) << "somebody else's";
  pb::Request list;
  list.mutable_list_scores()->set_course_id("course");
  EXPECT_EQ(get(instructor, list).scores().scores_size(), 6);
  list.mutable_list_scores()->set_group_id("nobody");
  EXPECT_EQ(refusal(instructor, list), ErrorCode::kNotFound) << "a mistyped group";
  pb::Request measures;
  measures.mutable_list_measures();
  EXPECT_GT(get(researcher, measures).measures().measures_size(), 20);
}

TEST_F(Teaching, whoWatchesLiveIsInTheAuditLogOnceAnHour) {
  addStation();
  const Uuid open = addSession("anna", 1);
  const Principal other{"mia", pb::CURRICULUM_MANAGER};
  const auto hears = [](const Error& error) { ADD_FAILURE() << error.message; };
  for (int again = 0; again < 3; ++again) {
    store->service().notes().noteWatching(instructor, "station-1", "", hears);
    store->service().notes().noteWatching(instructor, "", test::bytesOfId(open), hears);
    store->service().notes().noteWatching(instructor, "", "", hears);
    store->service().notes().noteWatching(instructor, "made up", "", hears);
    store->service().notes().noteWatching(instructor, "", test::bytesOfId(makeUuidV7()), hears);
  }
  store->service().notes().noteWatching(other, "station-1", "", hears);
  // waits until the writer has finished them
  ASSERT_OK(change([](Connection&) { return Status(); }));
  pb::Request list;
  list.mutable_list_audit()->set_action("watch live");
  std::vector<std::string> lines;
  const auto log = get(admin, list).audit();
  for (const auto& line : log.entries()) lines.push_back(line.who() + " " + line.subject());
  std::sort(lines.begin(), lines.end());
  std::vector<std::string> expected{"ina " + uuidText(open), "ina station-1", "mia station-1"};
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(lines, expected);
}

// The finding: "x\0y" instead of a session, in the same packet: on PostgreSQL neither got a line.
TEST_F(Teaching, aLineThatCannotBeStoredTakesNoOthersWithIt) {
  addStation();
  const Uuid open = addSession("anna", 1);
  std::vector<std::string> failed;  // on the writer's thread
  const auto hears = [&failed](const Error& error) { failed.push_back(error.message); };
  std::promise<void> begun, go;
  ASSERT_OK(store->writer().post(
      [&begun, held = go.get_future().share()](Connection&) -> Status {
        begun.set_value();
        held.wait();
        return {};
      },
      {}));
  begun.get_future().wait();
  store->service().notes().noteWatching(instructor, "", test::bytesOfId(open), hears);
  store->service().notes().noteWatching(instructor, std::string("x\0y", 3), "", hears);
  store->service().notes().noteSoon({instructor.name}, "access ended", std::string("a\0b", 3), "", hears);
  store->service().notes().noteWatching(instructor, "station-1", "", hears);
  go.set_value();
  while (store->writer().counters().waiting > 0) std::this_thread::yield();
  // the lines' item may end with the first; separate attempts come before the second
  ASSERT_OK(change([](Connection&) { return Status(); }));
  ASSERT_OK(change([](Connection&) { return Status(); }));
  pb::Request list;
  list.mutable_list_audit()->set_action("watch live");
  EXPECT_EQ(get(admin, list).audit().entries_size(), 2);
  list.mutable_list_audit()->set_action("access ended");
  const auto ended = get(admin, list).audit();
  ASSERT_EQ(ended.entries_size(), 1);
  EXPECT_EQ(ended.entries(0).subject(), "(3 bytes that are not text)");
  // SQLite finds no such station; PostgreSQL does not accept such a text
  EXPECT_EQ(failed.size(), test::onPostgres() ? 1u : 0u);
}

/// Holds the writer and fills its queue until release().
class FullWriter {
 public:
  FullWriter(DbWriter& writer, DbWriter::Places places) {
    std::promise<void> begun;
    EXPECT_OK(writer.post(
        [&begun, held = go_.get_future().share()](Connection&) -> Status {
          begun.set_value();
          held.wait();
          return {};
        },
        {}));
    begun.get_future().wait();
    while (writer.post([](Connection&) { return Status(); }, {}, places).ok()) continue;
  }
  ~FullWriter() { release(); }
  void release() {
    if (!std::exchange(released_, true)) go_.set_value();
  }

 private:
  std::promise<void> go_;
  bool released_ = false;
};

// The finding: a friend's station filled the queue, and 13 of 40 sessions were watched without a line.
TEST_F(Teaching, watchingIsAuditedDespiteAFullQueue) {
  addStation();
  std::vector<std::string> open;
  for (int i = 0; i < 40; ++i) open.push_back(test::bytesOfId(addSession("anna", 1)));
  FullWriter full(store->writer(), DbWriter::Places::kCommon);
  for (const std::string& session : open)
    store->service().notes().noteWatching(instructor, "", session,
                                          [](const Error& error) { ADD_FAILURE() << error.message; });
  full.release();
  while (store->writer().counters().waiting > 0) std::this_thread::yield();
  ASSERT_OK(change([](Connection&) { return Status(); }));
  pb::Request list;
  list.mutable_list_audit()->set_action("watch live");
  EXPECT_EQ(get(admin, list).audit().entries_size(), 40);
}

TEST_F(Teaching, anUnstoredLineIsReportedAndRetriedWithTheNextWatching) {
  addStation();
  std::vector<ErrorCode> failed;
  const auto hears = [&failed](const Error& error) { failed.push_back(error.code); };
  {
    FullWriter full(store->writer(), DbWriter::Places::kKept);
    store->service().notes().noteWatching(instructor, "station-1", "", hears);
    EXPECT_EQ(failed, std::vector{ErrorCode::kUnavailable});
    EXPECT_FALSE(store->service().notes().noteLogin(instructor, "127.0.0.1").ok());
  }
  while (store->writer().counters().waiting > 0) std::this_thread::yield();
  store->service().notes().noteWatching(instructor, "station-1", "", hears);
  EXPECT_OK(store->service().notes().noteLogin(instructor, "127.0.0.1"));
  EXPECT_EQ(failed.size(), 1u);
  for (const char* action : {"watch live", "log-in"}) {
    pb::Request list;
    list.mutable_list_audit()->set_action(action);
    EXPECT_EQ(get(admin, list).audit().entries_size(), 1) << action;
  }
}

// A band of one gesture is that session's result, which a trainee may not read (score show: NOT_FOUND).
TEST_F(Teaching, aTraineeIsShownExpertsOnlyFromFiveGesturesOn) {
  addStation();
  putCourse();
  addPerson("anna", pb::TRAINEE);
  pb::Request own, set, show;
  own.mutable_get_score()->set_session_id(test::bytesOfId(attempt("anna", "first", false)));
  set.mutable_set_reference()->set_exercise_id("first");
  show.mutable_get_reference()->set_exercise_id("first");
  const auto compared = [&](const Principal& who) {
    const std::string text = get(who, own).score().comparison_json();
    return text.empty() ? std::size_t{0} : nlohmann::json::parse(text).size();
  };
  for (int n = 1; n <= 5; ++n) {
    set.mutable_set_reference()->add_session_ids(
        test::bytesOfId(attemptWith("eva", "first", true, std::to_string(n))));
    const auto chosen = get(instructor, set).reference();
    set.mutable_set_reference()->set_base_revision(chosen.revision());
    EXPECT_EQ(get(instructor, show).reference().bands_size(), 1) << n;
    EXPECT_EQ(compared(instructor), 1u) << n;
    const auto seen = get(trainee, show).reference();
    EXPECT_EQ(seen.session_ids_size(), n);
    EXPECT_EQ(seen.bands_size(), n < 5 ? 0 : 1) << n;
    EXPECT_EQ(compared(trainee), n < 5 ? 0u : 1u) << n;
  }
}

TEST_F(Teaching, aSessionTouchingAHazardOrBoneIsNoReference) {
  addStation();
  putCourse();
  const auto row = [](const char* measure, int value) {
    return nlohmann::json(
               {{"measure", measure}, {"value", value}, {"unit", ""}, {"words", "as an older program said"}})
        .dump();
  };
  const auto expert = [&](int hazards, int bones) {
    return attemptWith("eva", "first", true, "3", 0,
                       "," + row("hazards_touched", hazards) + "," + row("bone_contacts", bones));
  };
  const auto choose = [&](const std::vector<Uuid>& sessions) {
    pb::Request set;
    set.mutable_set_reference()->set_exercise_id("first");
    for (const Uuid& id : sessions) set.mutable_set_reference()->add_session_ids(test::bytesOfId(id));
    return ask(instructor, set);
  };
  const Uuid clean = expert(0, 0), nerve = expert(1, 0), bones = expert(2, 3);
  const auto refused = choose({clean, nerve, bones});
  ASSERT_TRUE(refused.error);
  EXPECT_EQ(refused.error->code, ErrorCode::kInvalidInput);
  EXPECT_EQ(refused.error->message,
            "the reference of exercise 'first', session " + uuidText(nerve) + ": touched 1 hazard; session " +
                uuidText(bones) +
                ": touched 2 hazards, 3 contacts with bone; no hazard and no bone may be touched in a "
                "reference: leave them out");
  const auto one = choose({bones});
  ASSERT_TRUE(one.error);
  EXPECT_THAT(one.error->message, testing::EndsWith("leave it out"));
  pb::Request show;
  show.mutable_get_reference()->set_exercise_id("first");
  EXPECT_EQ(get(instructor, show).reference().revision(), 0u) << "nothing was changed";
  EXPECT_FALSE(choose({clean}).error);
}

TEST_F(Teaching, aRescoredSessionKeepsItsFirstScore) {
  addStation();
  pb::Request profile;
  profile.mutable_get_profile()->set_id("knee-adult");
  const Uuid id = addSession("anna", 5, 100, get(admin, profile).profile().json());
  pb::Request rescore;
  rescore.mutable_rescore_session()->set_session_id(test::bytesOfId(id));
  EXPECT_EQ(refusal(instructor, rescore), ErrorCode::kUnavailable) << "it is open";
  ASSERT_OK(store->service().scoring().closeSession(test::closeOf(id, 5, 100), "station-1"));
  // As if an older program had scored it.
  ASSERT_OK(change([](Connection& c) {
    return c.script(
        "UPDATE scores SET definition_version = 1, measures = '[]'; UPDATE sessions SET score_json = '[]'");
  }));
  const auto again = get(instructor, rescore).score();
  EXPECT_GT(again.definition_version(), 1u);
  EXPECT_FALSE(again.first());
  EXPECT_NE(again.measures_json().find("elapsed_s"), std::string::npos);
  pb::Request show;
  show.mutable_get_session()->set_session_id(test::bytesOfId(id));
  EXPECT_EQ(get(instructor, show).session().score_json(), "[]");
  show.mutable_get_score()->set_session_id(test::bytesOfId(id));
  EXPECT_EQ(get(instructor, show).score().definition_version(), again.definition_version());
  show.mutable_get_score()->set_definition_version(1);
  EXPECT_EQ(get(instructor, show).score().measures_json(), "[]");
}

TEST_F(Teaching, aTextIsCheckedWithoutBeingStored) {
  const auto check = [&](const std::string& json, const std::string& kind) {
    pb::Request request;
    request.mutable_check_text()->set_json(json);
    request.mutable_check_text()->set_kind(kind);
    return get(instructor, request).text_check();
  };
  pb::Request read;
  read.mutable_get_profile()->set_id("knee-adult");
  auto json = nlohmann::json::parse(get(manager, read).profile().json());
  EXPECT_TRUE(check(json.dump(), "").ok());
  json["layers"][1]["cutting_force_n"] = 75;
  const auto wrong = check(json.dump(), "profile");
  EXPECT_FALSE(wrong.ok());
  ASSERT_EQ(wrong.problems_size(), 1);
  EXPECT_EQ(wrong.problems(0).path(), "layers[1].cutting_force_n");
  EXPECT_NE(wrong.problems(0).message().find("75"), std::string::npos);
  const auto broken = check("{\"id\":", "profile");
  ASSERT_EQ(broken.problems_size(), 1);
  EXPECT_NE(broken.problems(0).message(), "");
  const auto course =
      check(R"({"id":"c","name":"C","exercises":[{"id":"x","name":"X","profile_id":"nothing"}]})", "course");
  ASSERT_EQ(course.problems_size(), 1);
  EXPECT_EQ(course.problems(0).path(), "exercises[0].profile_id");
}

TEST_F(Teaching, thePreviewOfAVolumeIsThatOfTheBallOfLayers) {
  const auto previewOf = [&](const nlohmann::json& tree) {
    pb::Request request;
    request.mutable_preview_profile()->set_json(tree.dump());
    request.mutable_preview_profile()->set_to_depth_m(0.025);
    request.mutable_preview_profile()->set_points(100);
    return get(instructor, request).profile_preview();
  };
  // boundaries between two ticks, which are whole micrometres apart
  nlohmann::json layers = test::ballOfLayers(), rules = test::ballOfRules();
  layers["layers"][0]["thickness_m"] = 0.0030037;
  rules.erase("targets");  // straight in, as through layers
  nlohmann::json& written = rules["volume"]["rules"];
  written[0]["from_m"] = written[1]["to_m"] = -0.0030037;
  written[1]["from_m"] = -0.0090037;
  const auto expected = previewOf(layers), found = previewOf(rules);
  ASSERT_EQ(found.total_n_size(), expected.total_n_size());
  double peak_N = 0;
  for (int i = 0; i < found.total_n_size(); ++i) {
    EXPECT_NEAR(found.total_n(i), expected.total_n(i), 1e-3) << found.depth_m(i);
    peak_N = std::max(peak_N, std::abs(found.total_n(i)));
  }
  EXPECT_GT(peak_N, 0.5);
  ASSERT_EQ(found.layers_size(), 3);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(found.layers(i).name(), expected.layers(i).name());
    EXPECT_NEAR(found.layers(i).from_m(), expected.layers(i).from_m(), 1e-6);
  }
}

TEST_F(Teaching, thePreviewOfABodyGoesFromItsEntryToItsFirstTarget) {
  nlohmann::json ball = test::ballOfRules();
  const Vec3 target_m{0.01, 0, -0.02}, center_m{0, 0, -0.05};
  ball["targets"] = nlohmann::json::parse(
      R"([{"name": "aside", "center_m": {"x": 0.01, "y": 0, "z": -0.02}, "radius_m": 0.002}])");
  pb::Request request;
  request.mutable_preview_profile()->set_json(ball.dump());
  const auto found = get(instructor, request).profile_preview();
  ASSERT_EQ(found.layers_size(), 3);
  // where a line from the top of the ball meets the balls within it
  const double along_m = dot(normalized(target_m), center_m);
  const auto meets_m = [&](double radius_m) {
    return along_m - std::sqrt(along_m * along_m - dot(center_m, center_m) + radius_m * radius_m);
  };
  EXPECT_NEAR(found.layers(1).from_m(), meets_m(0.047), 1e-5);
  EXPECT_NEAR(found.layers(2).from_m(), meets_m(0.041), 1e-5);
  EXPECT_GT(found.layers(2).from_m(), 0.0095) << "longer than straight in, 9 mm";
  // nearly along the skin no needle is led: straight in
  ball["targets"][0]["center_m"] = {{"x", 0.04}, {"y", 0}, {"z", -0.001}};
  request.mutable_preview_profile()->set_json(ball.dump());
  EXPECT_NEAR(get(instructor, request).profile_preview().layers(2).from_m(), 0.009, 1e-5);
}

TEST_F(Teaching, thePreviewIsWhatTheEngineRenders) {
  pb::Request request;
  auto* call = request.mutable_preview_profile();
  pb::Request read;
  read.mutable_get_profile()->set_id("knee-adult");
  const std::string json = get(manager, read).profile().json();
  call->set_json(json);
  call->set_points(200);
  const auto preview = get(instructor, request).profile_preview();
  ASSERT_EQ(preview.depth_m_size(), 200);
  ASSERT_EQ(preview.total_n_size(), 200);
  const auto profile = nlohmann::json::parse(json);
  EXPECT_EQ(preview.layers_size(), static_cast<int>(profile["layers"].size()));
  EXPECT_EQ(preview.layers(4).tissue(), "OTHER");
  EXPECT_EQ(preview.layers(4).name(), "suprapatellar recess");
  EXPECT_EQ(preview.layers(0).name(), "skin");
  double bottom = 0, bone = 0;
  for (const auto& layer : profile["layers"]) {
    if (layer["tissue"] == "BONE") bone = bottom;
    bottom += layer["thickness_m"].get<double>();
  }
  EXPECT_NEAR(preview.depth_m(199), std::min(bottom, profile["needle"]["length_m"].get<double>()), 2e-5);
  EXPECT_NEAR(preview.depth_m(0), 0, 2e-5);
  double sum = 0;
  for (int i = 0; i < 200; ++i) {
    EXPECT_LE(std::abs(preview.total_n(i)), preview.max_force_n() + 1e-9);
    double parts = 0;
    for (const auto& curve : preview.by_effect()) parts += curve.force_n(i);
    // clipped, the whole is less than its parts; bone pushes along its own normal, so it has no curve along u
    if (preview.depth_m(i) < bone && std::abs(parts) < preview.max_force_n() - 1e-6) {
      EXPECT_NEAR(parts, preview.total_n(i), 1e-6) << i;
    }
    sum += preview.total_n(i);
  }
  EXPECT_GT(sum, 0) << "tissue holds against the needle";
  call->set_points(1);
  EXPECT_EQ(refusal(instructor, request), ErrorCode::kInvalidInput);
  call->set_points(10);
  call->set_json("{}");
  EXPECT_EQ(refusal(instructor, request), ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab
