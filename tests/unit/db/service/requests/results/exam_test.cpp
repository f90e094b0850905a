// A course by assignment only, and an exam: who sees and begins it, which attempts count in any order
// they arrive, fixed aids, and when trainees see their results.
#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tests/unit/db/service/requests/results/teaching_fixture.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A date in the far future, and one in the past, in ms since 1970.
constexpr double kLater_ms = 9'000'000'000'000, kOver_ms = 1;
constexpr std::int64_t kLater_ns = 9'000'000'000'000'000'000;

/// A course of three exercises; anna and bea are in the assigned group, ole is not.
class Exam : public test::TeachingTest {
 protected:
  void SetUp() override {
    addStation();
    for (const char* name : {"anna", "bea", "ole"}) addPerson(name, pb::TRAINEE);
    get(manager, putGroup("class", {"anna", "bea"}, 0));
  }
  /// `flags` of the course; `with` is merged into the first exercise.
  void putCourse(const nlohmann::json& flags, const nlohmann::json& with = nlohmann::json::object()) {
    nlohmann::json course{{"id", "course"}, {"name", "Exam 2026"}, {"exercises", nlohmann::json::array()}};
    course.update(flags);
    for (const char* id : {"first", "second", "third"})
      course["exercises"].push_back({{"id", id},
                                     {"name", std::string("The ") + id},
                                     {"profile_id", "knee-adult"},
                                     {"requirements", {{{"measure", "peak_force_n"}, {"max", 5}}}}});
    course["exercises"][0].update(with);
    pb::Request request;
    request.mutable_import_curriculum()->set_json(course.dump());
    get(manager, request);
    pb::Request assign;
    assign.mutable_assign()->set_course_id("course");
    assign.mutable_assign()->set_group_id("class");
    get(manager, assign);
  }
  std::vector<std::string> coursesOf(const Principal& who) {
    pb::Request request;
    request.mutable_list_curricula();
    std::vector<std::string> ids;
    const pb::Reply reply = get(who, request);
    for (const auto& course : reply.curricula().curricula())
      if (course.id() == "course") ids.push_back(course.id());
    return ids;
  }
  std::vector<pb::Attempt> attemptsOf(const Principal& who, const std::string& name) {
    pb::Request request;
    request.mutable_get_progress()->set_trainee(name);
    request.mutable_get_progress()->set_exercise_id("first");
    const pb::Reply reply = get(who, request);
    return {reply.progress().attempts().begin(), reply.progress().attempts().end()};
  }
  /// For each attempt in the order they began: whether it counts, "-" if it exceeds the exam's number.
  std::string countedOf(const std::string& name) {
    std::string text;
    for (const pb::Attempt& attempt : attemptsOf(instructor, name)) {
      EXPECT_TRUE(!attempt.beyond() || attempt.excused());
      text += attempt.beyond() ? "-" : attempt.excused() ? "x" : "+";
    }
    return text;
  }
  pb::ResultCell cellOf(const Principal& who, const std::string& name) {
    pb::Request request;
    request.mutable_get_results()->set_course_id("course");
    if (who.role == pb::STATION) request.mutable_get_results()->set_trainee(name);
    const pb::Reply reply = get(who, request);
    for (const auto& row : reply.results().rows())
      if (row.trainee() == name) return row.cells(0);
    ADD_FAILURE() << "no row of " << name;
    return {};
  }
  /// A session that its station could not date.
  Uuid undated(const std::string& who, std::int64_t started) {
    const Uuid id = makeUuidV7();
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto d = test::describe(id);
      d.set_trainee(who);
      d.set_exercise_id("first");
      d.set_started_unix_ns(started);
      d.set_begin_clock(pb::SessionDescription::OWN_CLOCK_BEHIND);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      const auto closed = SessionStore(c).close(test::closeOf(id, 0), 2);
      return closed ? Status() : Status(closed.error());
    }));
    return id;
  }
  pb::Request excuse(const Uuid& session, bool excused) {
    pb::Request request;
    request.mutable_excuse_attempt()->set_session_id(test::bytesOfId(session));
    request.mutable_excuse_attempt()->set_excused(excused);
    return request;
  }
  pb::Request give(const Uuid& session, const std::string& who) {
    pb::Request request;
    request.mutable_assign_session()->set_session_id(test::bytesOfId(session));
    request.mutable_assign_session()->set_trainee(who);
    return request;
  }
  const Principal ole{"ole", pb::TRAINEE};
};

// --- who takes it

