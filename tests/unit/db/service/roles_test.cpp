#include "db/service/roles.h"

#include <google/protobuf/descriptor.h>

#include <fstream>
#include <map>
#include <sstream>

#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

/// Who may do what, written down independently: T rainee, I nstructor, M anager, A dministrator, S tation, R
/// esearcher.
const std::map<std::string, std::string>& expected() {
  static const std::map<std::string, std::string> table = {
      {"add_user", "MA"},
      {"set_password", "TIMAR"},
      {"disable_user", "MA"},
      {"list_users", "IMA"},
      {"add_station", "A"},
      {"revoke_station", "A"},
      {"list_stations", "IMA"},
      {"import_profile", "MA"},
      {"get_profile", "TIMASR"},
      {"list_profiles", "TIMASR"},
      {"import_curriculum", "MA"},
      {"get_curriculum", "TIMASR"},
      {"list_curricula", "TIMASR"},
      {"assign", "IMA"},
      {"list_assignments", "TIMAS"},
      {"get_lesson", "TIMAS"},
      {"list_sessions", "TIMA"},
      {"get_session", "TIMA"},
      {"read_chunks", "TIMA"},
      {"verify_session", "IMA"},
      {"list_events", "TIMA"},
      {"seek_session", "TIMA"},
      {"annotate", "IA"},
      {"list_annotations", "TIMA"},
      {"backup", "A"},
      {"check", "A"},
      {"list_audit", "A"},
      {"list_retention", "MA"},
      {"set_retention", "MA"},
      {"run_retention", "MA"},
      {"trainee_message", "IA"},
      {"next_exercise", "IA"},
      {"set_aids", "IMA"},
      {"stop_lesson", "IMA"},
      {"get_user", "TIMAR"},
      {"change_user", "MA"},
      {"set_consent", "TIMA"},
      {"list_consents", "TIMA"},
      {"import_people", "MA"},
      {"export_person", "TIMA"},
      {"erase_person", "A"},
      {"put_group", "MA"},
      {"get_group", "IMA"},
      {"list_groups", "IMA"},
      {"remove_group", "MA"},
      {"list_profile_revisions", "IMAR"},
      {"list_curriculum_revisions", "IMAR"},
      {"check_text", "IMA"},
      {"preview_profile", "IMA"},
      {"list_exercises", "TIMASR"},
      {"list_measures", "TIMASR"},
      {"remove_assignment", "IMA"},
      {"get_results", "TIMA"},
      {"get_progress", "TIMA"},
      {"excuse_attempt", "IMA"},
      {"get_score", "TIMA"},
      {"rescore_session", "IMA"},
      {"rescore_all", "MA"},
      {"list_scores", "IMA"},
      {"set_reference", "IMA"},
      {"get_reference", "TIMA"},
      {"export_study", "AR"},
      {"read_study_recording", "AR"},
      {"export_all", "A"},
      {"import_all", "A"},
  };
  return table;
}

TEST(Roles, everyCallIsInTheTableForEveryRole) {
  const auto* calls = pb::Request::descriptor()->FindOneofByName("call");
  ASSERT_NE(calls, nullptr);
  EXPECT_EQ(static_cast<std::size_t>(calls->field_count()), expected().size());
  for (int i = 0; i < calls->field_count(); ++i) {
    const auto* field = calls->field(i);
    ASSERT_EQ(expected().count(field->name()), 1u) << field->name() << " is new: decide who may do it";
    const auto call = static_cast<pb::Request::CallCase>(field->number());
    EXPECT_NE(callName(call), "?") << field->name();
    const std::string letters = "?TIMASR";
    for (int role = 0; role <= 6; ++role) {
      const bool allowed =
          role > 0 &&
          expected().at(field->name()).find(letters[static_cast<std::size_t>(role)]) != std::string::npos;
      const auto status = checkRole({"x", static_cast<pb::Role>(role)}, call);
      EXPECT_EQ(status.ok(), allowed) << field->name() << " for role " << role;
      if (!status.ok()) {
        EXPECT_EQ(status.error().code, ErrorCode::kDenied);
      }
    }
  }
}

TEST(Roles, sayWhatTheTablesOfBeforeSaid) {
  std::ifstream in(NEEDLELAB_TEST_DIR "/requests_before.tsv");
  std::size_t rows = 0;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("#") || line.starts_with("call\t")) continue;
    std::istringstream cells(line);
    std::string name, action, letters;
    std::getline(cells, name, '\t');
    std::getline(cells, action, '\t');
    std::getline(cells, letters, '\t');
    const auto* field = pb::Request::descriptor()->FindFieldByName(name);
    ASSERT_NE(field, nullptr) << name;
    const auto call = static_cast<pb::Request::CallCase>(field->number());
    EXPECT_EQ(callName(call), action);
    std::string may;
    for (const int role : {1, 2, 3, 4, 5, 6})
      if (checkRole({"x", static_cast<pb::Role>(role)}, call)) may += "TIMASR"[role - 1];
    EXPECT_EQ(may, letters) << name;
    ++rows;
  }
  EXPECT_GE(rows, 65u);
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
