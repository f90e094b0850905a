// The contents and refusals of the stores: groups, assignments, attempts, scores, references, consent.
#include <optional>

#include "db/people/people.h"
#include "db/people/person_refs.h"
#include "db/sessions/session_results.h"
#include "db/teaching/assignments.h"
#include "db/teaching/attempt_sums.h"
#include "db/teaching/attempts.h"
#include "db/teaching/documents.h"
#include "tests/support/time_zone.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

// refs of the people added by SetUp(), in this order
constexpr const char *kAnna = "@1", *kBen = "@2", *kZoe = "@3";

class TeachingStores : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK(ProfileStore(db.writer).put({"knee", 0, "A knee", "{}", "mia", 1}));
    ASSERT_OK(CurriculumStore(db.writer).put({"basics",
                                              0,
                                              "Basics",
                                              "{}",
                                              "mia",
                                              1,
                                              {{"a", "", "A", "knee", "{}"}, {"b", "", "B", "knee", "{}"}}}));
    for (const char* name : {"anna", "ben", "zoe"})
      ASSERT_OK(PeopleStore(db.writer).add({name, pb::TRAINEE, "", false, 1}));
  }
  static pb::Group group(const std::string& id, const std::vector<std::string>& members) {
    pb::Group group;
    group.set_id(id);
    group.set_name("Group " + id);
    for (const auto& name : members) group.add_members(name);
    return group;
  }
  pb::Assignment assignment(const std::string& course, const std::string& exercise,
                            const std::string& to_group, const std::string& trainee, std::int64_t due = 0) {
    pb::Assignment a;
    a.set_course_id(course);
    a.set_exercise_id(exercise);
    a.set_group_id(to_group);
    a.set_trainee(trainee);
    a.set_due_unix_ns(due);
    a.set_by("mia");
    a.set_created_unix_ns(++created_);
    return a;
  }
  /// A session of a trainee, closed when it is scored.
  Uuid session(const std::string& trainee, const std::string& exercise, std::int64_t started) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee(*shownName(db.writer, trainee));
    d.set_exercise_id(exercise);
    d.set_started_unix_ns(started);
    EXPECT_OK(SessionStore(db.writer).open(d, 1));
    return id;
  }

  test::TestDb db;
  std::int64_t created_ = 0;
};

TEST_F(TeachingStores, aGroupIsEditedFromItsNewestRevisionOnly) {
  GroupStore groups(db.writer);
  EXPECT_EQ(groups.put(group("g", {kBen, kAnna}), 0, "mia", 5)->revision(), 1u);
  // The same content, in any order, is not a new revision.
  EXPECT_EQ(groups.put(group("g", {kAnna, kBen}), 1, "mia", 6)->revision(), 1u);
  EXPECT_EQ(groups.put(group("g", {kAnna}), 1, "max", 1'764'000'000'000'000'000)->revision(), 2u);
  const test::WithZone zone(test::kStJohns);
  const auto late = groups.put(group("g", {kAnna, kZoe}), 1, "mia", 8);
  ASSERT_FALSE(late.ok());
  EXPECT_EQ(late.error().code, ErrorCode::kConflict);
  EXPECT_EQ(late.error().current_revision, 2u);
  for (const char* word : {"'g'", "revision 2", "'max'", "2025-11-24 12:30:00 NST", "revision 1"})
    EXPECT_NE(late.error().message.find(word), std::string::npos) << word << ": " << late.error().message;
  ASSERT_EQ(groups.get("g")->members_size(), 1);
  // One must be new but exists; the other must exist but does not.
  EXPECT_EQ(groups.put(group("g", {}), 0, "mia", 9).error().code, ErrorCode::kConflict);
  EXPECT_EQ(groups.put(group("h", {}), 3, "mia", 9).error().code, ErrorCode::kConflict);
}

