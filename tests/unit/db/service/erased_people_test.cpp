// Erased people stay erased: in restored backups, with a lost key, with chunks that cannot be removed.
#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>

#include "common/base/files.h"
#include "tests/unit/db/service/records_fixture.h"

namespace needlelab {
namespace {

class ErasedPeople : public test::RecordsTest {
 protected:
  std::string everything() {
    std::string all;
    EXPECT_OK(change([&](Connection& c) -> Status {
      all = test::dump(c);
      return {};
    }));
    return all;
  }
};

TEST_F(ErasedPeople, whoseNameSomebodyTypedLeaveTextsAboutOthersAsTheyAre) {
  addStation();
  addPerson("ada", pb::ADMINISTRATOR);
  addNamed("ben", "");
  closedSession("hand", 1, "hand holds still");
  const Uuid given = closedSession("hand", 2, "");
  closedSession("ben", 3, "right hand first");
  pb::Request assign;
  assign.mutable_assign_session()->set_session_id(test::bytesOfId(given));
  assign.mutable_assign_session()->set_trainee("ben");
  get(manager, assign);
  const auto erasure = get(admin, erase("hand")).erasure();
  EXPECT_EQ(erasure.sessions(), 1u);
  EXPECT_NE(erasure.text().find("1 remarks, such as number 2"), std::string::npos) << erasure.text();
  const std::string all = everything();
  EXPECT_NE(all.find("'right hand first'"), std::string::npos);
  EXPECT_NE(all.find("from " + erasure.pseudonym() + " to ben"), std::string::npos);
  for (const char* name : {"'hand'", "hand holds", "from hand"})
    EXPECT_EQ(all.find(name), std::string::npos) << name;
  // somebody with that name comes
  addNamed("hand", "");
  pb::Request check;
  check.mutable_check();
  const auto report = get(admin, check).check_report();
  EXPECT_TRUE(report.ok()) << report.ShortDebugString();
  // an account's name goes from all texts: so it can be had for one that was typed (OPERATIONS)
  get(admin, erase("hand"));
  EXPECT_NE(everything().find("'right erased-"), std::string::npos);
}

TEST_F(ErasedPeople, areNotNamedByWhatStationsGave) {
  addStation();
  addPerson("ada", pb::ADMINISTRATOR);
  addNamed("anna", "");
  for (const auto& [given, trainee] : {std::pair{"Annuschka", "anna"}, std::pair{"Mona Ghost", "guest"}}) {
    const Uuid id = closedSession(given, 1'700'000'000'000'000'000, "");
    pb::Request assign;
    assign.mutable_assign_session()->set_session_id(test::bytesOfId(id));
    assign.mutable_assign_session()->set_trainee(trainee);
    get(manager, assign);
  }
  get(admin, erase("anna"));
  const auto pseudonym = get(admin, erase("Mona Ghost")).erasure().pseudonym();
  for (const char* name : {"Annuschka", "Mona Ghost"})
    EXPECT_EQ(everything().find(name), std::string::npos) << name;
  EXPECT_NE(everything().find("'" + pseudonym + "' | '" + manager.name + "'"), std::string::npos)
      << "the row is there, under the pseudonym";
}

TEST_F(ErasedPeople, areSaidByCheckWhenTheyAreHereAgain) {
  addNamed("anna", "");
  get(admin, erase("anna"));
  pb::Request check;
  check.mutable_check();
  // A new person has the same name.
  ASSERT_OK(change([&](Connection& c) {
    return PeopleStore(c).add({"anna", pb::TRAINEE, "", false, 2'000'000'000'000'000'000});
  }));
  EXPECT_TRUE(get(admin, check).check_report().ok());
  // the old one, by whatever way
  ASSERT_OK(change([](Connection& c) { return c.run("UPDATE people SET created_unix_ns = 5"); }));
  const auto report = get(admin, check).check_report();
  EXPECT_FALSE(report.ok());
  ASSERT_EQ(report.faults_size(), 1);
  EXPECT_NE(report.faults(0).find("'anna'"), std::string::npos);
}

TEST_F(ErasedPeople, leaveTheirNamesToNewPeopleAlsoWhenTheClockWasAhead) {
  constexpr std::int64_t kAhead = 4'000'000'000'000'000'000;  // the year 2096
  for (const char* name : {"anna", "ben"}) {
    addNamed(name, "");
    get(admin, erase(name));
  }
  ASSERT_OK(
      change([kAhead](Connection& c) { return c.run("UPDATE erasures SET erased_unix_ns = ?", kAhead); }));
  pb::Request add, table, show;
  add.mutable_add_user()->set_name("anna");
  add.mutable_add_user()->set_role(pb::TRAINEE);
  get(admin, add);
  table.mutable_import_people()->set_csv("name\nben\n");
  EXPECT_TRUE(get(admin, table).people_import().done());
  for (const char* name : {"anna", "ben"}) {
    show.mutable_get_user()->set_name(name);
    EXPECT_EQ(get(admin, show).user().created_unix_ns(), kAhead + 1) << name;
  }
}

/// The files below `place` whose bytes contain `word`, whatever the case of its first letter.
std::vector<std::string> filesWith(const std::filesystem::path& place, const std::string& word) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(place)) {
    if (!entry.is_regular_file()) continue;
    const auto bytes = readWholeFile(entry.path());
    EXPECT_OK(bytes);
    if (bytes.ok() && bytes->find(word) != std::string::npos) names.push_back(entry.path().filename());
  }
  std::sort(names.begin(), names.end());
  return names;
}

