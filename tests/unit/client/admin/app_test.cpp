#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <gtest/gtest.h>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>

#include "client/admin/backend.h"
#include "client/admin/command.h"
#include "common/base/bytes.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "db/sessions/session_results.h"
#include "db/store/schema.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

using AdminApp = test::AdminTest;
using Arguments = std::vector<std::string>;

TEST_F(AdminApp, sessionsAreSearchedByDateVerdictExerciseAndName) {
  const std::string id = uuidText(addSession(2));  // anna's, at knee-1, started 2023-11-14T22:13:20Z
  const auto found = [&](const Arguments& more) {
    Arguments arguments = {"session", "list", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return good(arguments).rows().size();
  };
  EXPECT_EQ(found({"--from", "2023-11-14T22:13:20Z", "--to", "2023-11-14T22:13:21Z"}), 1u);
  EXPECT_EQ(found({"--from", "2023-11-14T22:13:21Z"}), 0u);
  EXPECT_EQ(found({"--to", "2023-11-14T22:13:20Z"}), 0u);
  EXPECT_EQ(found({"--exercise", "knee-1", "--trainee", "anna", "--search", "NN"}), 1u);
  EXPECT_EQ(found({"--exercise", "hip-1"}), 0u);
  EXPECT_EQ(found({"--verdict", "none"}), 1u);
  EXPECT_EQ(found({"--verdict", "passed"}), 0u);
  EXPECT_EQ(found({"--verdict", "not-passed"}) + found({"--verdict", "failed"}), 0u)
      << "its word and its code";
  EXPECT_EQ(good({"session", "list", "--json"}).rows()[0].at("verdict"), nullptr);
  EXPECT_NE(good({"session", "list"}).out.find("VERDICT"), std::string::npos);
  EXPECT_EQ(onData({"session", "list", "--verdict", "good"}).code, 2);
  const auto bare = onData({"session", "list", "--from", "2023-11-14T22:13"});
  EXPECT_EQ(bare.code, 2);
  EXPECT_NE(bare.err.find("has no time zone"), std::string::npos) << bare.err;
  EXPECT_EQ(good({"session", "show", id, "--json"}).code, 0);
}

TEST_F(AdminApp, aWrongWordIsNamedWithTheNearestRightOnes) {
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"session", "lst"}, "'session lst' is not a command: did you mean 'session list'?"},
      {{"--user", "ada", "sesion", "list"}, "'sesion' is not a command: did you mean 'session'?"},
      {{"--json", "x.json", "sesion", "list"}, "'sesion' is not a command: did you mean 'session'?"},
      {{"session", "list", "--serch=x"}, "--serch is not an option: did you mean '--search'?"},
      {{"session", "list", "--usr", "ada"}, "--usr is not an option: did you mean '--user'?"},
      {{"certificate", "frobnicate"}, "'certificate frobnicate' is not a command; there are: "},
      // words that are known: what is wrong is said as before
      {{"session", "list", "--limit", "many"}, "--limit"},
      {{"session", "list", "list"}, "list"},
  };
  for (const auto& [arguments, words] : cases) {
    const Run result = run(arguments);
    EXPECT_EQ(result.code, 2) << words;
    EXPECT_THAT(result.err, testing::HasSubstr(words));
    EXPECT_EQ(result.out, "") << words;
  }
}

TEST_F(AdminApp, rootIsRefusedOnAnotherUsersFolderWithTheRightCommand) {
  good({"user", "add", "tom", "--role", "trainee"});
  const std::filesystem::path database = std::filesystem::path(data()) / "needlelab.db";
  constexpr uid_t kOther = 61234;  // owned by no user
  const bool root = ::geteuid() == 0;
  const std::string owner = root ? "'#61234'" : localName().substr(std::string("local:").size());
  if (root) {
    EXPECT_TRUE(checkFolderUser(data(), 0).ok()) << "its own";
    ASSERT_EQ(::chown(database.c_str(), kOther, kOther), 0);
    const Run refused = onData({"user", "list"});
    EXPECT_EQ(refused.code, 2);
    EXPECT_NE(refused.err.find("sudo -u " + owner), std::string::npos) << refused.err;
    EXPECT_EQ(onData({"certificate", "show"}).err, refused.err) << "also what opens no database";
  }
  const auto refused = checkFolderUser(data(), 0);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_NE(refused.error().message.find("sudo -u " + owner + " needlelab-admin"), std::string::npos)
      << refused.error().message;
  EXPECT_TRUE(checkFolderUser(data(), kOther).ok()) << "a user who is not root gets what the files allow";
  EXPECT_TRUE(checkFolderUser(folder.path() / "none", 0).ok());
}

