// Erasing through the service, interrupted at each place where a crash may happen.
#include "db/service/records/erasures.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <string>
#include <vector>

#include "db/backup/backup.h"
#include "db/backup/old_backups.h"
#include "db/erasure/erasure.h"
#include "db/service/folder/data_folder.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class Erasures : public test::ServiceTest {
 protected:
  void SetUp() override {
    addStation();
    addPerson("ada", pb::ADMINISTRATOR);
    addPerson("ina", pb::INSTRUCTOR);
    addPerson("anna", pb::TRAINEE);
  }
  static pb::Request erase(const std::string& name) {
    pb::Request request;
    request.mutable_erase_person()->set_name(name);
    request.mutable_erase_person()->set_confirm(name);
    request.mutable_erase_person()->set_reason("asked for it");
    return request;
  }
  Uuid closedSession(const std::string& trainee) {
    const Uuid id = addSession(trainee, 2);
    EXPECT_OK(change([&](Connection& c) -> Status {
      const auto closed = SessionStore(c).close(test::closeOf(id, 2, 20), 2);
      return closed ? Status() : Status(closed.error());
    }));
    return id;
  }
  std::vector<ErasureLine> listed() { return *readErasures(folder.path() / "data"); }
  void openAgain() {
    store.reset();
    store = test::openStore(folder.path() / "data");
  }
  bool isThere(const std::string& name) { return refOf(name).starts_with('@'); }
  std::string auditText() {
    pb::Request request;
    request.mutable_list_audit();
    std::string text;
    const auto reply = get(admin, request);
    for (const auto& entry : reply.audit().entries())
      text += entry.who() + " | " + entry.action() + " | " + entry.subject() + " | " + entry.detail() + "\n";
    return text;
  }
};

TEST_F(Erasures, theReplyNamesThePseudonymAndLogsSayErasedPerson) {
  const Uuid id = closedSession("anna");
  const std::string gone = "erased person " + refOf("anna").substr(1);
  pb::Request remark;
  remark.mutable_annotate()->set_session_id(test::bytesOfId(id));
  remark.mutable_annotate()->set_text("steady");
  get(instructor, remark);
  const auto erasure = get(admin, erase("ANNA")).erasure();
  EXPECT_EQ(erasure.pseudonym(), gone);
  EXPECT_FALSE(erasure.pending());
  EXPECT_FALSE(isThere("anna"));
  EXPECT_EQ(listed().size(), 1u);
  EXPECT_THAT(auditText(), AllOf(HasSubstr("ada | person erase | " + gone + " | 1 sessions, 1 recordings"),
                                 Not(HasSubstr("anna"))));
  pb::Request remarks;
  remarks.mutable_list_annotations()->set_session_id(test::bytesOfId(id));
  EXPECT_EQ(get(instructor, remarks).annotations().annotations(0).author(), "ina");
}

TEST_F(Erasures, isRefusedForOneselfWithoutConfirmationAndWhileASessionIsOpen) {
  EXPECT_EQ(refusal(admin, erase("ada")), ErrorCode::kDenied);
  EXPECT_EQ(refusal(admin, erase("nobody")), ErrorCode::kNotFound);
  pb::Request other = erase("anna");
  other.mutable_erase_person()->set_confirm("ann");
  EXPECT_EQ(refusal(admin, other), ErrorCode::kInvalidInput);
  addSession("anna", 1);
  EXPECT_EQ(refusal(admin, erase("anna")), ErrorCode::kUnavailable);
  EXPECT_TRUE(listed().empty());
  other = erase("anna");
  other.mutable_erase_person()->set_with_open_sessions(true);
  EXPECT_EQ(get(admin, other).erasure().sessions(), 1u);
}

TEST_F(Erasures, aFailedTransactionKeepsThePersonAndTheList) {
  if (test::onPostgres()) return;  // the trigger is written in SQLite's dialect
  ASSERT_OK(change([](Connection& c) {
    return c.script("CREATE TRIGGER fails BEFORE DELETE ON consents BEGIN SELECT RAISE(ABORT, 'no'); END");
  }));
  ASSERT_OK(change([&](Connection& c) { return ConsentStore(c).add(refOf("anna"), {}); }));
  EXPECT_EQ(refusal(admin, erase("anna")), ErrorCode::kInvalidInput) << "as a constraint that fails";
  EXPECT_TRUE(isThere("anna"));
  EXPECT_TRUE(listed().empty());
  ASSERT_OK(change([](Connection& c) { return c.script("DROP TRIGGER fails"); }));
  get(admin, erase("anna"));
}

