// A lesson with all programs: no output and no file contains a key, a password or a token.
#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files/files.h"
#include "db/engine/open_postgres.h"
#include "db/store/connection.h"
#include "tests/integration/lab.h"
#include "tests/support/patience.h"
#include "tests/support/store/postgres_database.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

std::string readProc(pid_t pid, const char* what) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/" + what, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string hexOf(const std::string& bytes) {
  std::string hex;
  for (const char c : bytes) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    hex += kDigits[static_cast<unsigned char>(c) >> 4];
    hex += kDigits[static_cast<unsigned char>(c) & 15];
  }
  return hex;
}

/// A secret in all forms that a program could write by mistake. Raw bytes can be escaped, so eight of them in
/// hexadecimal, with and without \x, count as a leak.
std::vector<std::string> formsOf(const std::string& secret) {
  std::string escaped;
  for (const char c : secret) escaped += "\\x" + hexOf(std::string(1, c));
  const std::string hex = hexOf(secret);
  std::string upper = hex;
  std::transform(upper.begin(), upper.end(), upper.begin(),
                 [](char c) { return static_cast<char>(std::toupper(c)); });
  return {secret, hex, hex.substr(0, 16), upper.substr(0, 16), escaped.substr(0, 32)};
}

// Each program sets this limit in its first milliseconds. Not 0: that would not prevent a dump to a pipe.
bool writesNoCore(pid_t pid) {
  return readProc(pid, "limits").find("Max core file size        1                    1 ") !=
         std::string::npos;
}

/// A PostgreSQL database with a password (tests/postgres/cluster), and the file that contains it.
class StoreWithPassword {
 public:
  static constexpr const char* kPassword = "Planted-8-Lebkuchen";

  StoreWithPassword() {
    folder_.write("db.password", std::string("*:*:*:by_password:") + kPassword + "\n");
    const std::string file = folder_.path() / "db.password";
    if (::chmod(file.c_str(), 0600) != 0) throw std::runtime_error("chmod");
    run("DROP DATABASE IF EXISTS by_password WITH (FORCE)");
    run("DROP ROLE IF EXISTS by_password");
    run(std::string("CREATE ROLE by_password LOGIN PASSWORD '") + kPassword + "'");
    run("CREATE DATABASE by_password OWNER by_password");
    ::setenv("PGPASSFILE", file.c_str(), 1);
  }
  ~StoreWithPassword() {
    ::unsetenv("PGPASSFILE");
    run("DROP DATABASE by_password WITH (FORCE)");
    run("DROP ROLE by_password");
  }
  StoreWithPassword(const StoreWithPassword&) = delete;
  StoreWithPassword& operator=(const StoreWithPassword&) = delete;

  // if a keyword has several values, libpq takes the last
  /// From now on programs use another password, which PostgreSQL refuses.
  void usePassword(const std::string& other) const {
    folder_.write("db.password", "*:*:*:by_password:" + other + "\n");
  }
  [[nodiscard]] std::string url() const { return url_ + " user=by_password dbname=by_password"; }
  [[nodiscard]] static std::string logOfPostgres() {
    const std::string at = std::getenv("NEEDLELAB_TEST_POSTGRES");
    const std::size_t begin = at.find("host=") + 5;
    const auto text = readWholeFile(fs::path(at.substr(begin, at.find(' ', begin) - begin)) / "log");
    if (!text) throw std::runtime_error(text.error().message);
    return *text;
  }
  /// Writes everything in the database as text to `file`.
  void dump(const fs::path& file) const {
    Process dumped("/usr/lib/postgresql/15/bin/pg_dump", {"--dbname", url(), "--no-password"}, file);
    ASSERT_EQ(dumped.wait(), 0) << dumped.said();
  }

 private:
  void run(const std::string& sql) {
    auto engine = openPostgres({.url = url_});
    if (!engine) throw std::runtime_error(engine.error().message);
    Connection connection(std::move(*engine), "");
    if (auto done = connection.script(sql); !done) throw std::runtime_error(done.error().message);
  }

  TempFolder folder_;
  PostgresBelow dropped_at_end_{folder_.path()};
  const std::string url_ = postgresUrlOf(folder_.path());
};

class Secrets : public testing::Test {
 protected:
  void look(const std::string& where, const std::string& text) {
    ++looked_;
    for (const auto& [name, secret] : secrets_)
      for (const std::string& form : formsOf(secret))
        EXPECT_EQ(text.find(form), std::string::npos) << name << " stands in " << where;
  }
  void lookAtProcess(const std::string& name, pid_t pid) {
    const std::string arguments = readProc(pid, "cmdline");
    ASSERT_FALSE(arguments.empty()) << name << " is gone already";
    look(name + ": /proc/PID/cmdline", arguments);
    look(name + ": /proc/PID/environ", readProc(pid, "environ"));
    EXPECT_TRUE(writesNoCore(pid)) << name;
  }

