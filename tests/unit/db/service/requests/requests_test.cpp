#include "db/service/requests/requests.h"

#include <google/protobuf/descriptor.h>

#include <fstream>
#include <map>
#include <set>

#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

/// The permissions, written by hand for the port's tests: T rainee, I nstructor, M anager, A dministrator, S
/// tation, R esearcher.
std::map<std::string, std::string> expectedRoles() {
  std::ifstream in(NEEDLELAB_TEST_DIR "/../../server/live/permissions_requests.tsv");
  std::map<std::string, std::string> table;
  for (std::string line; std::getline(in, line);) {
    const std::size_t tab = line.find('\t');
    if (line.starts_with("#") || line.starts_with("call\t") || tab == std::string::npos) continue;
    EXPECT_TRUE(table.emplace(line.substr(0, tab), line.substr(tab + 1)).second) << "twice: " << line;
  }
  return table;
}

TEST(Roles, everyCallIsInTheTableForEveryRole) {
  const auto expected = expectedRoles();
  const auto* calls = pb::Request::descriptor()->FindOneofByName("call");
  ASSERT_NE(calls, nullptr);
  EXPECT_EQ(static_cast<std::size_t>(calls->field_count()), expected.size());
  for (int i = 0; i < calls->field_count(); ++i) {
    const auto* field = calls->field(i);
    ASSERT_EQ(expected.count(field->name()), 1u) << field->name() << " is new: decide who may do it";
    const auto call = static_cast<pb::Request::CallCase>(field->number());
    EXPECT_NE(callName(call), "?") << field->name();
    const std::string letters = "?TIMASR";
    for (int role = 0; role <= 6; ++role) {
      const bool allowed =
          role > 0 &&
          expected.at(field->name()).find(letters[static_cast<std::size_t>(role)]) != std::string::npos;
      const auto status = checkRole({"x", static_cast<pb::Role>(role)}, call);
      EXPECT_EQ(status.ok(), allowed) << field->name() << " for role " << role;
      if (!status.ok()) {
        EXPECT_EQ(status.error().code, ErrorCode::kDenied);
      }
    }
  }
}

TEST(Requests, onlyALessonWithACodeUsesThePasswordThread) {
  pb::Request lesson, check, other;
  lesson.mutable_get_lesson()->set_trainee("tom");
  check.mutable_check_trainee()->set_trainee("tom");
  other.mutable_list_users();
  for (const auto& request : {lesson, check, other, pb::Request()})
    EXPECT_EQ(threadsOf(request, pb::STATION), RequestThreads::kWorkers);
  lesson.mutable_get_lesson()->set_code("1234");
  check.mutable_check_trainee()->set_code("1234");
  for (const auto& request : {lesson, check}) {
    EXPECT_EQ(threadsOf(request, pb::STATION), RequestThreads::kPasswords);
    EXPECT_EQ(threadsOf(request, pb::INSTRUCTOR), RequestThreads::kWorkers) << "no one checks it";
  }
  other.mutable_get_results();
  EXPECT_EQ(threadsOf(other, pb::STATION), RequestThreads::kViews);
}

TEST(Requests, whatMeasuresDistancesFromExpertsKeepsNoWorkerFromALesson) {
  pb::Request set, show, score;
  set.mutable_set_reference();
  show.mutable_get_reference();
  score.mutable_get_score();
  for (const auto& request : {set, show, score})
    EXPECT_EQ(threadsOf(request, pb::INSTRUCTOR), RequestThreads::kViews) << request.ShortDebugString();
}

