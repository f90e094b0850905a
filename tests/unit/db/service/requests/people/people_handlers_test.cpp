#include <future>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "db/audit/audit.h"
#include "db/service/requests/handlers.h"
#include "tests/unit/db/service/test_service.h"

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
  const auto in = service.logins().loginPerson("ina", "correct horse");
  ASSERT_OK(in);
  EXPECT_EQ(in->role, pb::INSTRUCTOR);
  EXPECT_TRUE(*service.logins().stillAllowed(*in));

  const auto wrong = service.logins().loginPerson("ina", "wrong horse");
  const auto unknown = service.logins().loginPerson("eve", "correct horse");
  pb::Request disable;
  disable.mutable_disable_user()->set_name("ina");
  get(admin, disable);
  const auto disabled = service.logins().loginPerson("ina", "correct horse");
  for (const auto* refused : {&wrong, &unknown, &disabled}) {
    ASSERT_FALSE(refused->ok());
    EXPECT_EQ(refused->error().code, ErrorCode::kDenied);
    EXPECT_EQ(refused->error().message, wrong.error().message) << "the reason shows";
  }
  EXPECT_FALSE(*service.logins().stillAllowed(*in));
  disable.mutable_disable_user()->set_enable(true);
  get(admin, disable);
  EXPECT_OK(service.logins().loginPerson("ina", "correct horse"));
}

TEST_F(PeopleHandlers, aPersonThatIsRenamedStaysTheSame) {
  get(admin, addUser("ina", pb::INSTRUCTOR, "correct horse"));
  get(admin, addUser("Zoë", pb::TRAINEE, ""));
  const auto in = store->service().logins().loginPerson("ina", "correct horse");
  ASSERT_OK(in);
  pb::Request show, rename;
  show.mutable_get_user()->set_name("ina");
  const pb::User before = get(admin, show).user();
  const auto named = [&](const std::string& name) {
    rename.mutable_change_user()->set_name(before.id());
    rename.mutable_change_user()->set_base_revision(before.revision());
    rename.mutable_change_user()->set_new_name(name);
    return rename;
  };
  EXPECT_EQ(refusal(admin, named("ZOË")), ErrorCode::kAlreadyExists);
  EXPECT_EQ(refusal(admin, named("guest")), ErrorCode::kInvalidInput);
  EXPECT_EQ(get(admin, show).user().revision(), before.revision()) << "nothing was changed";
  const pb::User after = get(admin, named("ina.berg")).user();
  EXPECT_EQ(after.name(), "ina.berg");
  EXPECT_EQ(after.id(), before.id());
  EXPECT_EQ(refusal(admin, show), ErrorCode::kNotFound) << "the earlier name";
  EXPECT_TRUE(*store->service().logins().stillAllowed(*in)) << "the log-in lasts";
  EXPECT_OK(store->service().logins().loginPerson("ina.berg", "correct horse"));
  EXPECT_EQ(store->service().logins().loginPerson("ina", "correct horse").error().code, ErrorCode::kDenied);
  pb::Request audit;
  audit.mutable_list_audit()->set_action("user change");
  const auto lines = get(admin, audit).audit();
  ASSERT_EQ(lines.entries_size(), 1);
  EXPECT_EQ(lines.entries(0).subject(), "ina.berg") << "as the person is called now";
  EXPECT_EQ(lines.entries(0).detail(), "name") << "and not as before";
}