  /// The database on PostgreSQL, if the test uses one.
  std::optional<StoreWithPassword> store_;
  std::map<std::string, std::string> secrets_;
  int looked_ = 0;
};

TEST_F(Secrets, appearInNoLogArgumentEnvironmentOrSharedFile) {
  if (onPostgres()) {
    store_.emplace();
    secrets_["password of PostgreSQL"] = StoreWithPassword::kPassword;
  }
  Lab lab(store_ ? store_->url() : "");
  const auto planted = [&](const std::string& name, const std::string& text) {
    const auto file = lab.path(name + ".password");
    EXPECT_TRUE(writeFileAtomically(file, viewOf(text + "\n"), 0600).ok());
    secrets_[name] = text;
    return file;
  };
  const auto chief = planted("chief", "Planted-1-Quittenbaum"),
             other = planted("changed", "Planted-2-Zimtstern");
  const auto wrong = planted("wrong", "Planted-3-Holzweg");
  ASSERT_EQ(lab.admin({"user", "add", "chief", "--role", "administrator", "--password-file", chief}), 0);
  auto key_line = readWholeFile(lab.path("station.key"));
  ASSERT_TRUE(key_line.ok());
  const std::string hex = key_line->substr(key_line->find(':') + 1, 64);
  std::string key;
  for (std::size_t i = 0; i < hex.size(); i += 2)
    key += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  secrets_["key"] = key;

  // The server logs at the most detailed level.
  const auto startServer = [&](int port) {
    std::vector<std::string> arguments = {
        "--data",      lab.path("data"), "--listen",    "127.0.0.1:" + std::to_string(port),
        "--port-file", lab.path("port"), "--log-level", "debug"};
    if (store_) arguments.insert(arguments.end(), {"--store", store_->url()});
    return std::make_unique<Process>("needlelab-server", arguments, lab.path("server.log"));
  };
  auto server = startServer(0);
  const auto port = portOf(*server, lab.path("port"));
  ASSERT_TRUE(port.ok()) << port.error().message;
  lookAtProcess("server", server->pid());
  const std::string address = "127.0.0.1:" + std::to_string(*port);
  const fs::path ca = lab.path("data") / "tls" / "ca.crt";

  // a token, which exists only in memory
  ClientConfig config;
  config.connect_timeout = kPatience;
  config.server.port = *port;
  config.ca_file = ca;
  config.program = programText("test");
  config.login = personLogin("chief", secrets_["chief"]);
  auto client = BlockingClient::connect(config);
  ASSERT_TRUE(client.ok()) << client.error().message;
  secrets_["token"] = client->welcome().token();
  ASSERT_EQ(secrets_["token"].size(), 32u);

  const auto remote = [&](const std::string& name, const fs::path& password,
                          std::vector<std::string> arguments) {
    std::vector<std::string> all = {"--server", address,           "--ca",  ca, "--user",
                                    "chief",    "--password-file", password};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return std::make_unique<Process>("needlelab-admin", all, lab.path(name + ".log"));
  };
  // Wrong passwords, keys and tokens are secrets, too: often they are valid elsewhere.
  EXPECT_NE(remote("wrong", wrong, {"user", "list"})->wait(), 0);
  // a password typed where the name belongs, by a person and at a station
  secrets_["typed as a name"] = "Planted-7-typed";
  config.login = personLogin(secrets_["typed as a name"], "whatever it is");
  EXPECT_FALSE(BlockingClient::connect(config).ok());
  config.login = stationLogin(secrets_["typed as a name"], "Planted-4-" + std::string(22, 'k'));
  EXPECT_FALSE(BlockingClient::connect(config).ok());
  config.login = stationLogin("station-1", "Planted-4-" + std::string(22, 'k'));
  secrets_["wrong key"] = "Planted-4-" + std::string(22, 'k');
  EXPECT_FALSE(BlockingClient::connect(config).ok());
  config.login = pb::Login();
  config.login.set_token("Planted-5-" + std::string(22, 't'));
  secrets_["wrong token"] = "Planted-5-" + std::string(22, 't');
  EXPECT_FALSE(BlockingClient::connect(config).ok());
  EXPECT_EQ(
      remote("add", chief, {"user", "add", "bert", "--role", "instructor", "--new-password-file", other})
          ->wait(),
      0);
  const auto badge = planted("badge", "Planted-6-Badge");
  for (const char* name : {"bert", "tom"})
    EXPECT_EQ(remote("code", chief, {"user", "code", name, "--code-file", badge})->wait(), 0);
  EXPECT_EQ(remote("passwd", chief, {"user", "passwd", "bert", "--new-password-file", chief})->wait(), 0);
  EXPECT_EQ(remote("short", chief, {"user", "passwd", "bert", "--new-password-file", other})->wait(), 0);
  EXPECT_EQ(remote("enrol", chief, {"station", "add", "station-2", "--out", lab.path("second.key")})->wait(),
            0);
  const auto second = readWholeFile(lab.path("second.key"));
  ASSERT_TRUE(second.ok());
  secrets_["second key in hexadecimal"] = second->substr(second->find(':') + 1, 64);

  // a lesson being watched, with the trainee's code
  Process station("needlelab-station",
                  {"--server",
                   address,
                   "--ca",
                   ca,
                   "--key",
                   lab.path("station.key"),
                   "--trainee",
                   "tom",
                   "--headless",
                   "--spool",
                   lab.path("spool"),
                   "--device",
                   "simulated",
                   "--exercise",
                   "ball-free-practice",
                   "--seconds",
                   "4",
                   "--json",
                   lab.path("lesson.json"),
                   "--code-file",
                   badge},
                  lab.path("station.log"));
  Process instructor("needlelab-instructor",
                     {"--server", address, "--ca", ca, "--user", "chief", "--password-file", chief,
                      "--headless", "--seconds", "4"},
                     lab.path("instructor.log"));
  for (const Process* program : {&station, &instructor})
    EXPECT_TRUE(eventually([&] { return writesNoCore(program->pid()); })) << program->said();
  lookAtProcess("station", station.pid());
  lookAtProcess("instructor", instructor.pid());
  EXPECT_EQ(station.wait(), 0) << station.said();
  const auto lesson = readWholeFile(lab.path("lesson.json"));
  EXPECT_TRUE(lesson.ok() && !lesson->empty()) << "the code was sent, or no lesson would have begun";
  EXPECT_EQ(instructor.wait(), 0) << instructor.said();

  EXPECT_EQ(remote("audit", chief, {"audit"})->wait(), 0);
  const auto audit = readWholeFile(lab.path("audit.log"));
  EXPECT_TRUE(audit.ok() && audit->find("user passwd") != std::string::npos) << "the audit log was looked at";
  client->finish();
  server->signal(SIGTERM);
  EXPECT_EQ(server->wait(), 0);
  EXPECT_THAT(server->said(), testing::HasSubstr("login_refused")) << "there was something to let slip";

  if (store_) {
    store_->dump(lab.path("database.sql"));
    const auto dumped = readWholeFile(lab.path("database.sql"));
    ASSERT_TRUE(dumped.ok());
    EXPECT_THAT(*dumped, testing::HasSubstr("user passwd")) << "the database was looked at";
    EXPECT_FALSE(fs::exists(lab.path("data") / "needlelab.db"));
    secrets_["wrong password of PostgreSQL"] = "Planted-9-Pfeffernuss";
    store_->usePassword(secrets_["wrong password of PostgreSQL"]);
    server = startServer(0);
    EXPECT_GT(server->wait().value_or(0), 0) << server->said();
    EXPECT_THAT(server->said(), testing::HasSubstr("password authentication failed"));
    look("the log of PostgreSQL", StoreWithPassword::logOfPostgres());
  }
  // all files, except those that supply the secrets
  for (const auto& entry : fs::recursive_directory_iterator(lab.path(""))) {
    struct stat info {};
    ASSERT_EQ(::lstat(entry.path().c_str(), &info), 0);
    if (!entry.is_regular_file() || entry.path().extension() == ".password") continue;
    if (entry.path().extension() == ".key" && entry.path().parent_path() == lab.path("").parent_path()) {
      EXPECT_EQ(info.st_mode & 0777, 0600u) << entry.path();
      continue;
    }
    const auto text = readWholeFile(entry.path());
    ASSERT_TRUE(text.ok()) << text.error().message;
    look(entry.path(), *text);
    const std::string path = fs::relative(entry.path(), lab.path(""));
    const bool certificate = entry.path().extension() == ".crt";
    if (path.starts_with("data/") || path.starts_with("spool/")) {
      EXPECT_EQ(info.st_mode & 0777, certificate ? 0644u : 0600u) << path << ": others may not look";
    }
  }
  EXPECT_GE(looked_, 20) << "logs, database, spool";
}

TEST_F(Secrets, aPasswordFileReadableByOthersIsReported) {
  Lab lab;
  EXPECT_EQ(::chmod(lab.path("password").c_str(), 0640), 0);
  ASSERT_EQ(lab.admin({"user", "passwd", "ines", "--password-file", lab.path("password")}), 0);
  const auto said = readWholeFile(lab.path("admin.log"));
  ASSERT_TRUE(said.ok());
  EXPECT_THAT(*said, testing::HasSubstr("may be read by others: chmod 600"));
}

}  // namespace
}  // namespace needlelab::test