TEST_F(ErasedPeople, areInNoByteOfTheFolder) {
  // a name and a full name that nothing else contains
  addStation();
  addNamed("qzxanna", "Wqjvornov");
  closedSession("qzxanna", 1, "Wqjvornov holds still, qzxanna");
  (void)addSession("qzxanna", 1, 20,
                   R"({"layers":[{"name":"qzxanna's skin"}],"hazards":[{"name":"Wqjvornov"}]})");
  const auto data = folder.path() / "data";
  EXPECT_FALSE(filesWith(data, "qzxanna").empty());
  const auto erasure = get(admin, erase("qzxanna", true)).erasure();
  EXPECT_FALSE(erasure.pending()) << erasure.text();
  EXPECT_EQ(filesWith(data, "qzxanna"), std::vector<std::string>()) << "while it serves";
  EXPECT_EQ(filesWith(data, "Wqjvornov"), std::vector<std::string>());
  store.reset();
  EXPECT_EQ(filesWith(data, "qzxanna"), std::vector<std::string>()) << "after the stop";
  store = test::openStore(data);
  EXPECT_EQ(filesWith(data, "qzxanna"), std::vector<std::string>()) << "after the start";
  EXPECT_EQ(filesWith(data, "Wqjvornov"), std::vector<std::string>());
}

TEST_F(ErasedPeople, arePendingWhileSomebodyReadsAndGoneAfterTheNextStart) {
  addNamed("qzxanna", "");
  const auto data = folder.path() / "data";
  {
    auto reader = store->readers().borrow();
    ASSERT_OK(reader);
    const auto view = Transaction::begin(**reader, Transaction::Kind::kRead);
    ASSERT_OK(view);
    const auto erasure = get(admin, erase("qzxanna")).erasure();
    EXPECT_TRUE(erasure.pending());
    EXPECT_NE(erasure.text().find("Pending"), std::string::npos) << erasure.text();
    EXPECT_FALSE(filesWith(data, "qzxanna").empty()) << "the reader still sees it";
    pb::Request check;
    check.mutable_check();
    const auto report = get(admin, check).check_report();
    ASSERT_EQ(report.faults_size(), 1);
    EXPECT_NE(report.faults(0).find("an erasure is pending"), std::string::npos);
  }
  store.reset();
  store = test::openStore(data);
  EXPECT_EQ(filesWith(data, "qzxanna"), std::vector<std::string>());
}

TEST_F(ErasedPeople, areSaidToBeInBackupsAndReplacedDatabases) {
  addNamed("qzxanna", "");
  const auto data = folder.path() / "data";
  std::filesystem::create_directory(folder.path() / "kept");
  for (const auto& path :
       {data / "needlelab.db.replaced-20260101T000000Z", folder.path() / "kept" / "one.db"}) {
    pb::Request backup;
    backup.mutable_backup()->set_path(path.string());
    get(admin, backup);
  }
  const auto erasure = get(admin, erase("qzxanna")).erasure();
  EXPECT_EQ(std::vector<std::string>(erasure.files().begin(), erasure.files().end()),
            (std::vector<std::string>{data / "needlelab.db.replaced-20260101T000000Z",
                                      folder.path() / "kept" / "one.db"}));
  for (const std::string& file : erasure.files())
    EXPECT_NE(erasure.text().find(file), std::string::npos) << erasure.text();
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "kept" / kErasuresCopy)) << "for a restore elsewhere";
  // a backup from now on does not name her
  addNamed("ben", "");
  pb::Request backup;
  backup.mutable_backup()->set_path((folder.path() / "kept" / "two.db").string());
  get(admin, backup);
  const auto other = get(admin, erase("ben")).erasure();
  ASSERT_EQ(other.files_size(), 1);
  EXPECT_EQ(other.files(0), folder.path() / "kept" / "two.db");
}

