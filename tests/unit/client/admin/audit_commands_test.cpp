// The audit log: its entries, and what `audit verify` reports.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/files/files.h"
#include "db/audit/audit.h"
#include "db/store/connection.h"
#include "tests/support/time_zone.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class AuditCommands : public test::AdminTest {
 protected:
  void SetUp() override { good({"user", "add", "tom", "--role", "trainee"}); }
};

TEST_F(AuditCommands, theAuditLogTellsEachChangeOnceAndNoRefusal) {
  const std::string name = R"(Zoë "Z" O'Neil)";
  good({"user", "add", name, "--role", "trainee"});
  EXPECT_EQ(onData({"user", "add", name, "--role", "trainee"}).code, 1);
  EXPECT_EQ(onData({"user", "add", "x/y", "--role", "trainee"}).code, 2);
  good({"user", "change", name, "--full-name", "Zoë Z"});
  good({"user", "disable", name});
  good({"user", "list"});
  const auto rows = good({"audit", "--json"}).rows();
  std::vector<std::string> actions;
  for (const auto& row : rows) actions.push_back(row.at("action"));
  EXPECT_EQ(actions, (std::vector<std::string>{"user disable", "user change", "user add", "user add"}));
  EXPECT_EQ(rows[0].at("subject"), name);
  EXPECT_EQ(rows[0].at("detail"), "disabled");
  EXPECT_EQ(rows[1].at("detail"), "full name");
  EXPECT_EQ(rows[2].at("detail"), "trainee");
  EXPECT_EQ(rows[3].at("subject"), "tom");
  for (const auto& row : rows)
    EXPECT_THAT(row.at("who").get<std::string>(), testing::StartsWith("local:")) << row;
  EXPECT_EQ(good({"audit", "--limit", "1", "--json"}).rows(), nlohmann::json::array({rows[0]}));
  EXPECT_EQ(good({"audit", "--limit", "0", "--json"}).rows(), rows);
  for (const char* wrong : {"-1", "x"}) EXPECT_EQ(onData({"audit", "--limit", wrong}).code, 2) << wrong;
}