TEST_F(PeopleHandlers, onlyAccessEndingRequestsAreMarked) {
  get(admin, addUser("ada", pb::ADMINISTRATOR, "correct horse"));
  get(admin, addUser("ina", pb::INSTRUCTOR, "correct horse"));
  const auto changes = [&](const pb::Request& request) {
    const Outcome outcome = store->service().execute(admin, request);
    EXPECT_FALSE(outcome.error) << outcome.error->message;
    return outcome.access_changed;
  };
  const auto disable = [&](bool enable) {
    pb::Request request;
    request.mutable_disable_user()->set_name("ina");
    request.mutable_disable_user()->set_enable(enable);
    return changes(request);
  };
  EXPECT_FALSE(disable(true));
  EXPECT_TRUE(disable(false));
  EXPECT_TRUE(disable(false)) << "it was disabled already, perhaps by a request whose end no one saw";
  EXPECT_FALSE(disable(true)) << "nothing was opened";
  const auto change = [&](auto set) {
    pb::Request show, request;
    show.mutable_get_user()->set_name("ina");
    request.mutable_change_user()->set_name("ina");
    request.mutable_change_user()->set_base_revision(get(admin, show).user().revision());
    set(*request.mutable_change_user());
    return changes(request);
  };
  EXPECT_FALSE(change([](pb::ChangeUser& user) { user.set_role(pb::INSTRUCTOR); }));
  EXPECT_FALSE(change([](pb::ChangeUser& user) { user.set_full_name("Ina I"); }));
  EXPECT_TRUE(change([](pb::ChangeUser& user) { user.set_role(pb::TRAINEE); }));
  EXPECT_TRUE(change([](pb::ChangeUser& user) { user.set_disabled(true); }));
  EXPECT_TRUE(change([](pb::ChangeUser& user) { user.set_disabled(true); }));
  pb::Request password;
  password.mutable_set_password()->set_name("ina");
  password.mutable_set_password()->set_password("battery staple");
  EXPECT_TRUE(changes(password));
  pb::Request add, revoke;
  add.mutable_add_station()->set_name("bench");
  revoke.mutable_revoke_station()->set_name("bench");
  EXPECT_FALSE(changes(add));
  EXPECT_TRUE(changes(revoke));
  EXPECT_TRUE(changes(revoke));
}

// a COMMIT may have succeeded although its answer was lost
TEST_F(PeopleHandlers, anAccessEndsAlsoWhereTheTransactionFailsAfterItsChange) {
  get(admin, addUser("ada", pb::ADMINISTRATOR, "correct horse"));
  get(admin, addUser("ina", pb::INSTRUCTOR, "correct horse"));
  pb::Request add, revoke, disable, password, demote, show, unknown;
  add.mutable_add_station()->set_name("bench");
  get(admin, add);
  revoke.mutable_revoke_station()->set_name("bench");
  unknown.mutable_revoke_station()->set_name("nobody's");
  disable.mutable_disable_user()->set_name("ina");
  password.mutable_set_password()->set_name("ina");
  password.mutable_set_password()->set_password("battery staple");
  show.mutable_get_user()->set_name("ina");
  demote.mutable_change_user()->set_name("ina");
  demote.mutable_change_user()->set_base_revision(get(admin, show).user().revision());
  demote.mutable_change_user()->set_role(pb::TRAINEE);
  // the audit line is written after the change
  ASSERT_OK(change([](Connection& c) { return c.script("ALTER TABLE audit RENAME TO audit_away"); }));
  for (const pb::Request& request : {revoke, disable, password, demote}) {
    const Outcome outcome = ask(admin, request);
    EXPECT_TRUE(outcome.error) << request.ShortDebugString();
    EXPECT_TRUE(outcome.access_changed) << request.ShortDebugString();
  }
  const Outcome refused = ask(admin, unknown);
  EXPECT_TRUE(refused.error);
  EXPECT_FALSE(refused.access_changed) << "it was refused before";
  ASSERT_OK(change([](Connection& c) { return c.script("ALTER TABLE audit_away RENAME TO audit"); }));
}

// requests wait for their account's other requests: for seconds after an import with many codes
TEST_F(PeopleHandlers, aDisabledAccountsPendingRequestsAreRefused) {
  get(admin, addUser("ada", pb::ADMINISTRATOR, "correct horse"));
  get(admin, addUser("mallory", pb::ADMINISTRATOR, "correct horse"));
  auto& service = store->service();
  const auto in = service.logins().loginPerson("mallory", "correct horse");
  ASSERT_OK(in);
  const auto disable = [&](bool enable) {
    pb::Request request;
    request.mutable_disable_user()->set_name("mallory");
    request.mutable_disable_user()->set_enable(enable);
    get(admin, request);
  };
  pb::Request list;
  list.mutable_list_users();
  get(*in, list);
  disable(false);
  EXPECT_EQ(refusal(*in, addUser("heir", pb::ADMINISTRATOR, "correct horse")), ErrorCode::kDenied);
  EXPECT_EQ(refusal(*in, list), ErrorCode::kDenied);
  disable(true);
  get(*in, list);
  pb::Request demote;
  demote.mutable_change_user()->set_name("mallory");
  demote.mutable_change_user()->set_role(pb::TRAINEE);
  pb::Request show;
  show.mutable_get_user()->set_name("mallory");
  demote.mutable_change_user()->set_base_revision(get(admin, show).user().revision());
  get(admin, demote);
  EXPECT_EQ(refusal(*in, list), ErrorCode::kDenied) << "the role of the log-in is no longer the account's";
}