TEST_F(ErasedPeople, mayBeInLogsAndUnfinishedCopiesOfBackups) {
  addNamed("qzxanna", "");
  const auto data = folder.path() / "data";
  std::filesystem::create_directory(data / "backups");
  const auto replaced = data / "needlelab.db.replaced-20260101T000000Z";
  pb::Request backup;
  backup.mutable_backup()->set_path(replaced.string());
  get(admin, backup);
  const auto write = [](const std::filesystem::path& path, std::string_view text) {
    EXPECT_OK(writeFileAtomically(path, viewOf(text)));
    return path.string();
  };
  std::set<std::string> listed{replaced.string(),
                               write(replaced.string() + "-wal", "qzxanna"),
                               write(data / "needlelab.db.replaced-20250101T000000Z-wal", "qzxanna"),
                               write(data / "needlelab.db.backup-copy", "qzxanna"),
                               write(data / "backups" / "a.db.partial", "qzxanna"),
                               write(data / "backups" / "a.db.partial-journal", "qzxanna"),
                               write(data / "backups" / "b.db.partial-journal", "qzxanna")};
  write(data / "backups" / "empty.partial", "");
  std::set<std::string> listed_names;
  for (const std::string& file : listed) listed_names.insert(std::filesystem::path(file).filename());
  listed.insert(write(data / "backups" / "other-wal", "of another program"));
  const auto erasure = get(admin, erase("qzxanna")).erasure();
  EXPECT_EQ(std::set<std::string>(erasure.files().begin(), erasure.files().end()), listed);
  const auto still = filesWith(data, "qzxanna");
  EXPECT_EQ(std::set<std::string>(still.begin(), still.end()), listed_names);
}