TEST_F(Exam, whoIsNotAssignedNeitherSeesNorBeginsIt) {
  pb::Request text, exercises, results, guest;
  text.mutable_get_curriculum()->set_id("course");
  exercises.mutable_list_exercises()->set_course_id("course");
  results.mutable_get_results()->set_course_id("course");
  putCourse(nlohmann::json::object());
  EXPECT_FALSE(lesson("first", "ole").has_value()) << "a course that says nothing is for all";
  EXPECT_THAT(coursesOf(ole), ElementsAre("course"));
  for (const nlohmann::json& flags : {nlohmann::json{{"assigned_only", true}}, {{"exam", true}}}) {
    putCourse(flags);
    const auto refused = lesson("first", "ole");
    ASSERT_TRUE(refused.has_value()) << flags;
    EXPECT_EQ(refused->code, ErrorCode::kDenied);
    EXPECT_THAT(refused->message, HasSubstr("\"The first\" is only for those to whom it is assigned"));
    guest.mutable_get_lesson()->set_exercise_id("first");
    guest.mutable_get_lesson()->set_trainee("guest");
    EXPECT_EQ(refusal(station, guest), ErrorCode::kDenied);
    EXPECT_THAT(coursesOf(ole), IsEmpty());
    EXPECT_EQ(refusal(ole, text), ErrorCode::kNotFound);
    EXPECT_EQ(refusal(ole, results), ErrorCode::kNotFound);
    EXPECT_EQ(get(ole, exercises).exercises().exercises_size(), 0);
    pb::Request look;
    look.mutable_get_lesson()->set_exercise_id("first");
    EXPECT_EQ(refusal(ole, look), ErrorCode::kNotFound);
    // those assigned to it, and its teachers
    EXPECT_FALSE(lesson("first", "anna").has_value());
    for (const Principal& one : {trainee, instructor, station}) {
      EXPECT_THAT(coursesOf(one), ElementsAre("course"));
      EXPECT_EQ(get(one, exercises).exercises().exercises_size(), 3);
    }
    const auto kept = get(station, look).lesson();  // no one's: the station keeps it for offline use
    EXPECT_TRUE(kept.assigned_only());
    EXPECT_EQ(kept.exam(), flags.contains("exam"));
  }
  // one of its exercises suffices to see the course and to begin that exercise
  pb::Request assign;
  assign.mutable_assign()->set_exercise_id("second");
  assign.mutable_assign()->set_trainee("ole");
  get(manager, assign);
  EXPECT_THAT(coursesOf(ole), ElementsAre("course"));
  EXPECT_FALSE(lesson("second", "ole").has_value());
  EXPECT_TRUE(lesson("first", "ole").has_value());
}

TEST_F(Exam, anOutsidersSessionCountsOnceAManagerAcceptsIt) {
  putCourse({{"assigned_only", true}});
  attempt("anna", "first", true);
  const Uuid outside = attempt("ole", "first", true);
  attempt("guest", "first", true);
  attempt("nobody knows her", "first", true);
  auto now = results(instructor);
  EXPECT_EQ(now.trainees(), 2u) << "anna and bea";
  EXPECT_EQ(now.rows_size(), 2);
  EXPECT_EQ(now.trainees_passed(0), 1u);
  EXPECT_THAT(attemptsOf(instructor, "ole"), IsEmpty());
  pb::Request show;
  show.mutable_get_session()->set_session_id(test::bytesOfId(outside));
  const auto waits = get(manager, show).session();
  EXPECT_TRUE(waits.unknown_trainee());
  EXPECT_TRUE(waits.not_assigned());
  EXPECT_FALSE(waits.code_unchecked()) << "that is not why";
  EXPECT_EQ(refusal(ole, show), ErrorCode::kNotFound);
  get(manager, give(outside, "ole"));
  now = results(instructor);
  EXPECT_EQ(now.trainees(), 3u);
  EXPECT_EQ(now.trainees_passed(0), 2u);
  EXPECT_EQ(countedOf("ole"), "+");
}

TEST_F(Exam, theListOfCoursesMarksIt) {
  pb::Request list;
  list.mutable_list_curricula();
  for (const bool exam : {false, true}) {
    putCourse({{"exam", exam}, {"assigned_only", true}});
    for (const Principal& one : {trainee, manager, station}) {
      const pb::Reply reply = get(one, list);
      for (const auto& course : reply.curricula().curricula())
        EXPECT_EQ(course.exam(), exam && course.id() == "course") << course.id();
    }
  }
}

// --- its attempts

