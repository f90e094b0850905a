#include "test_service.h"

namespace needlelab {
namespace {

using PeopleHandlers = test::ServiceTest;

pb::Request addUser(const std::string& name, pb::Role role, const std::string& password) {
  pb::Request request;
  request.mutable_add_user()->set_name(name);
  request.mutable_add_user()->set_role(role);
  request.mutable_add_user()->set_password(password);
  return request;
}

TEST_F(PeopleHandlers, aPersonCanLogInUntilDisabled) {
  get(admin, addUser("ina", pb::INSTRUCTOR, "correct horse"));
  auto& service = store->service();
  const auto in = service.loginPerson("ina", "correct horse");
  ASSERT_OK(in);
  EXPECT_EQ(in->role, pb::INSTRUCTOR);
  EXPECT_TRUE(*service.stillAllowed(*in));

  const auto wrong = service.loginPerson("ina", "wrong horse");
  const auto unknown = service.loginPerson("eve", "correct horse");
  pb::Request disable;
  disable.mutable_disable_user()->set_name("ina");
  get(admin, disable);
  const auto disabled = service.loginPerson("ina", "correct horse");
  for (const auto* refused : {&wrong, &unknown, &disabled}) {
    ASSERT_FALSE(refused->ok());
    EXPECT_EQ(refused->error().code, ErrorCode::kDenied);
    EXPECT_EQ(refused->error().message, wrong.error().message) << "the reason shows";
  }
  EXPECT_FALSE(*service.stillAllowed(*in));
  disable.mutable_disable_user()->set_enable(true);
  get(admin, disable);
  EXPECT_OK(service.loginPerson("ina", "correct horse"));
}

TEST_F(PeopleHandlers, onlyTraineesMayBeWithoutPassword) {
  get(admin, addUser("anna", pb::TRAINEE, ""));
  EXPECT_EQ(store->service().loginPerson("anna", "").error().code, ErrorCode::kDenied);
  EXPECT_EQ(refusal(admin, addUser("ina", pb::INSTRUCTOR, "")), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(admin, addUser("ina", pb::INSTRUCTOR, "short")), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(admin, addUser("lab", pb::STATION, "correct horse")), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(admin, addUser("anna", pb::TRAINEE, "")), ErrorCode::kAlreadyExists);
  pb::Request list;
  list.mutable_list_users();
  const auto users = get(instructor, list).users();
  ASSERT_EQ(users.users_size(), 1);
  EXPECT_FALSE(users.users(0).has_password());
}

TEST_F(PeopleHandlers, everyoneSetsTheirOwnPasswordOnly) {
  addPerson("ina", pb::INSTRUCTOR);
  addPerson("ada", pb::ADMINISTRATOR);
  pb::Request request;
  request.mutable_set_password()->set_name("ada");
  request.mutable_set_password()->set_password("new password");
  EXPECT_EQ(refusal(instructor, request), ErrorCode::kDenied);
  request.mutable_set_password()->set_name("ina");
  get(instructor, request);
  EXPECT_OK(store->service().loginPerson("ina", "new password"));
  request.mutable_set_password()->set_name("nobody");
  EXPECT_EQ(refusal(admin, request), ErrorCode::kNotFound);
}

TEST_F(PeopleHandlers, aStationGetsAKeyOnceAndLosesItWhenRevoked) {
  pb::Request add;
  add.mutable_add_station()->set_name("lab-1");
  const auto key = get(admin, add).station_key();
  EXPECT_EQ(key.key().size(), 32u);
  auto& service = store->service();
  EXPECT_EQ(service.loginStation("lab-1", key.key())->role, pb::STATION);
  EXPECT_FALSE(service.loginStation("lab-2", key.key()).ok());
  EXPECT_FALSE(service.loginStation("lab-1", std::string(32, '\0')).ok());
  EXPECT_EQ(refusal(admin, add), ErrorCode::kAlreadyExists);
  pb::Request revoke;
  revoke.mutable_revoke_station()->set_name("lab-1");
  get(admin, revoke);
  EXPECT_FALSE(service.loginStation("lab-1", key.key()).ok());
  EXPECT_FALSE(*service.stillAllowed({"lab-1", pb::STATION}));
}

TEST_F(PeopleHandlers, everyChangeIsInTheAuditLogWithoutSecrets) {
  get(admin, addUser("ina", pb::INSTRUCTOR, "correct horse"));
  EXPECT_EQ(refusal(admin, addUser("ina", pb::INSTRUCTOR, "correct horse")), ErrorCode::kAlreadyExists);
  pb::Request add;
  add.mutable_add_station()->set_name("lab-1");
  get(admin, add);
  ASSERT_OK(store->service().note("lab-1", "chunk refused", "some session", "contradiction"));
  pb::Request list;
  list.mutable_list_audit();
  const auto audit = get(admin, list).audit();
  ASSERT_EQ(audit.entries_size(), 3) << "a refused change is no change";
  EXPECT_EQ(audit.entries(0).action(), "chunk refused");
  EXPECT_EQ(audit.entries(1).action(), "station add");
  EXPECT_EQ(audit.entries(2).action(), "user add");
  EXPECT_EQ(audit.entries(2).who(), "ada");
  EXPECT_EQ(audit.entries(2).subject(), "ina");
  EXPECT_EQ(audit.SerializeAsString().find("horse"), std::string::npos);
}

TEST_F(PeopleHandlers, whatTheServerMustDoIsMarked) {
  addStation();
  pb::Request list;
  list.mutable_list_stations();
  EXPECT_EQ(ask(instructor, list).server_part, Outcome::ServerPart::kFillStations);
  EXPECT_EQ(get(instructor, list).stations().stations_size(), 1);

  pb::Request message;
  message.mutable_trainee_message()->set_station("station-1");
  message.mutable_trainee_message()->set_text("slower");
  EXPECT_EQ(ask(instructor, message).server_part, Outcome::ServerPart::kDeliverMessage);
  message.mutable_trainee_message()->set_station("nowhere");
  EXPECT_EQ(refusal(instructor, message), ErrorCode::kNotFound);
  EXPECT_EQ(ask(instructor, message).server_part, Outcome::ServerPart::kNone);
  message.mutable_trainee_message()->set_station("station-1");
  message.mutable_trainee_message()->set_text(std::string(100'000, 'x'));
  EXPECT_EQ(refusal(instructor, message), ErrorCode::kInvalidInput);

  pb::Request next;
  next.mutable_next_exercise()->set_station("station-1");
  next.mutable_next_exercise()->set_exercise_id("nothing");
  EXPECT_EQ(refusal(instructor, next), ErrorCode::kNotFound);
  pb::Request curricula;
  curricula.mutable_list_curricula();
  next.mutable_next_exercise()->set_exercise_id(
      get(admin, curricula).curricula().curricula(0).exercise_ids(0));
  EXPECT_EQ(ask(instructor, next).server_part, Outcome::ServerPart::kNextExercise);
}

}  // namespace
}  // namespace needlelab