TEST_F(AdminApp, setsUpAFolderBeforeTheFirstServerStart) {
  const auto password = folder.write("pw", "correct horse\n").string();
  good({"user", "add", "ines", "--role", "instructor", "--password-file", password});
  good({"--password-file", password, "user", "add", "ada", "--role", "ADMIN"});
  good({"user", "add", "tom", "--role", "trainee"});
  good({"station", "add", "lab 1", "--out", file("lab1.key")});

  const auto users = good({"user", "list", "--json"}).rows();
  ASSERT_EQ(users.size(), 3u);
  EXPECT_EQ(users[0].at("name"), "ada");
  EXPECT_EQ(users[0].at("role"), "administrator");
  EXPECT_EQ(users[1].at("has_password"), true);
  EXPECT_EQ(users[2].at("has_password"), false);

  // the password and the key work
  auto store = test::TestDb::must(Store::open(data(), {}));
  EXPECT_OK(store->service().logins().loginPerson("ines", "correct horse"));
  EXPECT_OK(store->service().logins().loginPerson("ada", "correct horse"));
  struct stat info {};
  ASSERT_EQ(::stat(file("lab1.key").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777u, 0600u);
  std::ifstream in(file("lab1.key"));
  std::string line;
  std::getline(in, line);
  ASSERT_EQ(line.rfind("lab 1:", 0), 0u);
  ASSERT_EQ(line.size(), 6u + 64u);
  std::string key;
  for (std::size_t i = 6; i < line.size(); i += 2)
    key += static_cast<char>(std::stoi(line.substr(i, 2), nullptr, 16));
  EXPECT_OK(store->service().logins().loginStation("lab 1", key));
}

TEST_F(AdminApp, wrongUsageAndInputAreTwoAndMakeNothing) {
  const auto empty = folder.write("empty", "\n").string();
  const std::string key = folder.write("taken.key", "x").string();
  const Arguments wrong[] = {
      {},
      {"user"},
      {"fly"},
      {"user", "list"},
      {"--data", data(), "--server", "localhost:1", "user", "list"},
      {"--data", data(), "user", "list"},  // no database there
      {"--data", data(), "user", "add", "x"},
      {"--data", data(), "user", "add", "x", "--role", "boss"},
      {"--data", data(), "user", "add", "x", "--role", "station"},
      {"--data", data(), "user", "add", std::string(65, 'x'), "--role", "trainee"},
      {"--data", data(), "user", "add", "x", "--role", "trainee", "--password", "secret"},
      {"--data", data(), "station", "add", "x"},
      {"--data", data(), "station", "add", "x", "--out", key},
      {"--data", data(), "station", "add", "x", "--out", file("none/x.key")},
      {"--data", data(), "session", "list", "--limit", "0"},
      {"--data", data(), "session", "list", "--limit", "1001"},
      {"--data", data(), "session", "export", "x", "--format", "xml", "--out", "y"},
      {"--data", data(), "session", "export", "x"},
      {"--server", "localhost:1", "user", "list"},
      {"--server", "localhost:1", "--ca", "none", "user", "list"},
      {"--server", "localhost:1", "--ca", "none", "--user", "x", "--password-file", file("none"), "user",
       "list"},
      {"--server", "localhost:1", "--ca", "none", "--user", "x", "--password-file", empty, "user", "list"},
      {"--server", "localhost:99999", "--ca", "none", "--user", "x", "--password-file", key, "user", "list"},
      {"--server", "localhost:1", "--ca", file("none"), "--user", "x", "--password-file", key, "user",
       "list"},
  };
  for (const Arguments& arguments : wrong) {
    const Run result = run(arguments);
    std::string shown;
    for (const auto& argument : arguments) shown += argument + " ";
    EXPECT_EQ(result.code, 2) << shown << "\n" << result.err;
    EXPECT_FALSE(result.err.empty()) << shown;
    EXPECT_TRUE(result.out.empty()) << shown << result.out;
  }
  EXPECT_FALSE(std::filesystem::exists(data()));
}

TEST_F(AdminApp, wrongInputOnAFolderIsTwoAndNamed) {
  good({"user", "add", "tom", "--role", "trainee"});
  const auto bad_json = folder.write("bad.json", "{\"id\": 5}").string();
  const std::pair<Arguments, std::string> wrong[] = {
      {{"profile", "import", bad_json}, "bad.json: id"},
      {{"profile", "import", folder.path().string()}, "not a regular file"},
      {{"session", "show", "123"}, "'123' is not a session id"},
      {{"session", "verify", ""}, "session id"},
  };
  for (const auto& [arguments, text] : wrong) {
    const Run result = onData(arguments);
    EXPECT_EQ(result.code, 2) << result.err;
    EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
    EXPECT_EQ(result.err.rfind("needlelab-admin: ", 0), 0u) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  }
}

TEST_F(AdminApp, aFileInAMissingFolderExitsWithTwo) {
  good({"user", "add", "anna", "--role", "trainee"});
  const std::string id = uuidText(addSession(1));
  const std::string none = file("none/x");
  for (const Arguments& command : std::vector<Arguments>{{"profile", "export", "knee-adult"},
                                                         {"curriculum", "export", "rheumatology-basics"},
                                                         {"session", "export", id},
                                                         {"scores", "export"},
                                                         {"person", "export", "anna"},
                                                         {"study", "export", "s"},
                                                         {"export-all"},
                                                         {"station", "add", "x"},
                                                         {"backup"}}) {
    Arguments all = command;
    all.insert(all.end(), {"--out", none});
    const Run result = onData(all);
    EXPECT_EQ(result.code, 2) << command[0] << ": " << result.err;
    EXPECT_NE(result.err.find("none"), std::string::npos) << command[0] << ": " << result.err;
  }
  EXPECT_FALSE(std::filesystem::exists(file("none")));
}

TEST_F(AdminApp, aCommandThatFailsLeavesNoNewFolder) {
  const auto empty = folder.write("empty", "\n").string(), brief = folder.write("brief", "short\n").string();
  const auto table = folder.write("people.csv", "name,role\nzoe,boss\n").string();
  const std::vector<Arguments> commands = {
      {"user", "add", "ada", "--role", "administrator", "--new-password-file", file("none")},
      {"user", "add", "ada", "--role", "administrator", "--new-password-file", empty},
      {"user", "add", "ada", "--role", "administrator", "--new-password-file", brief},
      {"station", "add", "a/b", "--out", file("k")},
      {"station", "enrol", "a/b", "--server-name", "lab", "--out", file("k")},
      {"user", "import", table}};
  for (const Arguments& command : commands) {
    EXPECT_EQ(onData(command).code, 2) << command[0] << " " << command[1];
    EXPECT_FALSE(std::filesystem::exists(data())) << command[0] << " " << command[1];
  }
  // an existing folder stays, with its content
  std::filesystem::create_directory(data());
  folder.write("data/notes.txt", "mine");
  for (const Arguments& command : commands) EXPECT_EQ(onData(command).code, 2);
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(data()))
    left.push_back(entry.path().filename());
  EXPECT_EQ(left, std::vector<std::string>{"notes.txt"});
  // so does a database, even if something fails afterwards
  good({"user", "add", "tom", "--role", "trainee"});
  for (const Arguments& command : commands) EXPECT_EQ(onData(command).code, 2);
  EXPECT_EQ(good({"user", "list", "--json"}).rows().size(), 1u);
  EXPECT_FALSE(std::filesystem::exists(data() + "/tls")) << "no certificate for a station that was refused";
}