TEST_F(PeopleHandlers, anAccountThatIsDisabledWhileItsChangeIsPreparedChangesNothing) {
  get(admin, addUser("ada", pb::ADMINISTRATOR, "correct horse"));
  get(admin, addUser("mallory", pb::ADMINISTRATOR, "correct horse"));
  auto& service = store->service();
  const auto in = service.logins().loginPerson("mallory", "correct horse");
  ASSERT_OK(in);
  bool worked = false;
  RequestUnderWay under_way;
  const auto reply =
      handlers::withReader(service.parts(), *in, "user add", under_way,
                           [&](const handlers::Context& context) -> Result<pb::Reply> {
                             // as during the 0.1 s in which a password is hashed
                             pb::Request disable;
                             disable.mutable_disable_user()->set_name("mallory");
                             get(admin, disable);
                             RETURN_IF_ERROR(handlers::write(context, "heir", "", [&](Connection&) {
                               worked = true;
                               return Status();
                             }));
                             return handlers::doneReply();
                           });
  ASSERT_FALSE(reply.ok());
  EXPECT_EQ(reply.error().code, ErrorCode::kDenied);
  EXPECT_FALSE(worked);
}

TEST_F(PeopleHandlers, onlyTraineesMayBeWithoutPassword) {
  get(admin, addUser("anna", pb::TRAINEE, ""));
  EXPECT_EQ(store->service().logins().loginPerson("anna", "").error().code, ErrorCode::kDenied);
  EXPECT_EQ(refusal(admin, addUser("ina", pb::INSTRUCTOR, "")), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(admin, addUser("lab", pb::STATION, "correct horse")), ErrorCode::kInvalidInput);
  pb::Request list;
  list.mutable_list_users();
  const auto users = get(instructor, list).users();
  ASSERT_EQ(users.users_size(), 1);
  EXPECT_FALSE(users.users(0).has_password());
}

TEST_F(PeopleHandlers, sayingTheSameAgainOnStudiesStoresNothing) {
  addPerson("anna", pb::TRAINEE);
  const auto stored = [&] {
    auto reader = store->readers().borrow();
    EXPECT_OK(reader);
    auto rows = (*reader)->query(
        "SELECT (SELECT count(*) FROM consents), (SELECT count(*) FROM audit WHERE action = 'consent')");
    EXPECT_TRUE(*rows.step());
    return std::pair(rows.integer(0), rows.integer(1));
  };
  const auto say = [&](const Principal& who, bool given, const std::string& note) {
    pb::Request request;
    request.mutable_set_consent()->set_name("anna");
    request.mutable_set_consent()->set_given(given);
    request.mutable_set_consent()->set_note(note);
    return get(who, request).user().consent();
  };
  const pb::Consent first = say(trainee, true, "");
  EXPECT_EQ(stored(), std::pair(std::int64_t{1}, std::int64_t{1}));
  for (int i = 0; i < 3; ++i) {
    const pb::Consent again = say(trainee, true, "");
    EXPECT_EQ(again.unix_ns(), first.unix_ns()) << "since the first time";
    EXPECT_TRUE(again.given());
  }
  EXPECT_EQ(stored(), std::pair(std::int64_t{1}, std::int64_t{1}));
  // a different note, recorder or decision is a new entry
  EXPECT_EQ(say(trainee, true, "paper 7").note(), "paper 7");
  EXPECT_EQ(say(instructor, true, "paper 7").recorded_by(), "ina");
  EXPECT_FALSE(say(instructor, false, "paper 7").given());
  EXPECT_TRUE(say(instructor, true, "paper 7").given()) << "an earlier statement is not the newest one";
  EXPECT_EQ(stored(), std::pair(std::int64_t{5}, std::int64_t{5}));
  pb::Request list;
  list.mutable_list_consents()->set_name("anna");
  const auto all = get(trainee, list).consents();
  ASSERT_EQ(all.consents_size(), 5);
  EXPECT_EQ(all.consents(0).unix_ns(), first.unix_ns()) << "oldest first";
  EXPECT_EQ(all.consents(4).recorded_by(), "ina");
}

