// Names that look alike: groups, stations, profiles, courses and exercises are compared as people's names
// are, and a person is asked.
#include <gmock/gmock.h>

#include <string>

#include "db/service/requests/handlers.h"
#include "tests/unit/db/service/requests/results/teaching_fixture.h"

namespace needlelab {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class LookAlikes : public test::TeachingTest {
 protected:
  void SetUp() override {
    putCourse();
    get(manager, putGroup("autumn-a", {}, 0));
    get(admin, addStation("st-1"));
  }
  static pb::Request addStation(const std::string& name) {
    pb::Request request;
    request.mutable_add_station()->set_name(name);
    return request;
  }
  pb::Request renamedGroup(const std::string& id, const std::string& name) {
    pb::Request request = putGroup(id, {}, 0);
    request.mutable_put_group()->mutable_group()->set_name(name);
    return request;
  }
  /// A course of one exercise.
  static pb::Request course(const std::string& id, const std::string& name, const std::string& exercise,
                            const std::string& profile) {
    pb::Request request;
    request.mutable_import_curriculum()->set_json(
        R"({"id":")" + id + R"(","name":")" + name + R"(","exercises":[{"id":")" + exercise +
        R"(","name":"An exercise","profile_id":")" + profile +
        R"(","requirements":[{"measure":"peak_force_n","max":5}]}]})");
    return request;
  }
  static pb::Request assignment(const std::string& course, const std::string& exercise,
                                const std::string& group) {
    pb::Request request;
    request.mutable_assign()->set_course_id(course);
    request.mutable_assign()->set_exercise_id(exercise);
    request.mutable_assign()->set_group_id(group);
    return request;
  }
  Error refused(const Principal& who, const pb::Request& request) {
    return ask(who, request).error.value_or(Error{ErrorCode::kFailed, "it was taken"});
  }
  void expectAsked(const Principal& who, const pb::Request& request, ErrorCode code,
                   const std::string& there) {
    const Error error = refused(who, request);
    EXPECT_EQ(error.code, code) << error.message;
    EXPECT_THAT(error.message, HasSubstr("looks like the " + there)) << request.DebugString();
    EXPECT_THAT(error.message, HasSubstr("use it?"));
  }
};

TEST_F(LookAlikes, aNewNameThatLooksLikeAnExistingOneIsAskedAbout) {
  for (const char* same : {"Autumn-A", "AUTUMN-A", "autumn\u2011a", "autumn\u2013a"})
    expectAsked(manager, putGroup(same, {}, 0), ErrorCode::kAlreadyExists, "group 'autumn-a'");
  expectAsked(admin, addStation("ST-1"), ErrorCode::kAlreadyExists, "station 'st-1'");
  expectAsked(manager, course("Course", "Another", "fourth", "knee-adult"), ErrorCode::kAlreadyExists,
              "course 'course' (A course)");
  expectAsked(manager, course("other", "Another", "First", "knee-adult"), ErrorCode::kAlreadyExists,
              "exercise 'first' (The first)");
  expectAsked(manager, course("other", "Another", "fourth", "Knee-Adult"), ErrorCode::kNotFound,
              "profile 'knee-adult'");
  EXPECT_EQ(count("SELECT count(*) FROM groups") + count("SELECT count(*) FROM stations"), 2);
  EXPECT_THAT(refused(manager, putGroup("spring\u00a0", {}, 0)).message,
              HasSubstr("begins or ends with a space"));
  for (const char* other : {"autumn-b", "autumna", "autumn-\u00e4"}) get(manager, putGroup(other, {}, 0));
}

TEST_F(LookAlikes, titlesAreComparedToo) {
  get(manager, renamedGroup("spring-1", "Spring term"));
  expectAsked(manager, putGroup("spring  TERM", {}, 0), ErrorCode::kAlreadyExists,
              "group 'spring-1' (Spring term)");
  const Error title = refused(manager, renamedGroup("spring-2", "SPRING\u00a0term"));
  EXPECT_EQ(title.code, ErrorCode::kAlreadyExists);
  EXPECT_THAT(title.message, AllOf(HasSubstr("looks like 'Spring term'"), HasSubstr("group 'spring-1'")));
  get(manager, renamedGroup("spring-3", "Spring term"));
  EXPECT_THAT(refused(manager, course("other", "A  COURSE", "fourth", "knee-adult")).message,
              HasSubstr("looks like 'A course', the name of the course 'course'"));
}

TEST_F(LookAlikes, aNameThatIsLookedUpInAnotherSpellingIsAskedAbout) {
  expectAsked(manager, assignment("course", "", "Autumn-A"), ErrorCode::kNotFound, "group 'autumn-a'");
  expectAsked(manager, assignment("COURSE", "", "autumn-a"), ErrorCode::kNotFound, "course 'course'");
  expectAsked(manager, assignment("", "FIRST", "autumn-a"), ErrorCode::kNotFound, "exercise 'first'");
  pb::Request message, results, sessions;
  message.mutable_trainee_message()->set_station("St-1");
  message.mutable_trainee_message()->set_text("well done");
  expectAsked(instructor, message, ErrorCode::kNotFound, "station 'st-1'");
  results.mutable_get_results()->set_course_id("Course");
  expectAsked(instructor, results, ErrorCode::kNotFound, "course 'course'");
  sessions.mutable_list_sessions()->set_station("ST-1");
  expectAsked(instructor, sessions, ErrorCode::kNotFound, "station 'st-1'");
  sessions.mutable_list_sessions()->set_station("st-2");
  EXPECT_EQ(get(instructor, sessions).sessions().sessions_size(), 0) << "no station looks like it";
  const Error hidden = refused(trainee, results);
  EXPECT_THAT(hidden.message, testing::Not(HasSubstr("looks like"))) << "a trainee does not learn of it";
  get(manager, assignment("course", "", "autumn-a"));
}