TEST_F(AdminApp, aCommandThatFailsLeavesNoNewParentFolders) {
  const auto fails = [&](const std::string& data_folder) {
    return run({"--data", data_folder, "user", "add", "ada", "--role", "administrator", "--new-password-file",
                file("none")})
        .code;
  };
  EXPECT_EQ(fails(file("a/b/c")), 2);
  EXPECT_FALSE(std::filesystem::exists(file("a")));
  EXPECT_EQ(fails(file("a/b/c/")), 2);
  EXPECT_FALSE(std::filesystem::exists(file("a")));
  // the parents can be made, the folder cannot
  EXPECT_NE(fails(file("a/b/" + std::string(300, 'x'))), 0);
  EXPECT_FALSE(std::filesystem::exists(file("a")));
  // a folder with somebody else's file in it is kept
  std::filesystem::create_directories(file("a"));
  EXPECT_EQ(fails(file("a/b/c")), 2);
  EXPECT_TRUE(std::filesystem::exists(file("a")));
  EXPECT_FALSE(std::filesystem::exists(file("a/b")));
}

TEST_F(AdminApp, aDatabaseThatCannotBeWrittenLeavesNoNewFolder) {
  rlimit usual{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &usual), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  // no room for the name in the lock file; then room for it, but not for a page of the database
  for (const rlim_t bytes : {rlim_t{0}, rlim_t{200}}) {
    const rlimit least{bytes, usual.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &least), 0);
    const Run result = onData({"user", "add", "tom", "--role", "trainee"});
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &usual), 0);
    EXPECT_NE(result.code, 0) << bytes;
    EXPECT_FALSE(std::filesystem::exists(data())) << bytes;
  }
  std::signal(SIGXFSZ, handler);
  good({"user", "add", "tom", "--role", "trainee"});
}