TEST_F(Exam, hasOneAttemptAndNoAidsByDefault) {
  putCourse({{"exam", true}}, {{"attempts", 3}, {"aids", {{"allowed", {"DEPTH"}}}}});
  pb::Request list, text;
  list.mutable_list_exercises()->set_course_id("course");
  const pb::Reply reply = get(station, list);
  const auto first = nlohmann::json::parse(reply.exercises().exercises(0).json());
  const auto second = nlohmann::json::parse(reply.exercises().exercises(1).json());
  EXPECT_EQ(first["attempts"], 3);
  EXPECT_EQ(first["aids"]["allowed"], nlohmann::json::array({"DEPTH"}));
  EXPECT_EQ(second["attempts"], 1);
  EXPECT_EQ(second["aids"]["allowed"], nlohmann::json::array());
  text.mutable_get_curriculum()->set_id("course");
  const auto written = nlohmann::json::parse(get(manager, text).curriculum().json());
  EXPECT_FALSE(written["exercises"][1].contains("attempts")) << "the author's text stays";
}

TEST_F(Exam, theFirstAttemptsByTheirBeginCountHoweverLateTheyCome) {
  putCourse({{"exam", true}}, {{"attempts", 2}});
  const std::int64_t t = clock_;
  attempt("anna", "first", false, t + 20);
  attempt("anna", "first", true, t + 30);
  EXPECT_EQ(countedOf("anna"), "++");
  EXPECT_TRUE(cellOf(instructor, "anna").passed());
  // a station that was offline delivers an earlier one: the former second no longer counts
  const Uuid late = attempt("anna", "first", false, t + 10);
  EXPECT_EQ(countedOf("anna"), "++-");
  EXPECT_FALSE(cellOf(instructor, "anna").passed()) << "passed by none that counts";
  attempt("anna", "first", true, t + 40);
  EXPECT_EQ(countedOf("anna"), "++--");
  EXPECT_EQ(cellOf(instructor, "anna").attempts(), 2u);
  EXPECT_EQ(cellOf(instructor, "anna").attempts_left(), 0u);
  EXPECT_THAT(lesson("first", "anna")->message, HasSubstr("all 2 attempts have been used"));
  EXPECT_FALSE(lesson("first", "bea").has_value()) << "each has their own";
  // excusing one gives its place to the next one begun
  get(instructor, excuse(late, true));
  EXPECT_EQ(countedOf("anna"), "x++-");
  EXPECT_TRUE(cellOf(instructor, "anna").passed());
  get(instructor, excuse(late, false));
  EXPECT_EQ(countedOf("anna"), "++--");
}

TEST_F(Exam, whatIsBeyondItsAttemptsCannotBeLetCount) {
  putCourse({{"exam", true}});
  const std::int64_t t = clock_;
  attempt("anna", "first", false, t + 10);
  const Uuid beyond = attempt("anna", "first", true, t + 20);
  const auto refused = ask(instructor, excuse(beyond, false));
  ASSERT_TRUE(refused.error.has_value());
  EXPECT_EQ(refused.error->code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error->message, HasSubstr("beyond the attempts of the exam"));
  EXPECT_EQ(countedOf("anna"), "+-");
}

TEST_F(Exam, anAttemptWithoutASureBeginCountsOnceItIsAccepted) {
  putCourse({{"exam", true}});
  const std::int64_t t = clock_;
  attempt("anna", "first", false, t + 20);
  const Uuid unsure = undated("anna", t + 10);
  EXPECT_EQ(countedOf("anna"), "+") << "nothing is known of its place";
  get(manager, give(unsure, "anna"));
  EXPECT_EQ(countedOf("anna"), "+-") << "the one that is accepted began first";
  EXPECT_EQ(attemptsOf(instructor, "anna").front().session_id(), test::bytesOfId(unsure));
}

TEST_F(Exam, aStationResumesItsAttemptAfterACrash) {
  putCourse({{"exam", true}});
  const Uuid id = makeUuidV7();
  auto d = test::describe(id);
  d.set_trainee("anna");
  d.set_exercise_id("first");
  d.set_started_unix_ns(clock_);
  for (int time = 0; time < 2; ++time)
    ASSERT_OK(change([&](Connection& c) -> Status {
      const auto opened = SessionStore(c).open(d, 1);
      return opened ? Status() : Status(opened.error());
    }));
  EXPECT_EQ(countedOf("anna"), "+");
  EXPECT_THAT(lesson("first", "anna")->message, HasSubstr("the one attempt has been used"));
}

