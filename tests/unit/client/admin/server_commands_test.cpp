// The commands on a running server.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/unit/client/admin/admin_server.h"

namespace needlelab {
namespace {

class ServerCommands : public test::AdminServerTest {
 protected:
  void SetUp() override {
    addPerson("ada", "administrator");
    addPerson("ines", "instructor");
    addPerson("tom", "trainee");
    session_ = addSession(40);
    start();
  }
  Uuid session_{};
};

TEST_F(ServerCommands, theSameCommandsWork) {
  const Run users = as("ada", {"user", "list", "--json"});
  EXPECT_EQ(users.code, 0) << users.err;
  EXPECT_EQ(users.rows().size(), 3u);
  EXPECT_EQ(as("ada", {"station", "add", "lab 2", "--out", file("lab2.key")}).code, 0);
  const auto stations = as("ines", {"station", "list", "--json"}).rows();
  ASSERT_EQ(stations.size(), 2u);
  EXPECT_EQ(stations[0].at("online"), false);
  EXPECT_EQ(as("ada", {"check"}).code, 0);
  EXPECT_EQ(as("ada", {"backup", file("copy.db")}).code, 0);
  EXPECT_TRUE(std::filesystem::exists(file("copy.db")));
  EXPECT_EQ(as("ada", {"backup", "relative.db"}).code, 2);
  EXPECT_EQ(as("ada", {"profile", "import", NEEDLELAB_SAMPLES "/knee-adult.json"}).code, 0);
  const auto id = uuidText(session_);
  EXPECT_EQ(as("ines", {"session", "verify", id}).code, 0);
  EXPECT_EQ(as("ines", {"annotate", id, "--text", "well done"}).code, 0);
  const Run exported = as("ines", {"session", "export", id, "--every-tick", "--out", file("g.csv")});
  EXPECT_EQ(exported.code, 0) << exported.err;
  std::ifstream in(file("g.csv"));
  EXPECT_EQ(std::count(std::istreambuf_iterator<char>(in), {}, '\n'), 40 * 20 + 1);
}

TEST_F(ServerCommands, ofSeveralServersTheFirstThatAnswersIsAsked) {
  const std::string there = address_;
  address_ = "127.0.0.1:1," + there;
  const Run users = as("ada", {"user", "list", "--json"});
  EXPECT_EQ(users.code, 0) << users.err;
  EXPECT_EQ(users.rows().size(), 3u);
  address_ = "127.0.0.1:1,127.0.0.1:2";
  const Run away = as("ada", {"user", "list"});
  EXPECT_EQ(away.code, 1);
  EXPECT_NE(away.err.find("127.0.0.1:2: "), std::string::npos) << away.err;
  address_ = there + "," + there;
  EXPECT_EQ(as("ada", {"user", "list"}).code, 2);
}

TEST_F(ServerCommands, partsAreExportedAndRetentionRuns) {
  const auto id = uuidText(session_);
  const Run part = as("ines", {"session", "export", id, "--every-tick", "--from", "0.4", "--to", "0.5",
                               "--out", file("p.csv")});
  EXPECT_EQ(part.code, 0) << part.err;
  std::ifstream in(file("p.csv"));
  EXPECT_EQ(std::count(std::istreambuf_iterator<char>(in), {}, '\n'), 100 + 1);
  EXPECT_EQ(as("ada", {"backup", file("copy.db"), "--counts-as-safe"}).code, 0);
  EXPECT_EQ(as("ada", {"retention", "set", "--default", "--thin-after", "0", "--rate", "50"}).code, 0);
  const Run done = as("ada", {"retention", "run"});
  EXPECT_EQ(done.code, 0) << done.err;
  EXPECT_NE(done.out.find("1 thinned"), std::string::npos) << done.out;
  EXPECT_EQ(as("ines", {"session", "verify", id}).code, 0);
  EXPECT_EQ(as("ada", {"check"}).code, 0);
  EXPECT_EQ(as("ines", {"session", "export", id, "--from", "0.4", "--out", file("p.csv"), "--replace"}).code,
            0);
}

TEST_F(ServerCommands, aNewUsersPasswordIsApartFromOnesOwn) {
  const auto fresh = folder.write("pw2", "another horse").string();
  const Run added =
      as("ada", {"user", "add", "mia", "--role", "curriculum-manager", "--password-file", fresh});
  EXPECT_EQ(added.code, 0) << added.err;
  password_ = fresh;
  EXPECT_EQ(as("mia", {"profile", "list"}).code, 0);
  EXPECT_EQ(as("ada", {"profile", "list"}).code, 1);
  // If only one file is given, it is the password for the log-in.
  password_ = file("pw");
  EXPECT_EQ(run({"--server", address_, "--ca", ca_, "--user", "ada", "user", "add", "new one", "--role",
                 "trainee", "--password-file", password_})
                .code,
            0);
  EXPECT_EQ(as("ada", {"user", "list", "--json"}).rows()[3].at("has_password"), false);
}

TEST_F(ServerCommands, theOwnPasswordIsChangedWithTheOneOfTheLogIn) {
  const auto fresh = folder.write("pw3", "a third horse").string();
  const Run changed = as("ines", {"user", "passwd", "ines", "--new-password-file", fresh});
  EXPECT_EQ(changed.code, 0) << changed.err;
  EXPECT_EQ(as("ines", {"profile", "list"}).code, 1);
  password_ = fresh;
  EXPECT_EQ(as("ines", {"profile", "list"}).code, 0);
}

TEST_F(ServerCommands, rolesAreTheServersAffair) {
  const Run refused = as("tom", {"user", "list"});
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.err.find("trainee"), std::string::npos) << refused.err;
}

TEST_F(ServerCommands, wrongPasswordWrongCaAndNoServerExitWithOne) {
  password_ = folder.write("wrong", "wrong horse").string();
  const Run wrong = as("ada", {"user", "list"});
  EXPECT_EQ(wrong.code, 1);
  EXPECT_EQ(std::count(wrong.err.begin(), wrong.err.end(), '\n'), 1) << wrong.err;
  EXPECT_EQ(as("nobody", {"user", "list"}).code, 1);
  password_ = file("pw");
  EXPECT_EQ(onData({"user", "list"}).code, 1) << "the folder is the server's";
  stop();
  EXPECT_EQ(as("ada", {"user", "list"}).code, 1);
}

}  // namespace
}  // namespace needlelab