TEST_F(PeopleHandlers, aLongConsentListGivesTheNewestOldestFirst) {
  addPerson("anna", pb::TRAINEE);
  ASSERT_OK(change([](Connection& c) -> Status {
    pb::Consent consent;
    consent.set_recorded_by("ina");
    consent.set_note(std::string(1000, 'x'));
    for (std::int64_t when = 1; when <= 1200; ++when) {
      consent.set_unix_ns(when);
      RETURN_IF_ERROR(ConsentStore(c).add("anna", consent));
    }
    return {};
  }));
  pb::Request list;
  list.mutable_list_consents()->set_name("anna");
  const auto reply = get(trainee, list);
  EXPECT_LT(reply.ByteSizeLong(), 1u << 20);
  const auto& listed = reply.consents().consents();
  ASSERT_GT(listed.size(), 900);
  ASSERT_LT(listed.size(), 1200);
  for (int i = 0; i < listed.size(); ++i) ASSERT_EQ(listed[i].unix_ns(), 1200 - listed.size() + 1 + i);
}

TEST_F(PeopleHandlers, managersEndTheAccessOfThoseBelowThemAndAdministratorsAnybodys) {
  const std::vector<std::pair<std::string, pb::Role>> people = {{"tia", pb::TRAINEE},
                                                                {"ina", pb::INSTRUCTOR},
                                                                {"mia", pb::CURRICULUM_MANAGER},
                                                                {"max", pb::CURRICULUM_MANAGER},
                                                                {"ada", pb::ADMINISTRATOR},
                                                                {"rita", pb::RESEARCHER}};
  for (const auto& [name, role] : people) addPerson(name, role);
  // otherwise ada would be the last user who can log in and could not be locked
  ASSERT_OK(change([](Connection& c) {
    return PeopleStore(c).add({"root", pb::ADMINISTRATOR, "some hash", false, 1});
  }));
  // The users whose access mia, a manager, may end; listed by hand.
  const std::set<std::string> hers = {"tia", "ina", "mia"};
  for (const Principal* who : {&manager, &admin}) {
    for (const auto& [name, role] : people) {
      const bool may = who == &admin || hers.contains(name);
      for (const bool by_change : {false, true}) {
        for (const bool enable : {false, true}) {
          pb::Request request;
          if (by_change) {
            pb::Request show;
            show.mutable_get_user()->set_name(name);
            request.mutable_change_user()->set_name(name);
            request.mutable_change_user()->set_base_revision(get(admin, show).user().revision());
            request.mutable_change_user()->set_disabled(!enable);
          } else {
            request.mutable_disable_user()->set_name(name);
            request.mutable_disable_user()->set_enable(enable);
          }
          if (may) {
            get(*who, request);
            continue;
          }
          // Unlocking an account that is not locked changes nothing and needs no permission.
          if (by_change && enable) continue;
          EXPECT_EQ(refusal(*who, request), ErrorCode::kDenied) << who->name << " of " << name;
        }
      }
    }
  }
  // A manager cannot unlock another manager either: there was a reason for the lock.
  pb::Request lock;
  lock.mutable_disable_user()->set_name("max");
  get(admin, lock);
  lock.mutable_disable_user()->set_enable(true);
  EXPECT_EQ(refusal(manager, lock), ErrorCode::kDenied);
  pb::Request change;
  change.mutable_change_user()->set_name("max");
  change.mutable_change_user()->set_disabled(false);
  pb::Request show;
  show.mutable_get_user()->set_name("max");
  change.mutable_change_user()->set_base_revision(get(admin, show).user().revision());
  EXPECT_EQ(refusal(manager, change), ErrorCode::kDenied);
}