TEST_F(AuditCommands, anAuditEntryStaysOnOneTableRow) {
  {
    auto store = test::TestDb::must(Store::open(data(), {}));
    ASSERT_OK(store->writer().run([](Connection& c) {
      return AuditStore(c).add({0, 1'000'000'000, "who", "action", "two\nlines\x1b[2J", "é\t\"x\""});
    }));
  }
  const test::WithZone zone(test::kStJohns);
  const std::string table = good({"audit", "--limit", "1"}).out;
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 2) << "the head, and the line";
  EXPECT_THAT(table, HasSubstr("1969-12-31 20:30:01 NST  who  action  two lines [2J  é \"x\"\n"));
  const auto row = good({"audit", "--limit", "1", "--json"}).rows().at(0);
  EXPECT_EQ(row.at("subject"), "two\nlines\x1b[2J");
  EXPECT_EQ(row.at("detail"), "é\t\"x\"");
}

TEST_F(AuditCommands, verifyFindsWhatSomebodyWithTheFileDidToTheLog) {
  good({"user", "add", "ida", "--role", "trainee"});
  auto fresh = good({"audit", "verify", "--json"}).rows().at(0);
  EXPECT_EQ(fresh.at("ok"), true);
  EXPECT_EQ(fresh.at("lines"), 2);
  EXPECT_THAT(good({"audit", "verify"}).out, HasSubstr("Nothing is promised about lines that were removed"));
  good({"backup", file("copy.db")});
  // works beside a server, which holds the folder
  {
    const auto server = test::TestDb::must(Store::open(data(), {}));
    EXPECT_EQ(good({"audit", "verify", "--anchor", file("copy.db"), "--json"}).rows().at(0).at("anchored"),
              2);
  }
  // somebody with access to the file removes the last line: the backup still has it
  {
    auto writer =
        test::TestDb::must(Connection::open(data() + "/needlelab.db", {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(
        writer.script("PRAGMA foreign_keys=OFF; DELETE FROM audit_chain WHERE line > 1;"
                      "DELETE FROM audit WHERE id > 1"));
  }
  // audit.head also has the backup's own line
  const Run alone = onData({"audit", "verify"});
  EXPECT_EQ(alone.code, 1);
  EXPECT_THAT(alone.out, HasSubstr("fault: audit.head: the log ends with entry 1, and had 3"));
  const Run found = onData({"audit", "verify", "--anchor", file("copy.db")});
  EXPECT_EQ(found.code, 1);
  EXPECT_THAT(found.out, HasSubstr("fault: " + file("copy.db") + ": the log ends with entry 1, and had 2"));
  folder.write("junk", "no head");
  EXPECT_EQ(onData({"audit", "verify", "--anchor", file("junk")}).code, 2);
  EXPECT_EQ(run({"--server", "localhost:1", "audit", "verify"}).code, 2) << "needs --data";
  fs::remove(data() + "/audit.key");
  EXPECT_THAT(onData({"audit", "verify"}).err, HasSubstr("audit.key: does not exist"));
}

TEST_F(AuditCommands, verifyNamesUnverifiableLinesAndWhatARestoreOmitted) {
  good({"backup", file("copy.db")});
  good({"user", "add", "ida", "--role", "trainee"});
  EXPECT_THAT(good({"audit", "verify"}).out, Not(HasSubstr("note: ")));
  good({"restore", "--from", file("copy.db")});
  // tom's line is in the backup; the lines of the backup and of ida are lost
  EXPECT_THAT(good({"audit", "verify"}).out, HasSubstr("the log had 3 entries until then, and the backup 1"));
  fs::remove(data() + "/audit.head");
  EXPECT_THAT(good({"audit", "verify"}).out, HasSubstr("note: audit.head does not exist"));
  folder.write("data/audit.head", "needlelab audit head 1\n");
  EXPECT_EQ(onData({"audit", "verify"}).code, 1);
}

TEST_F(AuditCommands, eachBreakIsAFaultUntilAcknowledged) {
  good({"user", "add", "ida", "--role", "trainee"});
  const auto cutLast = [&] {
    auto writer =
        test::TestDb::must(Connection::open(data() + "/needlelab.db", {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(
        writer.script("PRAGMA foreign_keys=OFF; CREATE TEMP TABLE newest AS SELECT max(id) AS id FROM audit;"
                      "DELETE FROM audit_chain WHERE line = (SELECT id FROM newest);"
                      "DELETE FROM audit WHERE id = (SELECT id FROM newest)"));
  };
  const Run none = onData({"audit", "acknowledge", "1"});
  EXPECT_EQ(none.code, 2);
  EXPECT_THAT(none.err,
              HasSubstr("line 1 of the audit log is not an \"audit break\" of this log; there is nothing"));
  cutLast();
  const Run found = onData({"audit", "acknowledge", "1"});  // a start finds the break
  EXPECT_EQ(found.code, 2);
  EXPECT_THAT(found.err, HasSubstr("there are: 3"));
  const Run broken = onData({"audit", "verify"});
  EXPECT_EQ(broken.code, 1);
  EXPECT_THAT(broken.out, HasSubstr("fault: line 3: the log had 2 entries"));
  EXPECT_THAT(broken.out, HasSubstr("`audit acknowledge LINE`"));
  {
    const auto server = test::TestDb::must(Store::open(data(), {}));
    EXPECT_EQ(onData({"audit", "acknowledge", "3"}).code, 1) << "a server is running on the folder";
  }
  good({"audit", "acknowledge", "3"});
  const Run sound = good({"audit", "verify"});
  EXPECT_THAT(sound.out, HasSubstr("note: line 3: break of 20"));
  EXPECT_THAT(sound.out, HasSubstr(", acknowledged by local:"));
  EXPECT_THAT(sound.out, Not(HasSubstr("fault: ")));
  const auto row = good({"audit", "verify", "--json"}).rows().at(0);
  ASSERT_EQ(row.at("breaks").size(), 1u);
  EXPECT_EQ(row.at("breaks")[0].at("line"), 3);
  EXPECT_EQ(row.at("breaks")[0].at("acknowledged_by").get<std::string>().rfind("local:", 0), 0u);
  const auto line = good({"audit", "--limit", "1", "--json"}).rows().at(0);
  EXPECT_EQ(line.at("action"), "audit acknowledge");
  EXPECT_EQ(line.at("subject"), "line 3");
  const Run again = onData({"audit", "acknowledge", "3"});
  EXPECT_EQ(again.code, 1);
  EXPECT_THAT(again.err, HasSubstr("acknowledged by local:"));
  // the acknowledgement itself is cut off: that is a new break, and the first one is open again
  cutLast();
  EXPECT_EQ(onData({"audit", "acknowledge", "1"}).code, 2);
  EXPECT_THAT(onData({"audit", "verify"}).out, HasSubstr("fault: line 3: the log had 2 entries"));
  good({"audit", "acknowledge", "3"});
  const Run next = onData({"audit", "verify"});
  EXPECT_EQ(next.code, 1);
  EXPECT_THAT(next.out, HasSubstr("note: line 3: break of 20"));
  EXPECT_THAT(next.out, HasSubstr("fault: line 5: the log had 3 entries"));
  for (const char* wrong : {"0", "-1", "x"})
    EXPECT_EQ(onData({"audit", "acknowledge", wrong}).code, 2) << wrong;
  EXPECT_EQ(run({"--server", "localhost:1", "audit", "acknowledge", "3"}).code, 2) << "needs --data";
}

TEST_F(AuditCommands, verifyUsesTheNewestBackupOrAFolderAsAnchor) {
  fs::create_directory(file("kept"));
  const std::string backup = good({"backup", "--dir", file("kept"), "--json"}).rows().at(0).at("path");
  good({"user", "add", "ida", "--role", "trainee"});
  EXPECT_EQ(good({"audit", "verify", "--json"}).rows().at(0).at("anchored"), 1);
  EXPECT_EQ(good({"audit", "verify", "--anchor", file("kept"), "--json"}).rows().at(0).at("anchored"), 1);
  // somebody who can write the whole folder removes the chain and audit.head: the next start creates both
  // again
  {
    auto writer =
        test::TestDb::must(Connection::open(data() + "/needlelab.db", {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(writer.script("PRAGMA foreign_keys=OFF; DELETE FROM audit_chain; DELETE FROM audit"));
  }
  fs::remove(data() + "/audit.head");
  good({"user", "add", "zoe", "--role", "trainee"});
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{}, {"--anchor", file("kept")}, {"--anchor", backup}}) {
    std::vector<std::string> arguments = {"audit", "verify"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Run found = onData(arguments);
    EXPECT_EQ(found.code, 1);
    EXPECT_THAT(found.out, HasSubstr("fault: " + backup + ": this chain begins after it"));
  }
  fs::remove(backup);
  const Run without = good({"audit", "verify"});
  EXPECT_THAT(without.out, HasSubstr("note: the newest backup is not an anchor here: " + backup));
  EXPECT_EQ(onData({"audit", "verify", "--anchor", file("kept")}).code, 2);
}

}  // namespace
}  // namespace needlelab