TEST_F(Exam, anotherNumberOfAttemptsCountsThemAgain) {
  putCourse({{"exam", true}});
  for (int i = 0; i < 3; ++i) attempt("anna", "first", false);
  EXPECT_EQ(countedOf("anna"), "+--");
  putCourse({{"exam", true}}, {{"attempts", 2}});
  EXPECT_EQ(countedOf("anna"), "++-");
  putCourse({{"assigned_only", true}});
  EXPECT_EQ(countedOf("anna"), "+++") << "no exam any more";
}

TEST_F(Exam, wantsWhatComesFirstTakenAndNotPassed) {
  putCourse({{"exam", true}}, {{"prerequisites", {"second"}}});
  EXPECT_THAT(lesson("first", "anna")->message, HasSubstr("take \"The second\" first"));
  attempt("anna", "second", false);
  EXPECT_FALSE(lesson("first", "anna").has_value());
}

// --- its aids

TEST_F(Exam, itsAidsAreFixed) {
  putCourse({{"exam", true}});
  const auto open = [&](const std::string& exercise, std::int64_t started) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee("anna");
    d.set_exercise_id(exercise);
    d.set_started_unix_ns(started);
    EXPECT_OK(change([&](Connection& c) -> Status {
      const auto opened = SessionStore(c).open(d, 1);
      return opened ? Status() : Status(opened.error());
    }));
    return id;
  };
  pb::Request aids;
  aids.mutable_set_aids()->set_station("station-1");
  aids.mutable_set_aids()->add_aids(pb::Exercise::DEPTH);
  get(instructor, aids);
  const Uuid practice = open("knee-recess", clock_ + 1), exam = open("first", clock_ + 2);
  for (const std::string& session : {std::string(), test::bytesOfId(exam)}) {
    aids.mutable_set_aids()->set_session_id(session);
    const auto refused = ask(instructor, aids);
    ASSERT_TRUE(refused.error.has_value());
    EXPECT_EQ(refused.error->code, ErrorCode::kDenied);
    EXPECT_EQ(refused.error->message, "\"The first\" is an exam: its aids cannot be changed");
    EXPECT_EQ(refused.server_part, ServerPart::kNone) << "nothing goes to the station";
  }
  aids.mutable_set_aids()->set_session_id(test::bytesOfId(practice));
  get(instructor, aids);
}

// --- its results

TEST_F(Exam, itsResultsAreHiddenFromTraineesBeforeTheirDate) {
  putCourse({{"exam", true}, {"results_from_unix_ms", kLater_ms}});
  const Uuid id = attempt("anna", "first", true);
  pb::Request session, score, attempt_of, events, section, all, passed, person;
  session.mutable_get_session()->set_session_id(test::bytesOfId(id));
  score.mutable_get_score()->set_session_id(test::bytesOfId(id));
  attempt_of.mutable_get_attempt()->set_session_id(test::bytesOfId(id));
  events.mutable_list_events()->set_session_id(test::bytesOfId(id));
  section.mutable_get_section()->set_session_id(test::bytesOfId(id));
  all.mutable_list_sessions();
  passed.mutable_list_sessions()->set_verdict(pb::ListSessions::PASSED);
  person.mutable_export_person()->set_name("anna");
  const auto exported = [&](const Principal& who) {
    std::string text;
    const pb::Reply reply = get(who, person);
    for (const std::string& record : reply.records().records()) text += record + "\n";
    return text;
  };
  for (const bool shown : {false, true}) {
    if (shown) putCourse({{"exam", true}, {"results_from_unix_ms", kOver_ms}});
    const std::int64_t until = shown ? 0 : kLater_ns;
    const pb::SessionInfo own = get(trainee, session).session();
    EXPECT_EQ(own.has_passed(), shown);
    EXPECT_EQ(own.score_json().empty(), !shown);
    EXPECT_EQ(own.results_from_unix_ns(), until);
    EXPECT_EQ(get(trainee, attempt_of).attempt().has_passed(), shown);
    EXPECT_EQ(attemptsOf(trainee, "anna").at(0).score_json().empty(), !shown);
    const auto listed = get(trainee, all).sessions();
    ASSERT_EQ(listed.sessions_size(), 1);
    EXPECT_EQ(listed.sessions(0).has_passed(), shown);
    EXPECT_EQ(listed.sessions(0).figures_size() == 0, !shown);
    EXPECT_EQ(get(trainee, passed).sessions().sessions_size(), shown ? 1 : 0);
    const pb::ResultCell cell = cellOf(trainee, "anna");
    EXPECT_EQ(cell.has_passed(), shown);
    EXPECT_EQ(cell.has_best(), shown);
    EXPECT_EQ(cell.results_from_unix_ns(), until);
    EXPECT_EQ(cell.attempts(), 1u);
    EXPECT_TRUE(cell.done()) << "taken";
    EXPECT_EQ(cellOf(station, "anna").has_passed(), shown) << "the station shows it to the trainee";
    EXPECT_EQ(exported(trainee).find("peak_force_n") != std::string::npos, shown);
    EXPECT_EQ(exported(trainee).find("\"passed\":1") != std::string::npos, shown);
    EXPECT_NE(exported(manager).find("peak_force_n"), std::string::npos);
    const auto closed = store->service().scoring().closeSession(test::closeOf(id, 0), "station-1");
    ASSERT_OK(closed);
    EXPECT_EQ(closed->score_json.empty(), !shown) << "the station that brings it again";
    if (!shown) {
      for (const pb::Request& request : {score, events, section}) {
        const auto refused = ask(trainee, request);
        ASSERT_TRUE(refused.error.has_value());
        EXPECT_EQ(refused.error->code, ErrorCode::kDenied);
        EXPECT_THAT(refused.error->message, HasSubstr("your result and its recording are shown from "));
      }
    } else {
      get(trainee, score);
    }
    // staff always see them
    EXPECT_TRUE(get(instructor, session).session().passed());
    EXPECT_TRUE(cellOf(instructor, "anna").passed());
    EXPECT_TRUE(get(instructor, score).score().passed());
    EXPECT_EQ(get(instructor, passed).sessions().sessions_size(), 1);
  }
}

