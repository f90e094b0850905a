// Commands for classes, courses, studies and whole exports, on a folder and on a running server.
#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "client/admin/backend.h"
#include "client/admin/command.h"
#include "common/base/files/files.h"
#include "db/people/people.h"
#include "tests/unit/client/admin/admin_server.h"

namespace needlelab {
namespace {

class TeachingCommands : public test::AdminServerTest {
 protected:
  void SetUp() override {
    addPerson("ada", "administrator");
    addPerson("mia", "curriculum-manager");
    addPerson("max", "curriculum-manager");
  }
  std::unique_ptr<Backend> client(const std::string& user) const {
    return test::TestDb::must(
        connectServer({{{"127.0.0.1", server_->port()}}, server_->caFile(), user, "correct horse"}));
  }
  /// Runs the command on the server as `user`, or on the folder.
  Run either(bool on_server, const std::string& user, const std::vector<std::string>& arguments) const {
    return on_server ? as(user, arguments) : onData(arguments);
  }
};

TEST_F(TeachingCommands, aWeekOfAManagerOnAFolderAndOnAServer) {
  const auto csv =
      folder.write("class.csv", "name,full_name,group\nanna,Anna A,class-a\nben,Ben B,class-a\n").string();
  const auto bad = folder.write("bad.csv", "name,role\nzoe,\nyan,boss\n").string();
  for (const bool on_server : {false, true}) {
    if (on_server) start();
    const std::string group = on_server ? "g2" : "g1";
    const auto ok = [&](const std::string& user, const std::vector<std::string>& arguments) {
      Run done = either(on_server, user, arguments);
      EXPECT_EQ(done.code, 0) << done.err;
      return done;
    };
    ok("mia", {"user", "import", csv, "--dry-run"});
    ok("mia", {"user", "import", csv});
    const Run faults = either(on_server, "mia", {"user", "import", bad});
    EXPECT_EQ(faults.code, 2);
    EXPECT_NE(faults.out.find("role"), std::string::npos) << faults.out;
    EXPECT_NE(faults.err.find("nothing was changed"), std::string::npos) << faults.err;
    ok("mia", {"user", "change", "anna", "--full-name", "Anna of " + group});
    ok("mia", {"group", "set", group, "--name", "A group"});
    ok("mia", {"group", "join", group, "anna", "ben"});
    ok("mia", {"group", "leave", group, "ben"});
    EXPECT_EQ(either(on_server, "mia", {"group", "leave", group, "ben"}).code, 1);
    EXPECT_EQ(ok("mia", {"group", "show", group, "--json"}).rows()[0].at("names"), "anna");
    ok("mia",
       {"assign", "--group", group, "--course", "rheumatology-basics", "--due", "2026-12-01T18:00+01:00"});
    ok("mia", {"assign", "ben", "knee-recess"});
    const auto assignments = ok("mia", {"assignments", "--json"}).rows();
    ASSERT_EQ(assignments.size(), 2u);
    ok("mia", {"unassign", std::to_string(assignments[0].at("id").get<int>())});
    EXPECT_EQ(either(on_server, "mia", {"unassign", "77"}).code, 1);
    EXPECT_EQ(ok("mia", {"results", "rheumatology-basics", "--json"}).rows().size(), 1u);
    ok("mia", {"assign", "ben", "knee-recess"});
    EXPECT_EQ(ok("mia", {"results", "rheumatology-basics", "--json"}).rows().size(), 2u);
    const Run first = ok("mia", {"results", "rheumatology-basics", "--limit", "1", "--json"});
    EXPECT_EQ(first.rows().size(), 1u);
    EXPECT_NE(first.err.find("the first 1 of 2 trainees"), std::string::npos) << first.err;
    EXPECT_EQ(ok("mia", {"results", "rheumatology-basics", "--trainee", "ben", "--json"}).rows().size(), 1u);
    ok("mia",
       {"unassign", std::to_string(ok("mia", {"assignments", "--json"}).rows()[0].at("id").get<int>())});
    const std::string table = file(group + "-results.csv");
    const Run exported = ok(
        "mia", {"results", "rheumatology-basics", "--trainee", "anna", "--out", table, "--separator", "tab"});
    const std::size_t exercises =
        ok("mia", {"results", "rheumatology-basics", "--trainee", "anna", "--json"}).rows()[0].size() - 2;
    EXPECT_EQ(exported.out, fmt::format("{} rows of 1 people in {}\n", exercises, table));
    const std::string text = *readWholeFile(table);
    EXPECT_EQ(text.find("\xef\xbb\xbfPerson\tFull name\tGroups\tExercise\tVerdict\t"), 0u) << text;
    EXPECT_EQ(static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')), exercises + 1);
    EXPECT_NE(text.find("\r\nanna\tAnna of " + group + "\tclass-a"), std::string::npos) << text;
    EXPECT_EQ(either(on_server, "mia", {"results", "rheumatology-basics", "--out", table}).code, 2)
        << "a file that is there";
    ok("mia", {"results", "rheumatology-basics", "--limit", "1", "--out", table, "--replace"});
    EXPECT_EQ(either(on_server, "mia", {"results", "rheumatology-basics", "--separator", "tab"}).code, 2)
        << "of no file";
    EXPECT_EQ(either(on_server, "mia", {"results", "nothing", "--out", file(group + "-no.csv")}).code, 1);
    EXPECT_FALSE(std::filesystem::exists(file(group + "-no.csv")));
    ok("mia", {"progress", "anna"});
    ok("mia", {"consent", "give", "anna", "--note", "paper 7"});
    ok("mia", {"consent", "withdraw", "anna"});
    EXPECT_EQ(ok("mia", {"consent", "list", "anna", "--json"}).rows().size(), on_server ? 4u : 2u);
    ok("ada", {"study", "export", "s1", "--out", file(group + "-study.jsonl")});
    ok("ada", {"person", "export", "anna", "--out", file(group + "-anna.jsonl")});
    EXPECT_EQ(either(on_server, "ada", {"person", "erase", "ben", "--confirm", "anna"}).code, 2);
    ok("ada", {"person", "erase", "ben", "--confirm", "ben"});
    ok("mia", {"group", "remove", group});
    EXPECT_EQ(ok("mia", {"group", "list", "--json"}).rows().size(), 1u);
    ok("mia", {"group", "remove", "class-a"});
    ok("ada", {"check"});
    stop();
  }
}

TEST_F(TeachingCommands, everythingIsExportedForAdministratorsIntoAFileOfTheOwner) {
  const auto csv = folder.write("class.csv", "name,group\nanna,class-a\nben,class-a\n").string();
  good({"user", "import", csv});
  good({"export-all", "--out", file("all.jsonl"), "--with-passwords"});
  const auto mode = std::filesystem::status(file("all.jsonl")).permissions();
  EXPECT_EQ(mode, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  start();
  EXPECT_EQ(as("ada", {"export-all"}).code, 0);
  EXPECT_EQ(as("mia", {"export-all"}).code, 1) << "for administrators";
}

TEST_F(TeachingCommands, aConflictReachesAClientWithTheNewestRevision) {
  good({"group", "set", "class"});
  start();
  pb::Request put;
  put.mutable_put_group()->mutable_group()->set_id("class");
  put.mutable_put_group()->mutable_group()->set_name("The first");
  put.mutable_put_group()->set_base_revision(1);
  ASSERT_OK(client("mia")->call(put));
  put.mutable_put_group()->mutable_group()->set_name("The second");
  const auto late = client("max")->call(put);
  ASSERT_FALSE(late.ok());
  EXPECT_EQ(late.error().code, ErrorCode::kConflict) << late.error().message;
  EXPECT_EQ(late.error().current_revision, 2u);
}

TEST_F(TeachingCommands, aStudyRecordingIsFoundByPseudonymAndStartsAtZero) {
  const std::string id = uuidText(addSession(3));
  const std::string trainee = good({"session", "show", id, "--json"}).rows()[0].at("trainee");
  good({"user", "add", trainee, "--role", "trainee"});
  good({"session", "assign", id, "--to", trainee, "--reason", "the account came later"});
  good({"consent", "give", trainee, "--note", "paper"});
  good({"study", "export", "s1", "--out", file("study.jsonl")});
  std::string session;
  std::istringstream lines(*readWholeFile(file("study.jsonl")));
  for (std::string line; std::getline(lines, line);) {
    const auto record = nlohmann::json::parse(line);
    if (record.at("kind") == "session") session = record.at("session");
  }
  ASSERT_NE(session, "");
  EXPECT_NE(session, id);
  good({"study", "recording", "s1", session, "--out", file("a.csv")});
  const std::string csv = *readWholeFile(file("a.csv"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 61) << "a head, three chunks of 20 samples";
  EXPECT_NE(csv.find("\n0,0,"), std::string::npos) << csv.substr(0, 400);
  EXPECT_EQ(csv.find(id), std::string::npos);
  const Run unknown = onData({"study", "recording", "s2", session, "--out", file("b.csv")});
  EXPECT_EQ(unknown.code, 1);
  EXPECT_FALSE(std::filesystem::exists(file("b.csv")));
}

TEST(Moments, haveATimeZone) {
  EXPECT_EQ(*momentOf("--due", "1970-01-01T00:00Z"), 0);
  EXPECT_EQ(*momentOf("--due", "2026-12-01T18:00+01:00"), *momentOf("--due", "2026-12-01T17:00Z"));
  EXPECT_EQ(*momentOf("--due", "2026-12-01T18:00:30-03:30"), *momentOf("--due", "2026-12-01T21:30:30Z"));
  EXPECT_EQ(*momentOf("--due", "2024-02-29T00:00Z"), 1'709'164'800'000'000'000);
  for (const char* wrong :
       {"", "tomorrow", "2026-12-01", "2026-12-01T18:00", "2026-12-01T18:00 Z", "2026-02-29T00:00Z",
        "2026-13-01T00:00Z", "2026-12-01T25:00Z", "2026-12-01T18:00+1", "2026-12-01T18:00+15:00",
        "1969-12-31T00:00Z", "9999-01-01T00:00Z"})
    EXPECT_EQ(momentOf("--due", wrong).error().code, ErrorCode::kInvalidInput) << wrong;
}

using RetentionCommands = test::AdminTest;

TEST_F(RetentionCommands, setShowAndRunReportWhatRemains) {
  const std::string id = uuidText(addSession(50));
  EXPECT_NE(good({"retention", "show"}).err.find("kept for ever"), std::string::npos);
  good({"retention", "set", "knee-1", "--thin-after", "0", "--rate", "100", "--coarser", "2",
        "--delete-after", "36500"});
  good({"retention", "set", "--default", "--keep"});
  const auto shown = good({"retention", "show", "--json"}).rows();
  ASSERT_EQ(shown.size(), 2u);
  EXPECT_TRUE(shown[0].at("exercise_id").is_null());
  EXPECT_TRUE(shown[0].at("thin_after_days").is_null());
  EXPECT_EQ(shown[1].at("exercise_id"), "knee-1");
  EXPECT_EQ(shown[1].at("thin_rate_hz"), 100);
  EXPECT_EQ(shown[1].at("thin_coarser"), 2);
  EXPECT_EQ(shown[1].at("delete_after_days"), 36'500);

  // no backup contains it yet
  const auto waits = good({"retention", "run", "--json"}).rows();
  ASSERT_EQ(waits.size(), 1u);
  EXPECT_EQ(waits[0].at("action"), "waits for a backup");
  good({"backup", file("copy.db"), "--counts-as-safe"});
  const Run dry = good({"retention", "run", "--dry-run"});
  EXPECT_NE(dry.out.find("would be: 1 thinned"), std::string::npos) << dry.out;
  EXPECT_EQ(good({"session", "show", id, "--json"}).rows()[0].at("recording"), "original");
  const auto done = good({"retention", "run", "--json"}).rows();
  ASSERT_EQ(done.size(), 1u);
  EXPECT_EQ(done[0].at("action"), "thin");
  EXPECT_LT(done[0].at("bytes_after"), done[0].at("bytes_before"));

  const auto session = good({"session", "show", id, "--json"}).rows()[0];
  EXPECT_EQ(session.at("recording"), "thinned");
  EXPECT_EQ(session.at("removed_original").at("samples"), 1000);
  EXPECT_EQ(session.at("samples"), 101);
  const Run text = good({"session", "show", id});
  EXPECT_NE(text.out.find("the original (1000 samples"), std::string::npos) << text.out;
  const Run exported = good({"session", "export", id, "--out", file("t.csv")});
  EXPECT_NE(exported.err.find("the original had 1000 samples"), std::string::npos) << exported.err;
  std::ifstream in(file("t.csv"));
  EXPECT_EQ(std::count(std::istreambuf_iterator<char>(in), {}, '\n'), 102);

  good({"retention", "set", "knee-1", "--delete-after", "0"});
  EXPECT_EQ(good({"retention", "run", "--json"}).rows()[0].at("action"), "delete");
  EXPECT_EQ(good({"session", "list", "--json"}).rows()[0].at("recording"), "deleted");
  const Run gone = onData({"session", "export", id, "--out", file("u.csv")});
  EXPECT_EQ(gone.code, 1);
  EXPECT_NE(gone.err.find("was deleted on"), std::string::npos) << gone.err;
  EXPECT_NE(good({"session", "verify", id}).out.find("its recording was deleted on"), std::string::npos);
  good({"retention", "set", "knee-1", "--as-default"});
  EXPECT_EQ(good({"retention", "show", "--json"}).rows().size(), 1u);
  EXPECT_EQ(onData({"retention", "set", "knee-1", "--as-default"}).code, 1);
}

TEST_F(RetentionCommands, wrongUsageIsTwo) {
  addSession(1);
  for (const std::vector<std::string>& wrong :
       {std::vector<std::string>{"knee-1"}, std::vector<std::string>{"--keep"},
        std::vector<std::string>{"knee-1", "--default", "--keep"},
        std::vector<std::string>{"knee-1", "--keep", "--delete-after", "3"},
        std::vector<std::string>{"knee-1", "--thin-after", "3"},
        std::vector<std::string>{"knee-1", "--rate", "3"},
        std::vector<std::string>{"knee-1", "--thin-after", "3", "--rate", "-5"},
        std::vector<std::string>{"knee-1", "--delete-after", "3", "--coarser", "2"},
        std::vector<std::string>{"knee-1", "--keep", "--without-backup"}}) {
    std::vector<std::string> all = {"retention", "set"};
    all.insert(all.end(), wrong.begin(), wrong.end());
    const Run run = onData(all);
    EXPECT_EQ(run.code, 2) << run.err;
  }
  EXPECT_TRUE(good({"retention", "show", "--json"}).rows().empty());
}

TEST_F(RetentionCommands, listsAreWholeHoweverLong) {
  {
    auto store = test::TestDb::must(Store::open(data(), {}));
    ASSERT_OK(store->writer().run([](Connection& c) -> Status {
      if (auto added = StationStore(c).add("station-1", StationKeyBytes{}, 1); !added) return added;
      for (int i = 0; i < 3000; ++i) {
        auto d = test::describe(makeUuidV7());
        d.set_started_unix_ns(1 + i);
        d.add_device_notes(std::string(600, 'n'));
        if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
        if (auto noted = AuditStore(c).add({0, i, "who", "action", "subject", std::string(600, 'd')}); !noted)
          return noted;
        if (auto added = PeopleStore(c).add(
                {"person " + std::to_string(i) + std::string(40, 'x'), pb::TRAINEE, "", false, 1});
            !added)
          return added;
      }
      return {};
    }));
  }
  EXPECT_EQ(good({"session", "list", "--limit", "0", "--json"}).rows().size(), 3000u);
  EXPECT_EQ(good({"session", "list", "--limit", "2345", "--json"}).rows().size(), 2345u);
  EXPECT_EQ(good({"session", "list", "--json"}).rows().size(), 100u);
  EXPECT_GE(good({"audit", "--limit", "0", "--json"}).rows().size(), 3000u);
  EXPECT_EQ(good({"audit", "--limit", "1999", "--json"}).rows().size(), 1999u);
  EXPECT_EQ(good({"user", "list", "--json"}).rows().size(), 3000u);
}

}  // namespace

}  // namespace needlelab