TEST_F(ErasedPeople, mayBeInDatabasesInAnyFolderBelowTheServersOwn) {
  addNamed("qzxanna", "");
  const auto data = folder.path() / "data", elsewhere = folder.path() / "elsewhere";
  std::set<std::string> listed;
  // as restores of before were undone, by OPERATIONS of then
  for (const auto& place : {data / "restored", data / "a" / "b" / "c", elsewhere}) {
    std::filesystem::create_directories(place);
    const auto copy = place / "needlelab.db";
    pb::Request backup;
    backup.mutable_backup()->set_path(copy.string());
    get(admin, backup);
    listed.insert(copy.string());
  }
  std::filesystem::create_directory_symlink(elsewhere, data / "link");
  std::filesystem::create_directory_symlink(data, data / "a" / "round");
  const auto erasure = get(admin, erase("qzxanna")).erasure();
  EXPECT_EQ(std::set<std::string>(erasure.files().begin(), erasure.files().end()), listed)
      << "also where the last backup is; each once";
  for (const std::string& file : listed) std::filesystem::remove(file);
  EXPECT_EQ(filesWith(folder.path(), "qzxanna"), std::vector<std::string>());
}

TEST_F(ErasedPeople, ofGuestAreThoseOfNowAndTheReplySaysSo) {
  addStation();
  closedSession("guest", 1, "");
  EXPECT_NE(get(admin, erase("guest")).erasure().text().find("deliver from now on are kept"),
            std::string::npos);
  closedSession("guest", 1, "");
  pb::Request check;
  check.mutable_check();
  const auto report = get(admin, check).check_report();
  EXPECT_TRUE(report.ok()) << report.DebugString();
  EXPECT_EQ(get(admin, erase("guest")).erasure().sessions(), 1u);
}

TEST_F(ErasedPeople, leaveTheirFirstNamesToOthersAlsoAfterARestore) {
  addStation();
  addNamed("anna.ohm", "Anna Ohm");
  const auto path = folder.path() / "data" / "needlelab.db";
  pb::Request backup;
  const auto chunks = [&](const Uuid& id) {
    pb::Request show;
    show.mutable_get_session()->set_session_id(test::bytesOfId(id));
    return get(instructor, show).session().chunks();
  };
  const auto restart = [&](const std::string& from) {
    store.reset();
    if (!from.empty()) {
      for (const char* suffix : {"-wal", "-shm"}) std::filesystem::remove(path.string() + suffix);
      std::filesystem::copy_file(folder.path() / from, path,
                                 std::filesystem::copy_options::overwrite_existing);
    }
    store = test::openStore(folder.path() / "data");
    return store->erasuresRepeated();
  };
  backup.mutable_backup()->set_path((folder.path() / "nobody.db").string());
  get(admin, backup);
  const Uuid hers = closedSession("Anna", 1, "");
  backup.mutable_backup()->set_path((folder.path() / "hers.db").string());
  get(admin, backup);
  EXPECT_EQ(get(admin, erase("anna.ohm")).erasure().text().find("deliver from now on are kept"),
            std::string::npos);
  EXPECT_NE(get(admin, erase("Anna")).erasure().text().find("deliver from now on are kept"),
            std::string::npos);
  EXPECT_EQ(chunks(hers), 0u);
  const auto lines = readErasures(folder.path() / "data");
  ASSERT_OK(lines);
  EXPECT_FALSE(lines->at(0).without_account);
  EXPECT_TRUE(lines->at(1).without_account);

  struct Case {
    std::string from;
    std::size_t repeated;
  };
  for (const auto& [from, repeated] : {Case{"", 0}, Case{"hers.db", 2}, Case{"nobody.db", 1}}) {
    EXPECT_EQ(restart(from), repeated) << from;
    const Uuid others = closedSession("Anna", 2, ""), late = makeUuidV7();
    ASSERT_OK(change([&](Connection& c) -> Status {
      auto d = test::describe(late);
      d.set_trainee("anna.ohm");
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      return ErasureStore(c).ownerOf("anna.ohm", 1, 1)->pseudonym
                 ? Status()
                 : Status(Error{ErrorCode::kFailed, "of the account that was erased"});
    }));
    EXPECT_EQ(chunks(others), 3u) << from;
    EXPECT_EQ(restart(""), 0u) << from;
    EXPECT_EQ(chunks(others), 3u) << from << ": not taken by the next start";
    pb::Request waiting;
    waiting.mutable_list_sessions()->set_unknown_trainee(true);
    EXPECT_EQ(get(manager, waiting).sessions().sessions_size(), 1) << from;
    EXPECT_TRUE(store->service().erasuresToRepeat()->empty());
  }
}