TEST_F(TeachingStores, aGroupsMembersArePeopleEachOnce) {
  GroupStore groups(db.writer);
  EXPECT_EQ(groups.put(group("g", {kAnna, "nobody"}), 0, "mia", 1).error().code, ErrorCode::kNotFound);
  ASSERT_OK(db.writer.script("DELETE FROM group_members; DELETE FROM groups"));
  EXPECT_EQ(groups.put(group("g", {kAnna, kAnna}), 0, "mia", 1).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(groups.put(group("", {}), 0, "mia", 1).error().code, ErrorCode::kInvalidInput);
}

TEST_F(TeachingStores, aNewGroupNameMayNotHaveInvisibleCharacters) {
  GroupStore groups(db.writer);
  pb::Group turned = group("g", {kAnna});
  turned.set_name("Monday\u202e");
  const auto refused = groups.put(turned, 0, "mia", 1);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(
      refused.error().message.rfind(
          "group 'g', name: contains the invisible character U+202E (right-to-left override) at byte 7", 0),
      0u)
      << refused.error().message;
  ASSERT_OK(groups.put(group("g", {kAnna}), 0, "mia", 1));
  EXPECT_FALSE(groups.put(turned, 1, "mia", 2).ok());
  ASSERT_OK(db.writer.run("UPDATE groups SET name = ?", turned.name()));
  turned.add_members(kBen);
  // its members change under the old name
  EXPECT_OK(groups.put(turned, 1, "mia", 3));
}

TEST_F(TeachingStores, aRemovedGroupLosesAssignmentsAndKeepsCountingRevisions) {
  GroupStore groups(db.writer);
  ASSERT_OK(groups.put(group("g", {kAnna}), 0, "mia", 1));
  ASSERT_OK(AssignmentStore(db.writer).put(assignment("basics", "", "g", "")));
  EXPECT_EQ(groups.remove("g", 7, "mia", 2).error().code, ErrorCode::kConflict);
  ASSERT_OK(groups.remove("g", 1, "mia", 2));
  EXPECT_EQ(groups.get("g").error().code, ErrorCode::kNotFound);
  EXPECT_TRUE(groups.page("", "", 10)->empty());
  EXPECT_TRUE(groups.groupsOf(kAnna)->empty());
  EXPECT_TRUE(AssignmentStore(db.writer).list({})->empty());
  // an edit of the old one must not apply to the new one
  EXPECT_EQ(groups.put(group("g", {kBen}), 0, "mia", 3)->revision(), 3u);
  EXPECT_EQ(groups.put(group("g", {kZoe}), 1, "max", 4).error().code, ErrorCode::kConflict);
}

TEST_F(TeachingStores, anAssignmentIsOneOfEachPairAndRenewedInPlace) {
  AssignmentStore assignments(db.writer);
  ASSERT_OK(GroupStore(db.writer).put(group("g", {kAnna, kBen}), 0, "mia", 1));
  const auto first = assignments.put(assignment("basics", "", "g", "", 100));
  ASSERT_OK(first);
  EXPECT_EQ(assignments.put(assignment("basics", "", "g", "", 200))->id(), first->id());
  ASSERT_OK(assignments.put(assignment("", "a", "", kAnna)));
  EXPECT_EQ(assignments.list({kAnna, "", ""})->size(), 2u) << "one's own and one's group's";
  EXPECT_EQ(assignments.list({kBen, "", ""})->size(), 1u);
  EXPECT_EQ(assignments.list({kZoe, "", ""})->size(), 0u);
  EXPECT_EQ(assignments.list({"", "basics", ""})->size(), 2u) << "the course and an exercise of it";
  EXPECT_EQ(assignments.list({"", "", "g"})->front().due_unix_ns(), 200);
  for (const auto& wrong :
       {assignment("basics", "a", "", kAnna), assignment("", "", "", kAnna), assignment("basics", "", "", ""),
        assignment("basics", "", "g", kAnna), assignment("basics", "", "g", "", -1)})
    EXPECT_EQ(assignments.put(wrong).error().code, ErrorCode::kInvalidInput) << wrong.ShortDebugString();
  for (const auto& wrong :
       {assignment("other", "", "g", ""), assignment("", "z", "g", ""), assignment("basics", "", "h", "")})
    EXPECT_EQ(assignments.put(wrong).error().code, ErrorCode::kNotFound) << wrong.ShortDebugString();
  // a number is never reused
  ASSERT_OK(assignments.remove(2));
  EXPECT_EQ(assignments.remove(2).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(assignments.put(assignment("", "a", "", kAnna))->id(), 3u);
}

TEST_F(TeachingStores, aDateForOnePersonGoesBeforeItsGroups) {
  AssignmentStore assignments(db.writer);
  ASSERT_OK(GroupStore(db.writer).put(group("g", {kAnna, kBen}), 0, "mia", 1));
  ASSERT_OK(GroupStore(db.writer).put(group("h", {kAnna}), 0, "mia", 1));
  const auto due = [&] { return *assignments.dueOf(kAnna, "a", "basics", 7); };
  EXPECT_EQ(due(), 7) << "the exercise's own";
  ASSERT_OK(assignments.put(assignment("basics", "", "g", "", 100)));
  EXPECT_EQ(due(), 100);
  ASSERT_OK(assignments.put(assignment("basics", "", "h", "", 150)));
  EXPECT_EQ(due(), 150) << "of two groups the later";
  ASSERT_OK(assignments.put(assignment("", "a", "g", "", 120)));
  EXPECT_EQ(due(), 120);
  ASSERT_OK(assignments.put(assignment("basics", "", "", kAnna, 90)));
  EXPECT_EQ(due(), 90);
  ASSERT_OK(assignments.put(assignment("", "a", "", kAnna, 300)));
  EXPECT_EQ(due(), 300);
  EXPECT_EQ(*assignments.dueOf(kBen, "a", "basics", 7), 120);
  EXPECT_EQ(*assignments.dueOf(kZoe, "a", "basics", 7), 7);
}

TEST_F(TeachingStores, aCoursesDatesComeFromItsExercises) {
  AssignmentStore assignments(db.writer);
  ASSERT_OK(GroupStore(db.writer).put(group("g", {kAnna, kBen}), 0, "mia", 1));
  ASSERT_OK(GroupStore(db.writer).put(group("h", {kAnna, kBen}), 0, "mia", 1));
  // from another course: not read
  ASSERT_OK(
      db.writer.run("INSERT INTO assignments (exercise_id, group_id, due_unix_ns, by_whom, created_unix_ns)"
                    " VALUES ('of another', 'g', 999, 'x', 1)"));
  const auto expectSame = [&] {
    CourseDates dates(db.writer, "basics", {"b", "a"});
    for (const char* name : {kAnna, kBen, kZoe}) {
      const auto found = dates.of(name);
      ASSERT_OK(found);
      EXPECT_EQ(*found, (std::vector<std::int64_t>{*assignments.dueOf(name, "b", "basics", 0),
                                                   *assignments.dueOf(name, "a", "basics", 0)}))
          << name;
    }
  };
  for (const auto& next : {assignment("basics", "", "g", "", 100), assignment("basics", "", "h", "", 150),
                           assignment("", "a", "g", "", 120), assignment("", "a", "h", "", 110),
                           assignment("basics", "", "", kAnna, 90), assignment("", "a", "", kAnna, 80)}) {
    expectSame();
    ASSERT_OK(assignments.put(next));
  }
  expectSame();
  CourseDates dates(db.writer, "basics", {"a", "b"});
  EXPECT_EQ(*dates.of(kBen), (std::vector<std::int64_t>{120, 150}));
  EXPECT_EQ(dates.read(), 4u);
  EXPECT_EQ(*dates.of(kAnna), (std::vector<std::int64_t>{80, 90}));
  EXPECT_EQ(dates.read(), 4u + 2) << "anna's own";
  for (int i = 0; i < 10; ++i) ASSERT_OK(dates.of(kBen));
  EXPECT_EQ(dates.read(), 4u + 2);
}

TEST_F(TeachingStores, attemptsAreNumberedByWhenTheyWereBegunEachExerciseForItself) {
  const Uuid second = session(kAnna, "a", 200), other = session(kAnna, "b", 150),
             first = session(kAnna, "a", 100);
  session(kBen, "a", 50);
  AttemptStore attempts(db.writer);
  const auto of_a = attempts.list(kAnna, "a", false);
  ASSERT_OK(of_a);
  ASSERT_EQ(of_a->size(), 2u);
  EXPECT_EQ((*of_a)[0].session_id(), test::bytesOfId(first));
  EXPECT_EQ((*of_a)[1].number(), 2u);
  EXPECT_EQ(attempts.list(kAnna, "", false)->size(), 3u);
  EXPECT_EQ(attempts.get(other)->number(), 1u);
  EXPECT_EQ(attempts.get(second)->number(), 2u);
  // A late one takes its place.
  session(kAnna, "a", 120);
  EXPECT_EQ(attempts.get(second)->number(), 3u);
  EXPECT_EQ(attempts.standing(kAnna, "a")->counted, 3u);
  EXPECT_TRUE(*attempts.excuse(second, true));
  EXPECT_FALSE(*attempts.excuse(second, true));
  EXPECT_EQ(attempts.standing(kAnna, "a")->counted, 2u);
  EXPECT_EQ(attempts.standing(kAnna, "a")->all, 3u);
  EXPECT_EQ(attempts.excuse(makeUuidV7(), true).error().code, ErrorCode::kNotFound);
  std::string names;
  const auto trainees = CourseTrainees(db.writer, "basics", "").page({}, 10);
  ASSERT_TRUE(trainees.ok());
  for (const CourseTrainee& one : *trainees) names += one.name + " ";
  EXPECT_EQ(names, "anna ben ");
}

TEST_F(TeachingStores, theFirstScoreIsNeverReplaced) {
  const Uuid id = session(kAnna, "a", 1);
  ScoreStore scores(db.writer);
  const auto put = [&](std::uint32_t version, const std::string& measures, std::optional<bool> passed) {
    auto score = test::scoreOf(id, measures, version);
    if (passed) score.set_passed(*passed);
    return scores.put(score);
  };
  EXPECT_EQ(scores.get(id, 0).error().code, ErrorCode::kNotFound);
  // versions may come in any order: a server may have been updated and reverted
  ASSERT_OK(put(3, "[3]", false));
  EXPECT_EQ(SessionStore(db.writer).info(id)->score_json(), "[3]");
  ASSERT_OK(put(2, "[2]", true));
  ASSERT_OK(put(4, "[4]", true));
  ASSERT_OK(put(4, "[4 again]", {}));
  ASSERT_OK(put(3, "[not taken]", true));
  EXPECT_EQ(SessionStore(db.writer).info(id)->score_json(), "[3]");
  EXPECT_EQ(*AttemptStore(db.writer).standing(kAnna, "a")->passed, false)
      << "the verdict is the first score's";
  EXPECT_EQ(scores.get(id, 0)->measures_json(), "[4 again]");
  EXPECT_FALSE(scores.get(id, 4)->has_passed());
  EXPECT_EQ(scores.get(id, 3)->measures_json(), "[3]");
  EXPECT_TRUE(scores.get(id, 3)->first());
  EXPECT_EQ(scores.list(id)->size(), 3u);
  EXPECT_EQ(put(0, "[]", {}).error().code, ErrorCode::kInvalidInput);
}

TEST_F(TeachingStores, aReferenceIsMadeOfClosedSessionsOfItsExercise) {
  const Uuid closed = session(kAnna, "a", 1), open = session(kAnna, "a", 2), other = session(kAnna, "b", 3);
  for (const Uuid& id : {closed, other}) {
    auto d = test::closeOf(id, 0);
    ASSERT_OK(SessionStore(db.writer).close(d, 9));
  }
  ReferenceStore references(db.writer);
  EXPECT_EQ(references.get("a")->revision(), 0u);
  EXPECT_EQ(references.put("a", {open}, 0, "mia", 1).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(references.put("a", {other}, 0, "mia", 1).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(references.put("a", {closed, closed}, 0, "mia", 1).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(references.put("a", {makeUuidV7()}, 0, "mia", 1).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(references.put("z", {}, 0, "mia", 1).error().code, ErrorCode::kNotFound);
  const auto put = references.put("a", {closed}, 0, "mia", 1);
  ASSERT_OK(put);
  ASSERT_EQ(put->session_ids_size(), 1);
  EXPECT_EQ(put->session_ids(0), test::bytesOfId(closed));
  EXPECT_EQ(references.put("a", {}, 0, "max", 2).error().code, ErrorCode::kConflict);
  EXPECT_EQ(references.put("a", {}, 1, "max", 2)->revision(), 2u);
}

// a request for a reference must not keep the writer's thread from the stations' chunks
TEST_F(TeachingStores, onlyAReferencesOwnSessionsAreRead) {
  std::vector<Uuid> chosen;
  for (int i = 0; i < 3; ++i) {
    chosen.push_back(session(kAnna, "a", 1 + i));
    ASSERT_OK(SessionStore(db.writer).close(test::closeOf(chosen.back(), 0), 9));
  }
  ReferenceStore references(db.writer);
  ASSERT_OK(references.put("a", chosen, 0, "mia", 1));
  const auto steps = [&] {
    EXPECT_EQ(references.get("a")->session_ids_size(), 3);
    return test::stepsOfStatements(db.writer);
  };
  (void)steps();
  const int few = steps();
  EXPECT_GT(few, 0);
  for (int i = 0; i < 300; ++i) session(kBen, "a", 100 + i);
  (void)test::stepsOfStatements(db.writer);
  EXPECT_EQ(steps(), few);
}

TEST_F(TeachingStores, consentIsTheLastWordAndAllWordsAreKept) {
  ConsentStore consents(db.writer);
  const auto say = [&](const std::string& who, bool given, std::int64_t when) {
    pb::Consent consent;
    consent.set_given(given);
    consent.set_unix_ns(when);
    consent.set_recorded_by("ina");
    return consents.add(who, consent);
  };
  EXPECT_FALSE(consents.newest(kAnna)->has_value());
  ASSERT_OK(say(kAnna, true, 1));
  ASSERT_OK(say(kBen, true, 2));
  EXPECT_EQ(*consents.consenting(), (std::vector<std::string>{kAnna, kBen}));
  // A clock that went back does not undo a later decision.
  ASSERT_OK(say(kAnna, false, 0));
  EXPECT_EQ(*consents.consenting(), std::vector<std::string>{kBen});
  EXPECT_EQ(consents.newestOnes(kAnna, [](const pb::Consent&) { return true; })->size(), 2u);
  EXPECT_FALSE((*consents.newest(kAnna))->given());
  EXPECT_EQ(say("nobody", true, 1).error().code, ErrorCode::kNotFound);
}

TEST_F(TeachingStores, aLongConsentHistoryIsReadOnlyAsNeeded) {
  ConsentStore consents(db.writer);
  pb::Consent consent;
  consent.set_recorded_by("ina");
  ASSERT_OK(db.writer.script("BEGIN"));
  for (std::int64_t when = 1; when <= 2000; ++when) {
    consent.set_unix_ns(when);
    ASSERT_OK(consents.add(when % 2 == 0 ? kAnna : kBen, consent));
  }
  ASSERT_OK(db.writer.script("COMMIT"));
  std::vector<std::int64_t> seen;
  const auto three = consents.newestOnes(kAnna, [&](const pb::Consent& one) {
    seen.push_back(one.unix_ns());
    return seen.size() <= 3;
  });
  ASSERT_OK(three);
  ASSERT_EQ(three->size(), 3u);
  EXPECT_EQ(three->front().unix_ns(), 2000);
  EXPECT_EQ(three->back().unix_ns(), 1996);
  EXPECT_EQ(seen, (std::vector<std::int64_t>{2000, 1998, 1996, 1994})) << "none behind the first refused";
  EXPECT_EQ((*consents.newest(kBen))->unix_ns(), 1999);
  if (test::onPostgres()) return;  // the rest is SQLite's query plan
  // in the order of an index: nothing is sorted, so nothing else is read first
  auto plan = db.writer.query(
      "EXPLAIN QUERY PLAN SELECT given FROM consents WHERE person = ? ORDER BY id DESC", kAnna);
  for (;;) {
    const auto there = plan.step();
    ASSERT_OK(there);
    if (!*there) break;
    EXPECT_EQ(plan.text(3).find("SCAN"), std::string::npos) << plan.text(3);
    EXPECT_EQ(plan.text(3).find("TEMP B-TREE"), std::string::npos) << plan.text(3);
  }
}

TEST_F(TeachingStores, peopleAreChangedFromTheirNewestRevision) {
  PeopleStore people(db.writer);
  EXPECT_EQ(people.find(kAnna)->value().revision, 1u);
  EXPECT_EQ(people.change(kAnna, 1, {.full_name = "Anna A."}, "mia", 5)->revision, 2u);
  EXPECT_EQ(people.change(kAnna, 2, {.full_name = "Anna A."}, "mia", 6)->revision, 2u)
      << "nothing was changed";
  const auto late = people.change(kAnna, 1, {.role = pb::INSTRUCTOR}, "max", 7);
  ASSERT_FALSE(late.ok());
  EXPECT_EQ(late.error().code, ErrorCode::kConflict);
  EXPECT_NE(late.error().message.find("'mia'"), std::string::npos) << late.error().message;
  EXPECT_EQ(people.find(kAnna)->value().role, pb::TRAINEE);
  EXPECT_EQ(people.change(kAnna, 2, {.role = pb::STATION}, "max", 7).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(people.change(kAnna, 2, {.role = pb::RESEARCHER}, "max", 7)->role, pb::RESEARCHER);
}

TEST_F(TeachingStores, profilesAndCoursesRefuseAnEditOfAnOldRevision) {
  ProfileStore profiles(db.writer);
  ASSERT_OK(profiles.put({"knee", 0, "A knee", "{2}", "max", 2}, 1));
  EXPECT_EQ(profiles.put({"knee", 0, "A knee", "{3}", "mia", 3}, 1).error().code, ErrorCode::kConflict);
  EXPECT_EQ(profiles.put({"knee", 0, "A knee", "{3}", "mia", 3}, 0).error().code, ErrorCode::kConflict)
      << "it is not new";
  EXPECT_EQ(*profiles.put({"knee", 0, "A knee", "{3}", "mia", 3}), 3u) << "an import does not ask";
  EXPECT_EQ(profiles.revisions("knee")->size(), 3u);
  EXPECT_EQ(profiles.revisions("knee")->front().revision, 3u);
  EXPECT_EQ(profiles.get("knee", 2)->json, "{2}");
  CurriculumStore courses(db.writer);
  ASSERT_OK(courses.put({"basics", 0, "Basics", "{2}", "max", 2, {{"a", "", "A", "knee", "{}"}}}, 1));
  EXPECT_EQ(
      courses.put({"basics", 0, "Basics", "{3}", "mia", 3, {{"a", "", "A", "knee", "{}"}}}, 1).error().code,
      ErrorCode::kConflict);
  EXPECT_EQ(courses.revisions("basics")->size(), 2u);
  EXPECT_EQ(courses.get("basics", 1)->json, "{}");
  EXPECT_EQ(courses.get("basics", 9).error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace needlelab
