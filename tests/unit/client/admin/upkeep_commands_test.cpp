// Commands for backups, restores and certificates.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>

#include "common/base/files/files.h"
#include "tests/support/store/backup_start.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;
using Arguments = std::vector<std::string>;

class UpkeepCommands : public test::AdminTest {
 protected:
  void SetUp() override { good({"user", "add", "tom", "--role", "trainee"}); }
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& row : good({"user", "list", "--json"}).rows()) all.push_back(row.at("name"));
    return all;
  }
  // not whole rows: the remaining days change over time
  static std::vector<std::string> fingerprints(const nlohmann::json& rows) {
    std::vector<std::string> all;
    for (const auto& row : rows) all.push_back(row.at("sha256"));
    return all;
  }
  std::vector<std::string> filesIn(const std::string& name) const {
    std::vector<std::string> all;
    for (const auto& entry : fs::directory_iterator(file(name))) all.push_back(entry.path().filename());
    std::sort(all.begin(), all.end());
    return all;
  }
};

TEST_F(UpkeepCommands, aBackupOverwritesNothingAndWrongUseMakesNone) {
  good({"backup", file("copy.db")});
  const std::string before = *readWholeFile(file("copy.db"));
  const std::tuple<Arguments, int, std::string> cases[] = {
      {{file("copy.db")}, 1, "copy.db: is there already; a backup never overwrites a file"},
      {{file("none/copy.db")}, 2, "its folder does not exist"},
      {{"--dir", file("none")}, 2, "its folder does not exist"},
      {{}, 2, "backup: give FILE, or --dir DIR [--keep N]"},
      {{file("new.db"), "--dir", folder.path().string()}, 2, "excludes"},
      {{file("new.db"), "--keep", "3"}, 2, "--keep requires --dir"},
      {{"--dir", folder.path().string(), "--keep", "0"}, 2, "--keep: Value 0 not in range 1 to 100000"},
  };
  for (const auto& [arguments, code, words] : cases) {
    Arguments all = {"backup"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Run result = onData(all);
    EXPECT_EQ(result.code, code) << words;
    EXPECT_THAT(result.err, HasSubstr(words));
  }
  EXPECT_EQ(*readWholeFile(file("copy.db")), before);
  EXPECT_EQ(filesIn("."), (std::vector<std::string>{"copy.db", "data"}));
}

TEST_F(UpkeepCommands, aBackupReportsWhetherStationsMayDropItsData) {
  const auto beside = good({"backup", file("beside.db"), "--json"}).rows().at(0);
  EXPECT_EQ(beside.at("safe"), false) << "it lies on the disk of the database";
  EXPECT_NE(beside.at("disk"), "ANOTHER_DISK");
  EXPECT_THAT(beside.at("place").get<std::string>(), HasSubstr("not Safe, stations keep"));
  const auto asked = good({"backup", file("asked.db"), "--counts-as-safe", "--json"}).rows().at(0);
  EXPECT_EQ(asked.at("safe"), true);
  EXPECT_EQ(asked.at("disk"), beside.at("disk"));
  EXPECT_THAT(asked.at("place").get<std::string>(), HasSubstr("stations let it go"));
}

TEST_F(UpkeepCommands, aBackupFolderKeepsTheNewestAndForeignFiles) {
  fs::create_directory(file("kept"));
  for (const char* name : {"needlelab-20200101T000000Z.db", "needlelab-20210101T000000Z.db",
                           "needlelab-20220101T000000Z.db", "mine.db"})
    folder.write(std::string("kept/") + name, test::startOfBackup(name));
  const auto row = good({"backup", "--dir", file("kept"), "--keep", "2", "--json"}).rows().at(0);
  EXPECT_EQ(row.at("removed"), (nlohmann::json{file("kept/needlelab-20200101T000000Z.db"),
                                               file("kept/needlelab-20210101T000000Z.db")}));
  const fs::path made = row.at("path").get<std::string>();
  EXPECT_EQ(filesIn("kept"),
            (std::vector<std::string>{"mine.db", "needlelab-20220101T000000Z.db", made.filename().string()}));
  EXPECT_EQ(row.at("bytes"), fs::file_size(made));
}

TEST_F(UpkeepCommands, aRestoreBringsBackPeopleAndNamesRestoredAccess) {
  const auto password = folder.write("pw", "correct horse").string();
  good({"user", "add", "ines", "--role", "instructor", "--password-file", password});
  good({"station", "add", "lab 1", "--out", file("lab1.key")});
  good({"backup", file("copy.db")});
  good({"user", "disable", "ines"});
  good({"station", "revoke", "lab 1"});
  good({"user", "add", "late", "--role", "trainee"});
  const Run restored = good({"restore", "--from", file("copy.db")});
  EXPECT_EQ(names(), (std::vector<std::string>{"ines", "tom"}));
  EXPECT_EQ(good({"station", "list", "--json"}).rows()[0].at("revoked"), false);
  EXPECT_THAT(restored.out, HasSubstr("Start the server"));
  EXPECT_THAT(restored.out, HasSubstr("\nvalid again: user ines: was disabled\n"));
  EXPECT_THAT(restored.out, HasSubstr("\nvalid again: station lab 1: its key was revoked\n"));
  EXPECT_THAT(restored.out, HasSubstr("Withdraw them again before anybody connects"));
  EXPECT_EQ(good({"audit", "--limit", "1", "--json"}).rows().at(0).at("action"), "restore");
}

TEST_F(UpkeepCommands, anEncryptedBackupIsMadeByAKeyAndRestoredByIt) {
  const Run key = run({"backup-key", "new", file("backup.key")});
  EXPECT_EQ(key.code, 0) << key.err;
  EXPECT_THAT(key.out, HasSubstr("apart from the server and from the backups"));
  EXPECT_THAT(key.out, Not(HasSubstr(readWholeFile(file("backup.key"))->substr(0, 64))));
  EXPECT_EQ(run({"backup-key", "new", file("backup.key")}).code, 1) << "never overwritten";
  EXPECT_EQ(run({"backup-key"}).code, 2);

  const auto made =
      good({"backup", file("copy"), "--encrypt-with", file("backup.key"), "--json"}).rows().at(0);
  EXPECT_EQ(made.at("encrypted"), true);
  EXPECT_EQ(made.at("path"), file("copy.nlbk"));
  EXPECT_THAT(good({"audit", "--limit", "1", "--json"}).rows().at(0).at("detail").get<std::string>(),
              HasSubstr("encrypted with the key "));
  const Run without = onData({"backup", file("plain.nlbk")});
  EXPECT_EQ(without.code, 2);
  EXPECT_THAT(without.err, HasSubstr("there is no key"));
  const Run remote = run({"--server", "localhost:1", "--ca", file("none"), "--user", "ada", "backup", "/x.db",
                          "--encrypt-with", file("backup.key")});
  EXPECT_EQ(remote.code, 2);
  EXPECT_THAT(remote.err, HasSubstr("the key never crosses the network"));

  good({"user", "add", "late", "--role", "trainee"});
  const Run no_key = onData({"restore", "--from", file("copy.nlbk")});
  EXPECT_EQ(no_key.code, 2);
  EXPECT_THAT(no_key.err, HasSubstr("--key FILE"));
  EXPECT_EQ(names(), (std::vector<std::string>{"late", "tom"}));
  good({"restore", "--from", file("copy.nlbk"), "--key", file("backup.key")});
  EXPECT_EQ(names(), std::vector<std::string>{"tom"});
}

TEST_F(UpkeepCommands, whatIsNoBackupRestoresNothing) {
  folder.write("junk.db", "this is not a database");
  fs::create_directory(file("folder.db"));
  for (const auto& [name, code] : {std::pair("none.db", 2), {"junk.db", 1}, {"folder.db", 2}}) {
    const Run result = onData({"restore", "--from", file(name)});
    EXPECT_EQ(result.code, code) << name << result.err;
    EXPECT_THAT(result.err, HasSubstr(file(name)));
    EXPECT_THAT(result.err, Not(HasSubstr("restoring"))) << "the copy is gone when somebody reads this";
    EXPECT_EQ(result.out, "") << name;
    EXPECT_EQ(names(), std::vector<std::string>{"tom"}) << name;
  }
  EXPECT_EQ(onData({"restore"}).code, 2);
  EXPECT_EQ(run({"--server", "localhost:1", "restore", "--from", file("junk.db")}).code, 2) << "needs --data";
  EXPECT_EQ(names(), std::vector<std::string>{"tom"});
  for (const auto& name : filesIn("data")) EXPECT_THAT(name, Not(HasSubstr("replaced")));
}

TEST_F(UpkeepCommands, aRenewedCertificateKeepsItsNamesAndABadNameChangesNothing) {
  const Run before_any = onData({"certificate", "show"});
  EXPECT_EQ(before_any.code, 2);
  EXPECT_THAT(before_any.err, HasSubstr("tls/ca.crt: cannot open"));
  EXPECT_FALSE(fs::exists(data() + "/tls"));
  good({"station", "enrol", "s", "--server-name", "lab.example.org", "--out", file("s.enrol")});
  const auto first = good({"certificate", "show", "--json"}).rows();
  ASSERT_EQ(first.size(), 2u);
  EXPECT_EQ(first[0].at("what"), "authority");
  EXPECT_EQ(first[1].at("hosts"), "lab.example.org");
  EXPECT_EQ(first[1].at("sha256").get<std::string>().size(), 64u);
  const Run bad = onData({"certificate", "renew", "--host-name", "two words"});
  EXPECT_EQ(bad.code, 2);
  EXPECT_THAT(bad.err, HasSubstr("'two words' is not a host name or IP address"));
  EXPECT_EQ(good({"certificate", "show", "--json"}).rows()[1].at("sha256"), first[1].at("sha256"));
  EXPECT_THAT(good({"certificate", "renew", "--host-name", "10.0.0.7"}).out,
              HasSubstr("a new certificate for "));
  const auto second = good({"certificate", "show", "--json"}).rows();
  EXPECT_EQ(second[0].at("sha256"), first[0].at("sha256")) << "stations trust the earlier authority";
  EXPECT_NE(second[1].at("sha256"), first[1].at("sha256"));
  EXPECT_THAT(second[1].at("hosts").get<std::string>(), HasSubstr("lab.example.org"));
  EXPECT_THAT(second[1].at("hosts").get<std::string>(), HasSubstr("10.0.0.7"));
  good({"certificate", "renew", "--host-name", "one.lab.example.org,10.0.0.8"});
  EXPECT_THAT(good({"certificate", "show", "--json"}).rows()[1].at("hosts").get<std::string>(),
              testing::AllOf(HasSubstr("one.lab.example.org"), HasSubstr("10.0.0.8")));
  // each name once, in any form
  good({"certificate", "renew", "--host-name", "10.0.0.7", "--host-name", "LAB.example.org", "--host-name",
        "::1", "--host-name", "0:0:0:0:0:0:0:1", "--host-name", "two.lab.example.org", "--host-name",
        "two.lab.example.org"});
  const std::string hosts = good({"certificate", "show", "--json"}).rows()[1].at("hosts");
  EXPECT_EQ(hosts, "10.0.0.7, LAB.example.org, ::1, two.lab.example.org, one.lab.example.org, 10.0.0.8");
  const Run on_server = run({"--server", "localhost:1", "certificate", "show"});
  EXPECT_EQ(on_server.code, 2);
  EXPECT_THAT(on_server.err, HasSubstr("give --data DIR, on its machine"));
}

TEST_F(UpkeepCommands, aNameThatTheAuthorityMayNotSignComesWithTheNextOne) {
  good({"station", "enrol", "s", "--server-name", "localhost", "--out", file("s.enrol")});
  const auto hostsNow = [&] { return good({"certificate", "show", "--json"}).rows().back().at("hosts"); };
  EXPECT_EQ(good({"certificate", "show", "--json"}).rows()[0].at("hosts"),
            "localhost, private addresses and those that it was made for");
  EXPECT_THAT(good({"certificate", "renew", "--host-name", "lab.example.org,desk"}).out,
              HasSubstr("`certificate authority switch --host-name lab.example.org,desk`"));
  EXPECT_EQ(hostsNow(), "localhost") << "stations that lack the new ca.crt come as before";
  good({"certificate", "authority", "switch", "--host-name", "lab.example.org,desk"});
  EXPECT_EQ(hostsNow(), "localhost, lab.example.org, desk");
  good({"certificate", "authority", "drop"});
  EXPECT_THAT(good({"certificate", "renew", "--host-name", "lab.example.org"}).out,
              HasSubstr("a new certificate"));
}

TEST_F(UpkeepCommands, aNewAuthorityFollowsInThreeStepsAndTheKeyMayMove) {
  good({"station", "enrol", "s", "--server-name", "lab.example.org", "--out", file("s.enrol")});
  const auto old = good({"certificate", "show", "--json"}).rows();
  const Run early = onData({"certificate", "authority", "switch"});
  EXPECT_EQ(early.code, 2);
  EXPECT_THAT(early.err, HasSubstr("`certificate authority prepare` first"));
  for (const char* bad : {"org", "a b", ""})
    EXPECT_EQ(onData({"certificate", "authority", "prepare", "--domain", bad}).code, 2) << bad;
  EXPECT_EQ(fingerprints(good({"certificate", "show", "--json"}).rows()), fingerprints(old))
      << "nothing changed";
  EXPECT_THAT(good({"certificate", "authority", "prepare", "--domain", "example.org"}).out,
              HasSubstr("Bring this file to every station"));
  const auto both = good({"certificate", "show", "--json"}).rows();
  ASSERT_EQ(both.size(), 3u) << "two authorities and the server";
  EXPECT_EQ(fingerprints(both),
            (std::vector<std::string>{old[0].at("sha256"), both[1].at("sha256"), old[1].at("sha256")}));
  EXPECT_EQ(both[1].at("hosts"), "localhost, example.org, private addresses and those that it was made for");
  good({"certificate", "authority", "switch"});
  good({"certificate", "authority", "drop"});
  const auto now = good({"certificate", "show", "--json"}).rows();
  ASSERT_EQ(now.size(), 2u);
  EXPECT_EQ(now[0].at("sha256"), both[1].at("sha256"));
  EXPECT_EQ(now[0].at("hosts"), both[1].at("hosts"));
  EXPECT_NE(now[1].at("sha256"), old[1].at("sha256"));
  const std::string elsewhere = file("safe.key");
  good({"certificate", "move-key", elsewhere});
  EXPECT_FALSE(fs::exists(data() + "/tls/ca.key"));
  EXPECT_EQ(fs::status(elsewhere).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_EQ(onData({"certificate", "renew"}).code, 2) << "the key is away";
  fs::copy_file(elsewhere, data() + "/tls/ca.key");
  good({"certificate", "renew", "--host-name", "desk.example.org"});
}

TEST_F(UpkeepCommands, theNextCertificateCommandRemovesTheKeyThatAKilledOneLeft) {
  good({"station", "enrol", "s", "--server-name", "lab.example.org", "--out", file("s.enrol")});
  const std::string kept = data() + "/tls/ca.key.backup",
                    left = data() + "/tls/ca-next.key.being-written-aB3dE9";
  std::ofstream(kept) << "kept";
  const std::vector<std::vector<std::string>> commands = {{"authority", "prepare", "--domain", "example.org"},
                                                          {"authority", "switch"},
                                                          {"authority", "drop"},
                                                          {"renew"},
                                                          {"move-key", file("safe.key")}};
  for (const auto& command : commands) {
    std::ofstream(left) << "half a key";
    std::vector<std::string> arguments = {"certificate"};
    arguments.insert(arguments.end(), command.begin(), command.end());
    const Run done = good(arguments);
    EXPECT_FALSE(fs::exists(left)) << command[0];
    EXPECT_THAT(done.err, HasSubstr("removed " + left + ", which a program that was cut off left"));
    EXPECT_TRUE(fs::exists(kept));
  }
  std::ofstream(left) << "half a key";
  good({"certificate", "show"});
  EXPECT_TRUE(fs::exists(left)) << "showing changes nothing";
}

TEST_F(UpkeepCommands, theLabRequiresCodesUntilItDoesNot) {
  EXPECT_THAT(good({"lab", "show"}).out, HasSubstr("optional"));
  EXPECT_THAT(good({"lab", "set", "--codes", "required"}).out, HasSubstr("required"));
  EXPECT_EQ(good({"lab", "show", "--json"}).rows().at(0).at("codes"), "required");
  EXPECT_EQ(onData({"lab", "set", "--codes", "perhaps"}).code, 2);
  EXPECT_EQ(onData({"lab", "set"}).code, 2);
  EXPECT_EQ(good({"lab", "show", "--json"}).rows().at(0).at("codes"), "required");
  good({"lab", "set", "--codes", "optional"});
  EXPECT_EQ(good({"lab", "show", "--json"}).rows().at(0).at("codes"), "optional");
}

}  // namespace

}  // namespace needlelab