TEST_F(Exam, itsRecordingsAreShownToATraineeFromTheSameDateOn) {
  putCourse({{"exam", true}, {"results_from_unix_ms", kLater_ms}});
  const Uuid id = makeUuidV7();
  ASSERT_OK(change([&](Connection& c) -> Status {
    auto d = test::describe(id);
    d.set_trainee("anna");
    d.set_exercise_id("first");
    RETURN_IF_ERROR(SessionStore(c).open(d, 1));
    for (const std::uint64_t seq : {0, 1})
      RETURN_IF_ERROR(SessionStore(c).append(id, seq, test::chunkOf(seq)));
    return {};
  }));
  pb::Request read, seek;
  read.mutable_read_chunks()->set_session_id(test::bytesOfId(id));
  seek.mutable_seek_session()->set_session_id(test::bytesOfId(id));
  seek.mutable_seek_session()->set_seconds(0);
  for (const std::uint64_t from_seq : {0, 1, 2}) {
    read.mutable_read_chunks()->set_from_seq(from_seq);
    for (const bool skip_damaged : {false, true}) {
      read.mutable_read_chunks()->set_skip_damaged(skip_damaged);
      const auto refused = ask(trainee, read);
      ASSERT_TRUE(refused.error.has_value()) << from_seq;
      EXPECT_EQ(refused.error->code, ErrorCode::kDenied);
      EXPECT_THAT(refused.error->message, HasSubstr("your result and its recording are shown from "));
    }
  }
  // a remark's moment needs it, and it contains no sample
  EXPECT_EQ(get(trainee, seek).sought().seq(), 0u);
  read.mutable_read_chunks()->set_from_seq(0);
  for (const Principal& staff : {instructor, manager, admin})
    EXPECT_EQ(get(staff, read).chunks().chunks_size(), 2) << staff.name;
  putCourse({{"exam", true}, {"results_from_unix_ms", kOver_ms}});
  EXPECT_EQ(get(trainee, read).chunks().chunks_size(), 2);
}

TEST_F(Exam, aTraineeCannotTellAFailedExamFromAPassedOne) {
  putCourse({{"exam", true}, {"results_from_unix_ms", kLater_ms}}, {{"due_unix_ms", 1000}});
  attempt("anna", "first", true);
  attempt("bea", "first", false);
  const Principal bea{"bea", pb::TRAINEE};
  pb::ResultCell of_anna = cellOf(trainee, "anna"), of_bea = cellOf(bea, "bea");
  EXPECT_EQ(of_anna.SerializeAsString(), of_bea.SerializeAsString());
  for (const pb::ListSessions::Verdict verdict :
       {pb::ListSessions::PASSED, pb::ListSessions::FAILED, pb::ListSessions::NONE}) {
    pb::Request list;
    list.mutable_list_sessions()->set_verdict(verdict);
    EXPECT_EQ(get(trainee, list).sessions().sessions_size(), get(bea, list).sessions().sessions_size());
  }
}

}  // namespace
}  // namespace needlelab