TEST_F(PeopleHandlers, newNamesMayNotContainASlashButOldOnesWork) {
  ASSERT_OK(change([](Connection& c) -> Status {
    RETURN_IF_ERROR(PeopleStore(c).add({"ab", pb::TRAINEE, "", false, 1}));
    RETURN_IF_ERROR(c.run("UPDATE names SET name = 'a/b', folded = 'a/b' WHERE name = 'ab'"));
    if (auto done = c.run("INSERT INTO stations (name, key_hash, revoked, created_unix_ns) VALUES ('lab/1',"
                          "zeroblob(32),1,1)");
        !done)
      return done;
    return c.run(
        "INSERT INTO groups (id, name, revision, changed_by, changed_unix_ns) VALUES ('c/1','C',1,'x',1)");
  }));
  EXPECT_EQ(refusal(admin, addUser("n/m", pb::TRAINEE, "")), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(admin, addUser("..", pb::TRAINEE, "")), ErrorCode::kInvalidInput);
  pb::Request request;
  request.mutable_add_station()->set_name("lab/2");
  EXPECT_EQ(refusal(admin, request), ErrorCode::kInvalidInput);
  request.mutable_add_station()->set_name("lab/1");
  EXPECT_EQ(get(admin, request).station_key().name(), "lab/1") << "a new key for a revoked one";
  request.mutable_put_group()->mutable_group()->set_id("c/2");
  request.mutable_put_group()->mutable_group()->set_name("C2");
  EXPECT_EQ(refusal(admin, request), ErrorCode::kInvalidInput);
  request.mutable_put_group()->mutable_group()->set_id("c/1");
  request.mutable_put_group()->mutable_group()->add_members("a/b");
  request.mutable_put_group()->set_base_revision(1);
  EXPECT_EQ(get(admin, request).group().members_size(), 1);
  request.mutable_import_people()->set_csv("name,full_name\na/b,Known Person\n");
  EXPECT_TRUE(get(admin, request).people_import().done());
  request.mutable_import_people()->set_csv("name,full_name\nx/y,New Person\n");
  EXPECT_FALSE(get(admin, request).people_import().done());
  request.mutable_import_people()->set_csv("name,group\na/b,c/1\n");
  EXPECT_TRUE(get(admin, request).people_import().done());
  request.mutable_change_user()->set_name("a/b");
  request.mutable_change_user()->set_full_name("Still There");
  pb::Request show;
  show.mutable_get_user()->set_name("a/b");
  request.mutable_change_user()->set_base_revision(get(admin, show).user().revision());
  EXPECT_EQ(get(admin, request).user().full_name(), "Still There");
  addStation();
  (void)addSession("a/b", 1);  // and practises as before
  pb::Request list;
  list.mutable_list_sessions()->set_trainee("a/b");
  EXPECT_EQ(get(admin, list).sessions().sessions_size(), 1);
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
  EXPECT_OK(store->service().logins().loginPerson("ina", "new password"));
  request.mutable_set_password()->set_name("nobody");
  EXPECT_EQ(refusal(admin, request), ErrorCode::kNotFound);
}

TEST_F(PeopleHandlers, settingYourPasswordNeedsTheCurrentOne) {
  get(admin, addUser("ina", pb::INSTRUCTOR, "correct horse"));
  pb::Request request;
  auto* call = request.mutable_set_password();
  call->set_name("ina");
  call->set_password("another horse");
  EXPECT_EQ(refusal(instructor, request), ErrorCode::kInvalidInput) << "without it";
  call->set_old_password("a wrong horse");
  EXPECT_EQ(refusal(instructor, request), ErrorCode::kDenied);
  EXPECT_OK(store->service().logins().loginPerson("ina", "correct horse"));
  call->set_old_password("correct horse");
  get(instructor, request);
  EXPECT_OK(store->service().logins().loginPerson("ina", "another horse"));
  // an administrator sets it without the old one
  call->clear_old_password();
  call->set_password("a third horse");
  get(admin, request);
  EXPECT_OK(store->service().logins().loginPerson("ina", "a third horse"));
}

TEST_F(PeopleHandlers, anUnlockedComputerDoesNotGuessTheOldPassword) {
  get(admin, addUser("ina", pb::INSTRUCTOR, "correct horse"));
  pb::Request request;
  auto* call = request.mutable_set_password();
  call->set_name("ina");
  call->set_password("another horse");
  for (int i = 0; i < 5; ++i) {
    call->set_old_password("wrong horse " + std::to_string(i));
    EXPECT_EQ(refusal(instructor, request), ErrorCode::kDenied) << i;
  }
  call->set_old_password("correct horse");
  const Outcome outcome = ask(instructor, request);
  ASSERT_TRUE(outcome.error.has_value());
  EXPECT_NE(outcome.error->message.find("too many wrong ones"), std::string::npos);
}