TEST_F(LookAlikes, theCheckOfACourseAsksBeforeItIsSaved) {
  pb::Request request;
  request.mutable_check_text()->set_kind("course");
  request.mutable_check_text()->set_json(
      course("other", "Another", "FIRST", "Knee-Adult").import_curriculum().json());
  const pb::TextCheck check = get(manager, request).text_check();
  ASSERT_EQ(check.problems_size(), 2) << check.DebugString();
  EXPECT_THAT(check.problems(0).message(), HasSubstr("looks like the profile 'knee-adult'"));
  EXPECT_THAT(check.problems(1).message(), HasSubstr("looks like the exercise 'first'"));
}

TEST_F(LookAlikes, groupsOfAClassList) {
  const auto asked = importPeople(
      "name,group\nana,autumn-a\nben,Autumn-A\ndee,autumn\u2011a\neva,autumn-a\u00a0\nflo,Spring\ngil,spring\n");
  EXPECT_FALSE(asked.done());
  ASSERT_EQ(asked.faults(), 3u) << asked.DebugString();
  for (const int i : {0, 1}) {
    EXPECT_EQ(asked.rows(i).line(), 3u + static_cast<unsigned>(i));
    EXPECT_EQ(asked.rows(i).column(), "group");
    EXPECT_THAT(asked.rows(i).text(), HasSubstr("looks like the group 'autumn-a': use it?"));
  }
  EXPECT_EQ(asked.rows(2).line(), 7u);
  EXPECT_THAT(asked.rows(2).text(), HasSubstr("looks like the group 'Spring'"));
  const auto dry = importPeople("name,group\neva,autumn-a\u00a0\nflo,spring;autumn-a\ngil,spring\n", true);
  ASSERT_EQ(dry.faults(), 0u) << dry.DebugString();
  EXPECT_EQ(dry.rows(0).text(), "added as trainee, joins autumn-a");
  EXPECT_EQ(dry.rows(1).text(), "added as trainee, joins spring, autumn-a; new group: spring");
  EXPECT_EQ(dry.rows(2).text(), "added as trainee, joins spring");
}

TEST_F(LookAlikes, numbersThatATableProgramHasChanged) {
  for (const char* csv : {"name\n20261234.0\n", "name\n\"20261234,00\"\n", "name\n2.0261234E+7\n",
                          "name,code\nana,471221.0\n", "name,group\nana,2026.0\n"}) {
    const auto report = importPeople(csv);
    ASSERT_EQ(report.faults(), 1u) << csv;
    EXPECT_THAT(report.rows(0).text(), HasSubstr("format the column as text")) << csv;
  }
  get(manager, putGroup("2026.0", {}, 0));
  EXPECT_TRUE(importPeople("name,group\nana.0,2026.0\nv1.5,autumn-a\n").done()) << "these are names";

  addPerson("00815", pb::TRAINEE);
  addPerson("4711", pb::TRAINEE);
  const auto zeros = importPeople("name\n815\n004711\n00815\n");
  ASSERT_EQ(zeros.faults(), 2u) << zeros.DebugString();
  EXPECT_THAT(zeros.rows(0).text(), HasSubstr("looks like '00815' but for zeros at the left"));
  EXPECT_THAT(zeros.rows(1).text(), HasSubstr("looks like '4711' but for zeros at the left"));

  const auto shorter = importPeople("name,code\nkim,0471221\nleo,471222\nmia.b,0471223\n", true);
  ASSERT_EQ(shorter.faults(), 0u) << shorter.DebugString();
  EXPECT_THAT(shorter.rows(1).text(),
              HasSubstr("has 6 digits, most have 7: has a table program dropped zeros"));
  EXPECT_EQ(shorter.rows(1).column(), "code");
  EXPECT_THAT(shorter.rows(0).text(), testing::Not(HasSubstr("digits")));
  const auto grouped = importPeople("name;code\nkim;471,221\n", true);
  EXPECT_THAT(grouped.rows(0).text(), HasSubstr("signs of thousands"));
}

TEST_F(LookAlikes, aRowForEachMembershipIsOnePerson) {
  const std::string list =
      "name,full_name,group,code\nana,Ana,autumn-a,4711\nben,Ben,tuesday,\nana,Ana,tuesday,4711\n";
  const auto report = importPeople(list);
  ASSERT_TRUE(report.done()) << report.DebugString();
  EXPECT_EQ(report.added(), 2u);
  EXPECT_EQ(report.rows_left_out(), 0u);
  EXPECT_EQ(count("SELECT count(*) FROM group_members"), 3);
  EXPECT_EQ(importPeople(list).unchanged(), 2u) << "the same list again";
  for (const char* other : {"ana,Anna,tuesday,", "ana,Ana,tuesday,4712", "ana,Ana,autumn-a,"}) {
    const auto two =
        importPeople("name,full_name,group,code\nana,Ana,autumn-a,\n" + std::string(other) + "\n");
    ASSERT_EQ(two.faults(), 1u) << other;
    EXPECT_THAT(two.rows(0).text(), HasSubstr("stands in line 2 already")) << other;
  }
}

}  // namespace
}  // namespace needlelab