TEST_F(Erasures, theNextStartCompletesAnInterruptedErasure) {
  closedSession("anna");
  const auto line = [&] {
    auto reader = store->readers().borrow();
    return *ErasureStore(**reader).lineOf(refOf("anna"), 7);
  }();
  ASSERT_OK(addErasures(folder.path() / "data", {line}));
  openAgain();
  EXPECT_FALSE(isThere("anna"));
  EXPECT_EQ(store->erasuresRepeated(), 1u);
  EXPECT_THAT(auditText(), HasSubstr("server | person erase |  | 1 people of the list"));
}

TEST_F(Erasures, aListThatWasLostIsWrittenAgainByTheNextStart) {
  get(admin, erase("anna"));
  const auto before = listed();
  std::filesystem::remove(folder.path() / "data" / kErasuresFile);
  pb::Request check;
  check.mutable_check();
  EXPECT_THAT(get(admin, check).check_report().faults(), testing::Contains(HasSubstr("lacks erasures")));
  openAgain();
  EXPECT_EQ(listed(), before);
  EXPECT_TRUE(get(admin, check).check_report().ok());
}

TEST_F(Erasures, theReplySaysHowManyBackupsHaveTheNameUpToTheNewest) {
  if (test::onPostgres()) return;  // its backups are made by its own tools
  EXPECT_THAT(get(admin, erase("anna")).erasure().text(),
              AllOf(HasSubstr("Backups that were made before have the name until somebody removes them. "),
                    Not(HasSubstr("backups in"))));
  addPerson("ben", pb::TRAINEE);
  const auto backups = folder.path() / "backups", elsewhere = folder.path() / "elsewhere";
  const auto hour = [](int n) { return backupName(1'770'000'000'000'000'000 + n * 3'600'000'000'000); };
  // the newest is neither the first nor the last one made; what counts is in the last one's folder, named as
  // a backup
  for (const auto& path : {elsewhere / hour(4), backups / "by-hand.db", backups / hour(2), backups / hour(3),
                           backups / hour(1)}) {
    std::filesystem::create_directories(path.parent_path());
    pb::Request backup;
    backup.mutable_backup()->set_path(path.string());
    get(admin, backup);
  }
  EXPECT_THAT(get(admin, erase("ben")).erasure().text(),
              HasSubstr("3 backups in " + backups.string() + ", up to " + hour(3) + ", have the name until"));
}

TEST_F(Erasures, aBackupRestoredElsewhereBringsNoOneBack) {
  if (test::onPostgres()) return;  // its backups are made by its own tools
  pb::Request backup;
  backup.mutable_backup()->set_path((folder.path() / "backups" / "old.db").string());
  std::filesystem::create_directories(folder.path() / "backups");
  get(admin, backup);
  const auto erasure = get(admin, erase("anna")).erasure();
  EXPECT_THAT(erasure.text(), HasSubstr("Backups"));
  store.reset();
  // the other machine has only the folder of backups
  const auto there = folder.path() / "there";
  std::filesystem::create_directories(there);
  ASSERT_OK(restoreFrom(there, folder.path() / "backups" / "old.db", 9, {}));
  store = test::openStore(there);
  EXPECT_EQ(store->erasuresRepeated(), 1u);
  EXPECT_FALSE(isThere("anna"));
  EXPECT_TRUE(isThere("ina"));
}

TEST_F(Erasures, exportsBeforeAndAfter) {
  closedSession("anna");
  pb::Request all;
  all.mutable_export_all();
  const auto text = [&] {
    std::string joined;
    const auto reply = get(admin, all);
    for (const std::string& record : reply.records().records()) joined += record + "\n";
    return joined;
  };
  EXPECT_THAT(text(), AllOf(HasSubstr(R"("trainee":"anna")"), HasSubstr(R"("name":"anna")")));
  const std::string ref = refOf("anna");
  get(admin, erase("anna"));
  EXPECT_THAT(text(), AllOf(Not(HasSubstr("anna")), HasSubstr(R"("trainee":")" + ref + '"')));
}

}  // namespace
}  // namespace needlelab