TEST(Requests, eachCallHasOneRowWhoseHandlerTakesItsMessage) {
  const auto* calls = pb::Request::descriptor()->FindOneofByName("call");
  const auto* results = pb::Reply::descriptor()->FindOneofByName("result");
  std::map<int, int> rows;
  for (const RequestRow& row : requestRows()) {
    ++rows[row.call];
    const auto* field = pb::Request::descriptor()->FindFieldByNumber(row.call);
    ASSERT_NE(field, nullptr);
    EXPECT_EQ(row.handler.message(), field->message_type()) << field->name();
    const auto* result = pb::Reply::descriptor()->FindFieldByNumber(row.reply);
    EXPECT_TRUE(result != nullptr && result->containing_oneof() == results) << field->name();
    EXPECT_NE(row.roles, 0u) << field->name();
  }
  for (int i = 0; i < calls->field_count(); ++i)
    EXPECT_EQ(rows[calls->field(i)->number()], 1) << calls->field(i)->name();
}

// listed by hand: calls that write an audit line each time
TEST(Requests, writesTakeAShareAndEssentialOnesIgnoreAFullDisk) {
  using Names = std::set<std::string>;
  std::map<Storing, Names> calls;
  for (const RequestRow& row : requestRows()) {
    EXPECT_EQ(storingOf(row.call), row.handler.storing);
    calls[row.handler.storing].insert(pb::Request::descriptor()->FindFieldByNumber(row.call)->name());
  }
  EXPECT_EQ(calls[Storing::kNeeded],
            (Names{"backup", "change_user", "disable_user", "erase_person", "export_all", "export_person",
                   "export_study", "revoke_station", "run_retention", "set_password", "set_retention",
                   "stop_lesson"}));
  EXPECT_EQ(calls[Storing::kStores], (Names{"add_station",    "add_user",          "annotate",
                                            "assign",         "assign_session",    "change_lab_settings",
                                            "excuse_attempt", "import_curriculum", "import_people",
                                            "import_profile", "next_exercise",     "put_group",
                                            "redact",         "remove_assignment", "remove_group",
                                            "rescore_all",    "rescore_session",   "set_aids",
                                            "set_code",       "set_consent",       "set_reference",
                                            "trainee_message"}));
  for (const std::string& name : calls[Storing::kNothing])
    EXPECT_TRUE(name.starts_with("list_") || name.starts_with("get_") || name.starts_with("read_") ||
                name.starts_with("check") || name == "verify_session" || name == "seek_session" ||
                name == "preview_profile")
        << name << " is new: does it write?";
  EXPECT_EQ(storingOf(pb::Request::CALL_NOT_SET), Storing::kNothing);
}

TEST(Roles, unknownRolesAndCallsAreRefused) {
  EXPECT_FALSE(checkRole({"x", static_cast<pb::Role>(77)}, pb::Request::kListProfiles).ok());
  EXPECT_FALSE(checkRole({"x", static_cast<pb::Role>(-1)}, pb::Request::kListProfiles).ok());
  const auto refused = checkRole({"x", pb::ADMINISTRATOR}, pb::Request::CALL_NOT_SET);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
}

TEST(Roles, namesAndBack) {
  for (const pb::Role role : {pb::TRAINEE, pb::INSTRUCTOR, pb::CURRICULUM_MANAGER, pb::ADMINISTRATOR,
                              pb::STATION, pb::RESEARCHER}) {
    EXPECT_EQ(roleOfName(roleName(role)), role);
  }
  EXPECT_EQ(roleOfName("boss"), pb::ROLE_UNSPECIFIED);
}

using RefusedCalls = test::ServiceTest;

TEST_F(RefusedCalls, changeNothingAndAnswerWithTheirId) {
  pb::Request request;
  request.set_id(42);
  request.mutable_add_user()->set_name("eve");
  request.mutable_add_user()->set_role(pb::ADMINISTRATOR);
  request.mutable_add_user()->set_password("correct horse");
  for (const Principal& who : {trainee, instructor, manager, station}) {
    const Outcome outcome = ask(who, request);
    EXPECT_EQ(outcome.error.value().code, ErrorCode::kDenied);
    EXPECT_EQ(outcome.reply.id(), 42u);
  }
  EXPECT_EQ(refusal(admin, {}), ErrorCode::kInvalidInput);
  pb::Request list;
  list.mutable_list_users();
  EXPECT_EQ(get(admin, list).users().users_size(), 0);
}

}  // namespace
}  // namespace needlelab