TEST_F(AdminApp, filesOfOthersInANewFolderAreNeverRemoved) {
  auto backend = openFolder(data(), true);
  ASSERT_TRUE(backend.ok()) << backend.error().message;
  std::filesystem::create_directories(data() + "/tls");
  folder.write("data/notes.txt", "mine");
  folder.write("data/tls/of-the-house.pem", "mine");
  folder.write("data/needlelab.db.copy", "mine");
  (*backend)->discardIfNew();
  backend->reset();
  for (const char* name : {"/notes.txt", "/tls/of-the-house.pem", "/needlelab.db.copy"})
    EXPECT_TRUE(std::filesystem::exists(data() + name)) << name;
  EXPECT_FALSE(std::filesystem::exists(data() + "/needlelab.db"));
}

TEST_F(AdminApp, aDatabaseOfAPendingRestoreIsNeverRemoved) {
  { const auto store = test::TestDb::must(Store::open(file("other"), {})); }
  std::filesystem::create_directory(data());
  std::filesystem::copy_file(file("other/needlelab.db"), data() + "/needlelab.db.restoring");
  folder.write("data/restore.pending", "needlelab.db.replaced-20260101");
  {
    // completes the restore; the restored database's audit log is empty
    const auto backend = openFolder(data(), true);
    ASSERT_TRUE(backend.ok()) << backend.error().message;
    (*backend)->discardIfNew();
  }
  EXPECT_TRUE(std::filesystem::exists(data() + "/needlelab.db"));
}

TEST_F(AdminApp, whatIsRefusedOrMissingIsOne) {
  good({"user", "add", "tom", "--role", "trainee"});
  const auto password = folder.write("pw", "correct horse").string();
  const Arguments refused[] = {
      {"user", "disable", "nobody"},
      {"user", "passwd", "nobody", "--password-file", password},
      {"station", "revoke", "nothing"},
      {"profile", "show", "nothing"},
      {"curriculum", "export", "nothing"},
      {"scores", "export", "--course", "nothing", "--out", file("x.csv")},
      {"scores", "export", "--group", "nothing", "--out", file("x.csv")},
      {"session", "show", "019aa0c3-7c1e-7b3a-9d5e-0123456789ab"},
      {"session", "verify", "019aa0c3-7c1e-7b3a-9d5e-0123456789ab"},
      {"session", "export", "019aa0c3-7c1e-7b3a-9d5e-0123456789ab", "--out", file("x.csv")},
  };
  for (const Arguments& arguments : refused) {
    const Run result = onData(arguments);
    EXPECT_EQ(result.code, 1) << arguments[0] << " " << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  }
  EXPECT_FALSE(std::filesystem::exists(file("x.csv")));
}