TEST_F(ErasedPeople, mayBeInEveryEncryptedBackup) {
  addNamed("anna", "");
  const auto key = BackupKey::make(folder.path() / "backup.key");
  ASSERT_OK(key);
  store->service().setBackupKey(*key);
  std::filesystem::create_directory(folder.path() / "kept");
  pb::Request backup;
  backup.mutable_backup()->set_path((folder.path() / "kept" / "one").string());
  get(admin, backup);
  const auto erasure = get(admin, erase("anna")).erasure();
  ASSERT_EQ(erasure.files_size(), 1) << "nobody can look into it";
  EXPECT_EQ(erasure.files(0), folder.path() / "kept" / "one.nlbk");
}

TEST_F(ErasedPeople, areErasedAlsoWhenTheirDamagedChunksStay) {
  addStation();
  addNamed("anna", "");
  closedSession("anna", 1, "");
  ASSERT_OK(
      change([&](Connection& c) { return c.run("UPDATE chunks SET bytes = zeroblob(10) WHERE seq = 1"); }));
  const auto erasure = get(admin, erase("anna")).erasure();
  EXPECT_FALSE(erasure.pseudonym().empty());
  std::int64_t left = 0;
  ASSERT_OK(change([&](Connection& c) -> Status {
    auto rows = c.prepare("SELECT count(*) FROM chunks");
    EXPECT_TRUE(*rows.step());
    left = rows.integer(0);
    return {};
  }));
  // Either the rows could still be removed, or the reply lists the remaining ones.
  EXPECT_EQ(left != 0, erasure.text().find("damaged") != std::string::npos) << left << ": " << erasure.text();
}

TEST_F(ErasedPeople, areAllThatTheKeyIsNeededFor) {
  addStation();
  addNamed("anna", "");
  addNamed("ben", "");
  get(admin, erase("anna"));
  const auto key = folder.path() / "data" / "pseudonym.key";
  const auto bytes = readWholeFile(key);
  ASSERT_OK(bytes);
  std::filesystem::remove(key);
  EXPECT_EQ(refusal(admin, erase("ben")), ErrorCode::kCorrupt);
  EXPECT_FALSE(std::filesystem::exists(key)) << "a new one fits no erasure";
  const auto list = folder.path() / "data" / "erasures";
  const auto lines = readWholeFile(list);
  ASSERT_OK(lines);
  std::filesystem::remove(list);
  EXPECT_EQ(refusal(admin, erase("ben")), ErrorCode::kCorrupt) << "the table knows, too";
  pb::Request check;
  check.mutable_check();
  const auto report = get(admin, check).check_report();
  EXPECT_FALSE(report.ok());
  ASSERT_EQ(report.faults_size(), 1);
  EXPECT_NE(report.faults(0).find("pseudonym.key"), std::string::npos);
  EXPECT_EQ(store->service().erasuresToRepeat()->size(), 1u) << "a server starts, and says it";
  addSession("ben", 1);  // lessons continue
  ASSERT_OK(writeFileAtomically(key, viewOf(*bytes), 0600));
  // a restore of an older backup would bring anna back
  const auto lacked = get(admin, check).check_report();
  EXPECT_FALSE(lacked.ok());
  ASSERT_EQ(lacked.faults_size(), 1);
  EXPECT_NE(lacked.faults(0).find("erasures: lacks 1 erasures that the database has, such as erased-"),
            std::string::npos)
      << lacked.faults(0);
  ASSERT_OK(writeFileAtomically(list, viewOf(*lines), 0600));
  EXPECT_TRUE(get(admin, check).check_report().ok());
}

}  // namespace
}  // namespace needlelab
