// Yesterday's backup is restored while the lab keeps working: no data that is still in a spool is lost.
#include <gmock/gmock.h>

#include <map>

#include "tests/integration/lab.h"

namespace needlelab {
namespace {

using namespace test;
using namespace std::chrono_literals;
namespace fs = std::filesystem;

std::vector<std::string> sessionsIn(const fs::path& spool) {
  std::vector<std::string> ids;
  for (const auto& entry : fs::directory_iterator(spool))
    if (parseUuid(entry.path().filename().string()).ok()) ids.push_back(entry.path().filename().string());
  return ids;
}

TEST(RestoreLab, stationsSendAgainWhatTheBackupLacks) {
  Lab lab;
  ASSERT_EQ(
      lab.admin({"user", "add", "adm", "--role", "administrator", "--password-file", lab.path("password")}),
      0);
  lab.startServer();
  std::map<std::string, std::vector<std::string>> recorded;  // by session, in the spool
  const auto remember = [&] {
    for (const std::string& id : sessionsIn(lab.path("spool")))
      recorded[id] = Lab::spooledChunks(lab.path("spool"), id);
  };
  const auto lesson = [&](const std::string& name, const std::string& seconds) {
    auto station = lab.startStation(
        name, {"--exercise", "shoulder-bursa", "--device", "simulated", "--seconds", seconds});
    EXPECT_EQ(station->wait(), 0) << station->said();
    remember();
  };
  lesson("before", "0.5");

  // a backup by rotation while a lesson streams
  fs::create_directory(lab.path("backups"));
  auto station =
      lab.startStation("during", {"--exercise", "shoulder-bursa", "--device", "simulated", "--seconds", "3"});
  ASSERT_TRUE(eventually([&] {
    const auto all = lab.sessions();
    return all.size() == 2 && all[0].chunks() >= 1;
  }));
  Process backup("needlelab-admin",
                 {"--server", "127.0.0.1:" + std::to_string(lab.port()), "--ca",
                  lab.path("data") / "tls" / "ca.crt", "--user", "adm", "--password-file",
                  lab.path("password"), "backup", "--dir", lab.path("backups"), "--keep", "3"},
                 lab.path("backup.log"));
  ASSERT_EQ(backup.wait(), 0) << backup.said();
  EXPECT_EQ(station->wait(), 0) << station->said();
  remember();
  lesson("after", "0.5");
  ASSERT_EQ(recorded.size(), 3u);
  ASSERT_EQ(lab.sessions().size(), 3u);
  ASSERT_EQ(lab.stopServer(), 0);

  // The restored state is older: the second session is incomplete in it, the third is unknown.
  std::vector<fs::path> files(fs::directory_iterator(lab.path("backups")), fs::directory_iterator{});
  ASSERT_EQ(files.size(), 1u);
  ASSERT_EQ(lab.admin({"restore", "--from", files[0]}), 0);
  lab.startServer();
  ASSERT_EQ(lab.sessions().size(), 2u);

  // Any start of the station uploads everything again.
  lesson("again", "0.5");
  ASSERT_TRUE(eventually([&] { return lab.sessions().size() == 4; }));
  ASSERT_EQ(recorded.size(), 4u);
  for (const auto& [id, chunks] : recorded) {
    EXPECT_TRUE(eventually([&lab, &session = id] { return lab.verifies(session); })) << id;
    const StoredSession stored = lab.stored(id);
    EXPECT_EQ(stored.info.state(), pb::SESSION_COMPLETE) << id;
    EXPECT_EQ(stored.chunks, chunks) << id << ": every byte as it was recorded";
  }
  EXPECT_EQ(lab.stopServer(), 0);
}

}  // namespace
}  // namespace needlelab