TEST_F(AdminApp, curriculaAndAssignments) {
  good({"user", "add", "tom", "--role", "trainee"});
  const auto curricula = good({"curriculum", "list", "--json"}).rows();
  ASSERT_EQ(curricula.size(), 3u) << "the sample courses";
  EXPECT_EQ(curricula[0].at("id"), "bodies") << "bodies come before phantoms";
  const std::string exercise = curricula[0].at("exercise_ids")[0];
  EXPECT_EQ(curricula[0].at("exam"), false);
  // Export and import give the same text.
  for (const auto& [id, sample] : std::map<std::string, std::string>{
           {"rheumatology-basics", NEEDLELAB_SAMPLES "/curriculum.json"},
           {"injection-steps", NEEDLELAB_SAMPLES "/injection-steps-curriculum.json"},
           {"bodies", NEEDLELAB_SAMPLES "/volumes/bodies-curriculum.json"}}) {
    good({"curriculum", "export", id, "--out", file(id)});
    EXPECT_EQ(*readWholeFile(file(id)), *readWholeFile(sample));
    EXPECT_NE(good({"curriculum", "import", file(id)}).out.find("revision 1"), std::string::npos) << id;
  }
  good({"assign", "tom", exercise});
  const auto assignments = good({"assignments", "--trainee", "tom", "--json"}).rows();
  ASSERT_EQ(assignments.size(), 1u);
  EXPECT_EQ(assignments[0].at("exercise_id"), exercise);
}

TEST_F(AdminApp, aSessionIsShownAndVerified) {
  const std::string id = uuidText(addSession(3));
  const auto shown = good({"session", "show", id, "--json"}).rows()[0];
  EXPECT_EQ(shown.at("state"), "complete");
  EXPECT_EQ(shown.at("samples"), 60);
  EXPECT_EQ(good({"session", "verify", id, "--json"}).rows()[0].at("ok"), true);
}

TEST_F(AdminApp, theSyringesEventsOfASessionAreListed) {
  pb::SyringeEvent event;
  event.set_kind(pb::SyringeEvent::INJECTION);
  event.set_begin_s(12.3);
  event.set_end_s(14.3);
  event.set_plunger_to(0.8);
  event.mutable_begin()->set_in_tissue(true);
  event.mutable_begin()->set_layer(3);
  event.mutable_begin()->set_tissue("BURSA");
  event.mutable_begin()->set_depth_m(0.021);
  *event.mutable_end() = event.begin();
  const Uuid with = addSession(3);
  {
    auto store = test::TestDb::must(Store::open(data(), {}));
    const std::vector<pb::SyringeEvent> events = {event};
    ASSERT_OK(store->writer().run([&](Connection& c) { return EventStore(c).put(with, events); }));
  }
  const std::string words = "injection of 80 % at 12.3 s for 2.0 s, 21 mm deep in BURSA";
  EXPECT_NE(good({"session", "events", uuidText(with)}).out.find(words), std::string::npos);
  const auto rows = good({"session", "events", uuidText(with), "--json"}).rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].at("event"), "INJECTION");
  EXPECT_EQ(rows[0].at("begin").at("tissue"), "BURSA");
  EXPECT_NE(good({"session", "show", uuidText(with)}).out.find(words), std::string::npos);
  EXPECT_EQ(good({"session", "show", uuidText(with), "--json"}).rows()[0].at("events").size(), 1u);

  const std::string without = uuidText(addSession(3, false, "UPDATE sessions SET events = 0"));
  EXPECT_NE(good({"session", "events", without}).err.find("no aspirations"), std::string::npos);
  // An open session is reported as open; its other data are shown as usual.
  const std::string open = uuidText(addSession(3, true));
  const Run refused = onData({"session", "events", open});
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.err.find("still open"), std::string::npos) << refused.err;
  EXPECT_TRUE(good({"session", "show", open, "--json"}).rows()[0].at("events").is_null());
}

TEST_F(AdminApp, damageMakesCheckAndBackupFail) {
  addSession(3, false, "UPDATE chunks SET crc = 1 WHERE seq = 1");
  const Run check = onData({"check", "--json"});
  EXPECT_EQ(check.code, 1);
  EXPECT_EQ(check.rows()[0].at("ok"), false);
  EXPECT_EQ(onData({"check", "--of-copy"}).code, 1);
  EXPECT_EQ(onData({"backup", file("copy.db")}).code, 1);
  EXPECT_FALSE(std::filesystem::exists(file("copy.db")));
}