TEST_F(PeopleHandlers, staffHasNoPasswordThatGuessersTryFirst) {
  const std::pair<const char*, const char*> bad[] = {
      {"ninebytes", "allowed are 10 to 256"}, {"Password2026!", "most common"},
      {"qwertyuiop", "most common"},          {"PASSW0RD123", "most common"},
      {"aaaaaaaaaaaa", "again and again"},    {"12345678901", "neighbours"},
      {"abcdefghijkl", "neighbours"},         {"ines.mueller", "own name"},
      {"Ines.Mueller1", "own name"},
  };
  for (const auto& [password, words] : bad) {
    const Outcome outcome = ask(admin, addUser("ines.mueller", pb::INSTRUCTOR, password));
    ASSERT_TRUE(outcome.error.has_value()) << password;
    EXPECT_EQ(outcome.error->code, ErrorCode::kInvalidInput);
    EXPECT_NE(outcome.error->message.find(words), std::string::npos) << outcome.error->message;
    EXPECT_EQ(outcome.error->message.find(password), std::string::npos) << "it is not said again";
  }
  get(admin, addUser("ines.mueller", pb::INSTRUCTOR, "correct horse"));
  // trainees see only their own data: eight bytes suffice
  get(admin, addUser("tim", pb::TRAINEE, "password"));
  pb::Request request;
  request.mutable_set_password()->set_name("ines.mueller");
  request.mutable_set_password()->set_password("Password2026!");
  EXPECT_EQ(refusal(admin, request), ErrorCode::kInvalidInput);
}

TEST_F(PeopleHandlers, aStationGetsAKeyOnceAndLosesItWhenRevoked) {
  pb::Request add;
  add.mutable_add_station()->set_name("lab-1");
  const auto key = get(admin, add).station_key();
  EXPECT_EQ(key.key().size(), 32u);
  auto& service = store->service();
  EXPECT_EQ(service.logins().loginStation("lab-1", key.key())->role, pb::STATION);
  EXPECT_FALSE(service.logins().loginStation("lab-2", key.key()).ok());
  EXPECT_FALSE(service.logins().loginStation("lab-1", std::string(32, '\0')).ok());
  EXPECT_EQ(refusal(admin, add), ErrorCode::kAlreadyExists);
  pb::Request revoke;
  revoke.mutable_revoke_station()->set_name("lab-1");
  get(admin, revoke);
  EXPECT_FALSE(service.logins().loginStation("lab-1", key.key()).ok());
  EXPECT_FALSE(*service.logins().stillAllowed({"lab-1", pb::STATION}));
}

TEST_F(PeopleHandlers, everyChangeIsInTheAuditLogWithoutSecrets) {
  get(admin, addUser("ina", pb::INSTRUCTOR, "correct horse"));
  EXPECT_EQ(refusal(admin, addUser("ina", pb::INSTRUCTOR, "correct horse")), ErrorCode::kAlreadyExists);
  pb::Request add;
  add.mutable_add_station()->set_name("lab-1");
  get(admin, add);
  ASSERT_OK(store->service().notes().note("lab-1", "chunk refused", "some session", "contradiction"));
  pb::Request list;
  list.mutable_list_audit();
  const auto audit = get(admin, list).audit();
  ASSERT_EQ(audit.entries_size(), 3) << "a refused change is not a change";
  EXPECT_EQ(audit.entries(0).action(), "chunk refused");
  EXPECT_EQ(audit.entries(1).action(), "station add");
  EXPECT_EQ(audit.entries(2).action(), "user add");
  EXPECT_EQ(audit.entries(2).who(), "ada");
  EXPECT_EQ(audit.entries(2).subject(), "ina");
  EXPECT_EQ(audit.SerializeAsString().find("horse"), std::string::npos);
}

TEST_F(PeopleHandlers, linesDuringABusyWriterFormOneItemWithoutWaiting) {
  std::promise<void> begun, go;
  ASSERT_OK(store->writer().post(
      [&](Connection&) -> Status {
        begun.set_value();
        go.get_future().wait();
        return {};
      },
      {}));
  begun.get_future().wait();
  constexpr int kLines = 300;
  for (int i = 0; i < kLines; ++i)
    store->service().notes().noteSoon({"ines"}, "not delivered", "lab-1", std::to_string(i),
                                      [](const Error& error) { ADD_FAILURE() << error.message; });
  EXPECT_EQ(store->writer().counters().waiting, 1u);
  go.set_value();
  ASSERT_OK(store->writer().run([](Connection&) { return Status(); }));
  pb::Request list;
  list.mutable_list_audit()->set_action("not delivered");
  const auto audit = get(admin, list).audit();
  ASSERT_EQ(audit.entries_size(), kLines);
  for (int i = 0; i < kLines; ++i) EXPECT_EQ(audit.entries(i).detail(), std::to_string(kLines - 1 - i));
}