TEST_F(AdminApp, anUndecodableChunkIsShownAndNamedInTheBackup) {
  const Uuid id = addSession(2, true);
  {
    Bytes bad = test::chunkOf(2);
    bad[16] ^= 1;  // another last tick
    const std::uint32_t crc = crc32c(ByteView(bad).first(bad.size() - 4));
    std::memcpy(bad.data() + bad.size() - 4, &crc, 4);
    auto store = test::TestDb::must(Store::open(data(), {}));
    ASSERT_OK(store->writer().run([&](Connection& c) -> Status {
      const auto appended = SessionStore(c).append(id, 2, bad, "station-1");
      return appended ? Status() : Status(appended.error());
    }));
  }
  const std::string name = uuidText(id);
  EXPECT_EQ(good({"session", "show", name, "--json"}).rows()[0].at("quarantined_chunks"), 1);
  EXPECT_NE(good({"session", "show", name}).out.find("1 of its chunks cannot be decoded"), std::string::npos);
  const Run verify = onData({"session", "verify", name});
  EXPECT_EQ(verify.code, 1);
  EXPECT_NE(verify.err.find("chunk 2"), std::string::npos) << verify.err;
  EXPECT_EQ(onData({"check"}).code, 1);
  const Run of_copy = good({"check", "--of-copy", "--json"});
  EXPECT_EQ(of_copy.rows()[0].at("ok"), true);
  ASSERT_EQ(of_copy.rows()[0].at("notes").size(), 1u);
  EXPECT_NE(of_copy.rows()[0].at("notes")[0].get<std::string>().find("chunk 2"), std::string::npos);
  const Run backup = good({"backup", file("copy.db"), "--json"});
  EXPECT_EQ(backup.rows()[0].at("undecodable_chunks"), 1);
  EXPECT_NE(backup.err.find("cannot be decoded"), std::string::npos) << backup.err;
  EXPECT_TRUE(std::filesystem::exists(file("copy.db")));
}

TEST_F(AdminApp, checkingACopyChangesNothingAndReadsNothingElse) {
  addSession(3);
  good({"user", "add", "tom", "--role", "trainee"});
  good({"person", "erase", "tom", "--confirm", "tom"});
  std::filesystem::remove(folder.path() / "data/pseudonym.key");
  const auto path = folder.path() / "data/needlelab.db";
  const auto before = *readWholeFile(path);
  EXPECT_EQ(good({"check", "--of-copy", "--json"}).rows()[0].at("chunks"), 3);
  EXPECT_EQ(*readWholeFile(path), before);
  EXPECT_EQ(onData({"check"}).code, 1) << "a lab must have the key";
  const Run none = run({"--data", file("none"), "check", "--of-copy"});
  EXPECT_EQ(none.code, 2);
  EXPECT_NE(none.err.find("there is no needlelab.db"), std::string::npos) << none.err;
}

TEST_F(AdminApp, aBackupCountsTheChunksThatItVerified) {
  addSession(3);
  EXPECT_EQ(good({"backup", file("copy.db"), "--json"}).rows()[0].at("chunks_verified"), 3);
}

TEST_F(AdminApp, jsonGoesToAFileWholly) {
  good({"user", "add", "tom", "--role", "trainee"});
  const Run result = good({"user", "list", "--json", file("users.json")});
  EXPECT_TRUE(result.out.empty());
  std::ifstream in(file("users.json"));
  const auto whole = nlohmann::json::parse(in);
  EXPECT_EQ(whole.at("version"), programVersion());
  EXPECT_TRUE(whole.contains("machine"));
  EXPECT_EQ(whole.at("rows")[0].at("name"), "tom");
  EXPECT_EQ(onData({"user", "list", "--json", file("none/users.json")}).code, 2);
}

TEST_F(AdminApp, helpAndVersionAreZero) {
  EXPECT_EQ(run({"--help"}).code, 0);
  EXPECT_EQ(run({"user", "add", "--help"}).code, 0);
  EXPECT_EQ(run({"--version"}).out, "needlelab-admin " + programVersion() + "\n");
}

}  // namespace

}  // namespace needlelab