TEST_F(PeopleHandlers, pendingLinesAreStoredAtTheEndAndLaterOnesFail) {
  std::vector<ErrorCode> failed;
  const auto hears = [&](const Error& error) { failed.push_back(error.code); };
  for (const char* detail : {"1", "2"})
    store->service().notes().noteSoon({"ines"}, "not delivered", "lab-1", detail, hears);
  store->writer().stop();
  EXPECT_TRUE(failed.empty());
  store->service().notes().noteSoon({"ines"}, "not delivered", "lab-1", "3", hears);
  EXPECT_EQ(failed, std::vector{ErrorCode::kUnavailable});
  auto reader = store->readers().borrow();
  ASSERT_OK(reader);
  const auto lines = AuditStore(**reader).list(10, 0, {}, "not delivered");
  ASSERT_OK(lines);
  ASSERT_EQ(lines->size(), 2u);
  EXPECT_EQ(lines->front().detail, "2");
}

TEST_F(PeopleHandlers, whatIsAsItIsAskedForIsNotWrittenAgain) {
  addPerson("anna", pb::TRAINEE);
  addStation();
  const auto lines = [&] {
    auto reader = store->readers().borrow();
    EXPECT_OK(reader);
    auto rows = (*reader)->query("SELECT count(*) FROM audit");
    EXPECT_TRUE(*rows.step());
    return rows.integer(0);
  };
  pb::Request disable, enable, no_code, revoke, same, optional;
  disable.mutable_disable_user()->set_name("anna");
  enable.mutable_disable_user()->set_name("anna");
  enable.mutable_disable_user()->set_enable(true);
  no_code.mutable_set_code()->set_name("anna");
  revoke.mutable_revoke_station()->set_name("station-1");
  same.mutable_change_user()->set_name("anna");
  same.mutable_change_user()->set_base_revision(1);
  same.mutable_change_user()->set_disabled(false);
  optional.mutable_change_lab_settings()->set_codes_required(false);
  const auto before = lines();
  for (const auto* request : {&enable, &no_code, &same, &optional}) get(admin, *request);
  get(trainee, no_code);
  EXPECT_EQ(lines(), before);
  for (int i = 0; i < 3; ++i)
    for (const auto* request : {&disable, &revoke}) get(admin, *request);
  EXPECT_EQ(lines(), before + 2) << "the first of each";
  same.mutable_change_user()->set_disabled(true);
  EXPECT_EQ(refusal(admin, same), ErrorCode::kConflict) << "an old revision stays a conflict";
}

TEST_F(PeopleHandlers, whatTheServerMustDoIsMarked) {
  addStation();
  pb::Request list;
  list.mutable_list_stations();
  EXPECT_EQ(ask(instructor, list).server_part, ServerPart::kFillStations);
  EXPECT_EQ(get(instructor, list).stations().stations_size(), 1);

  pb::Request message;
  message.mutable_trainee_message()->set_station("station-1");
  message.mutable_trainee_message()->set_text("slower");
  EXPECT_EQ(ask(instructor, message).server_part, ServerPart::kDeliver);
  message.mutable_trainee_message()->set_station("nowhere");
  EXPECT_EQ(refusal(instructor, message), ErrorCode::kNotFound);
  EXPECT_EQ(ask(instructor, message).server_part, ServerPart::kNone);
  message.mutable_trainee_message()->set_station("station-1");
  message.mutable_trainee_message()->set_text(std::string(100'000, 'x'));
  EXPECT_EQ(refusal(instructor, message), ErrorCode::kInvalidInput);

  pb::Request next;
  next.mutable_next_exercise()->set_station("station-1");
  next.mutable_next_exercise()->set_exercise_id("nothing");
  EXPECT_EQ(refusal(instructor, next), ErrorCode::kNotFound);
}

}  // namespace
}  // namespace needlelab
