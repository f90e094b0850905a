// Full, read-only or failing disks under a server: it stops acknowledging and reports the remedy; afterwards
// nothing is missing.
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <thread>

#include "client/net/uplink/uplink.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "db/backup/check.h"
#include "tests/integration/process.h"
#include "tests/powercut/campaign.h"
#include "tests/powercut/watched_disk.h"
#include "tests/support/patience.h"
#include "tests/unit/client/net/spool/spool_samples.h"
#include "tests/unit/db/test_db.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

/// A station with recorded sessions in its spool.
class RecordedStation {
 public:
  RecordedStation(int sessions, std::uint64_t chunks) {
    spool_ = std::move(*Spool::open(folder_.path()));
    for (int i = 0; i < sessions; ++i) {
      auto session = *spool_->create(describeSession(makeUuidV7()));
      for (std::uint64_t seq = 0; seq < chunks; ++seq)
        if (!session->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(seq * 200, 200)), 200).ok())
          throw std::runtime_error("no chunk");
      if (!session->sync().ok() || !session->end(false).ok()) throw std::runtime_error("no session");
      sessions_.push_back(session);
    }
  }
  /// Uploads until `enough`, or until all is closed; then returns true.
  template <typename Enough>
  bool upload(const ClientConfig& client, Enough enough) {
    UplinkConfig config;
    config.client = client;
    config.first_retry = 20ms;
    config.max_retry = 50ms;
    Uplink uplink(config, {});
    for (const auto& session : sessions_)
      if (!session->receipt().closed) uplink.add(session, false);
    const bool done = eventually([&] { return enough() || uplink.waitUntilDone(1ms); });
    const bool all = uplink.waitUntilDone(1ms);
    uplink.stop();
    return done && all;
  }
  [[nodiscard]] const std::vector<std::shared_ptr<SpoolSession>>& sessions() const { return sessions_; }

 private:
  TempFolder folder_;
  std::unique_ptr<Spool> spool_;
  std::vector<std::shared_ptr<SpoolSession>> sessions_;
};

/// Returns a message if the database lacks acknowledged data.
std::string missingOf(const fs::path& database, const RecordedStation& station, bool everything) {
  auto opened = Connection::open(database, {.mode = Connection::Mode::kWriter});
  if (!opened) return opened.error().message;
  const auto check = checkDatabase(*opened);
  if (!check) return check.error().message;
  if (!check->ok()) return check->faults.front();
  for (const auto& session : station.sessions()) {
    const SpoolReceipt receipt = session->receipt();
    const std::uint64_t wanted =
        everything || receipt.closed ? session->contents().chunks : receipt.committed;
    if (wanted == 0) continue;
    const auto chunks = SessionStore(*opened).readChunks(session->id(), 0, UINT32_MAX, SIZE_MAX);
    if (!chunks) return chunks.error().message;
    if (chunks->size() < wanted)
      return "has " + std::to_string(chunks->size()) + " chunks, " + std::to_string(wanted) +
             " were acknowledged";
    for (const StoredChunk& chunk : *chunks)
      if (chunk.bytes != *session->readChunk(chunk.seq)) return "other bytes";
  }
  return {};
}

struct DiskTrouble {
  const char* name;
  DiskCall call;
  int error;
  bool once;
  const char* words;
};
constexpr DiskTrouble kTroubles[] = {
    {"full", DiskCall::kWrite, ENOSPC, false, "make room"},
    {"read-only", DiskCall::kWrite, EROFS, false, "read-only"},
    {"failing at a sync", DiskCall::kSync, EIO, true, "fails"},
    {"failing at a write", DiskCall::kWrite, EIO, true, "fails"},
};

TEST(DiskFault, aServerWhoseDiskRefusesStopsInWordsAndNothingIsLost) {
  Random random(seedOr(20261127));
  int runs = 0;
  for (const DiskTrouble& trouble : kTroubles) {
    for (int i = 0; i < (longForm() ? 25 : 2); ++i) {
      SCOPED_TRACE(trouble.name);
      RunningServer server([](ServerOptions& options) {
        options.writer.window = 2ms;
        options.writer.checkpoint_every = 5ms;
        options.drain = 1'000ms;
      });
      const std::string key = server.addStation("station-1");
      RecordedStation station(3, 30);
      const auto data = server.folder() / "data";
      auto left =
          std::make_shared<int>(static_cast<int>(1 + random.below(trouble.call == DiskCall::kSync ? 8 : 60)));
      WatchedDisk::setFault(data / "needlelab.db", [&trouble, left](DiskCall call, const std::string&) {
        if (call != trouble.call) return 0;
        --*left;
        return *left == 0 || (*left < 0 && !trouble.once) ? trouble.error : 0;
      });
      const bool all = station.upload(server.config(stationLogin("station-1", key)),
                                      [&] { return server.server().store().writer().failed().has_value(); });
      EXPECT_FALSE(all) << "nothing refused";
      const auto failed = server.server().store().writer().failed();
      ASSERT_TRUE(failed.has_value());
      EXPECT_NE(failed->message.find(trouble.words), std::string::npos) << failed->message;
      EXPECT_NE(failed->message.find(data.string()), std::string::npos) << failed->message;
      EXPECT_EQ(server.stop(), kExitFailed);
      WatchedDisk::clearFault();
      EXPECT_EQ(missingOf(data / "needlelab.db", station, false), "");
      // space is freed
      server.start();
      EXPECT_TRUE(station.upload(server.config(stationLogin("station-1", key)), [] { return false; }));
      (void)server.stop();
      EXPECT_EQ(missingOf(data / "needlelab.db", station, true), "");
      ++runs;
    }
  }
  std::printf("disk faults under a server: %d runs, nothing lost\n", runs);
}

TEST(DiskFault, aStartOnARefusingDiskIsReported) {
  for (const auto& [error, words] :
       {std::pair(ENOSPC, "make room"), std::pair(EROFS, "read-only"), std::pair(EIO, "fails")}) {
    const TempFolder folder;
    for (const bool again : {false, true}) {
      const auto data = folder.path() / (again ? "old" : "new");
      if (again) {
        ServerOptions options;
        options.data = data;
        options.listen = "127.0.0.1:0";
        ASSERT_OK(Server::start(std::move(options)));
      }
      WatchedDisk::setFault(folder.path(), [number = error](DiskCall call, const std::string&) {
        return call == DiskCall::kRead ? 0 : number;
      });
      ServerOptions options;
      options.data = data;
      options.listen = "127.0.0.1:0";
      const auto started = Server::start(std::move(options));
      WatchedDisk::clearFault();
      ASSERT_FALSE(started.ok()) << words;
      EXPECT_NE(started.error().message.find(words), std::string::npos) << started.error().message;
      EXPECT_NE(started.error().message.find(folder.path().string()), std::string::npos);
    }
  }
}

TEST(DiskFault, aServerOnAnUnwritableDiskStartsReadOnly) {
  RunningServer server;
  const std::string key = server.addStation("station-1");
  RecordedStation station(2, 30);
  ASSERT_TRUE(station.upload(server.config(stationLogin("station-1", key)), [] { return false; }));
  EXPECT_EQ(server.stop(), kExitDone);
  const auto data = server.folder() / "data";
  // SQLite must recreate it and cannot: then an ordinary connection cannot even read
  fs::remove(data / "needlelab.db-shm");
  WatchedDisk::setFault(
      data, [](DiskCall call, const std::string&) { return call == DiskCall::kWrite ? ENOSPC : 0; });
  server.start();
  ASSERT_TRUE(server.server().store().readOnly());
  EXPECT_NE(server.server().store().readOnly()->message.find("make room"), std::string::npos)
      << server.server().store().readOnly()->message;
  {
    auto reader = server.server().store().readers().borrow();
    ASSERT_OK(reader);
    for (const auto& session : station.sessions()) {
      const auto chunks = SessionStore(**reader).readChunks(session->id(), 0, UINT32_MAX, SIZE_MAX);
      ASSERT_OK(chunks);
      ASSERT_EQ(chunks->size(), session->contents().chunks);
      for (const StoredChunk& chunk : *chunks) EXPECT_EQ(chunk.bytes, *session->readChunk(chunk.seq));
    }
  }
  EXPECT_TRUE(server.connect(stationLogin("station-1", key)).ok());
  EXPECT_EQ(server.stop(), kExitDone);
  WatchedDisk::clearFault();
  server.start();
  EXPECT_FALSE(server.server().store().readOnly());
  (void)server.stop();
  EXPECT_EQ(missingOf(data / "needlelab.db", station, true), "");
}

TEST(DiskFault, anUnreadablePageIsReportedAndTheServerContinues) {
  RunningServer server;
  const std::string key = server.addStation("station-1");
  RecordedStation station(2, 30);
  ASSERT_TRUE(station.upload(server.config(stationLogin("station-1", key)), [] { return false; }));
  const auto database = server.folder() / "data" / "needlelab.db";
  const auto read = [&] {
    auto reader = TestDb::must(Connection::open(database, {}));
    return SessionStore(reader).readChunks(station.sessions()[0]->id(), 0, UINT32_MAX, SIZE_MAX);
  };
  ASSERT_OK(read());
  // only for this reader's page: meanwhile the server's own threads score the session and also read
  auto reads = std::make_shared<int>(0);
  WatchedDisk::setFault(
      database, [reads, reader = std::this_thread::get_id()](DiskCall call, const std::string&) {
        return std::this_thread::get_id() == reader && call == DiskCall::kRead && ++*reads > 6 ? EIO : 0;
      });
  std::string said;
  try {
    const auto refused = read();
    if (!refused.ok()) said = refused.error().message;
  } catch (const std::exception& error) {
    said = error.what();
  }
  WatchedDisk::clearFault();
  EXPECT_NE(said.find("Input/output error"), std::string::npos) << said;
  EXPECT_NE(said.find(database.string()), std::string::npos) << said;
  EXPECT_OK(read());
  EXPECT_FALSE(server.server().store().writer().failed());
}

/// From a line NAME:64 hexadecimal digits.
std::string keyOf(const std::string& line) {
  std::string key;
  for (std::size_t at = line.find(':') + 1; at + 1 < line.size() && key.size() < 32; at += 2)
    key.push_back(static_cast<char>(std::stoi(line.substr(at, 2), nullptr, 16)));
  return key;
}

/// Gives this process, and children started later, their own mount namespace, as tests/support/private_mounts
/// does for a command. Returns why the system refuses, or an empty text. Call it before there is a second
/// thread.
std::string enterPrivateMounts() {
  const uid_t uid = ::geteuid();
  const gid_t gid = ::getegid();
  if (::unshare(uid == 0 ? CLONE_NEWNS : CLONE_NEWNS | CLONE_NEWUSER) != 0)
    return std::string("unshare: ") + std::strerror(errno);
  if (uid != 0) {
    std::ofstream("/proc/self/setgroups") << "deny";
    std::ofstream("/proc/self/uid_map") << "0 " + std::to_string(uid) + " 1";
    std::ofstream("/proc/self/gid_map") << "0 " + std::to_string(gid) + " 1";
  }
  // EINVAL: in a chroot "/" is not a mount point, and mounts stay as private as they were
  if (::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 && errno != EINVAL)
    return std::string("cannot make mounts private: ") + std::strerror(errno);
  return {};
}

/// A private small disk for this program and its children; removed at the end.
class SmallDisk {
 public:
  explicit SmallDisk(const char* size) {
    static const std::string refused = enterPrivateMounts();
    trouble_ = refused;
    if (!trouble_.empty()) return;
    mounted_ =
        ::mount("none", path().c_str(), "tmpfs", 0, (std::string("mode=0700,size=") + size).c_str()) == 0;
    if (!mounted_) trouble_ = std::string("mount: ") + std::strerror(errno);
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(path().c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  /// Returns why there is no small disk, or an empty text.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  [[nodiscard]] const fs::path& path() const { return folder_.path(); }
  void resize(const char* size) const {
    ASSERT_EQ(::mount("none", path().c_str(), "tmpfs", MS_REMOUNT, (std::string("size=") + size).c_str()), 0);
  }
  void makeReadOnly() const {
    ASSERT_EQ(::mount("none", path().c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, nullptr), 0);
  }

 private:
  TempFolder folder_;
  bool mounted_ = false;
  std::string trouble_;
};

TEST(DiskFault, theProgramExitsOnAFullDiskAndRestartsWithRoom) {
  const SmallDisk disk("3m");
  if (!disk.trouble().empty()) GTEST_SKIP() << "no small disk can be mounted here: " << disk.trouble();
  const TempFolder folder;
  const auto log = [&](const std::string& name) { return folder.path() / (name + ".log"); };
  const auto arguments =
      std::vector<std::string>{"--data",      disk.path() / "data",   "--listen",   "127.0.0.1:0",
                               "--port-file", folder.path() / "port", "--min-free", "0"};
  {
    Process admin(
        "needlelab-admin",
        {"--data", disk.path() / "data", "station", "add", "station-1", "--out", folder.path() / "key"},
        log("admin"));
    ASSERT_EQ(admin.wait(), 0) << admin.said();
  }
  const auto key_file = readWholeFile(folder.path() / "key");
  ASSERT_OK(key_file);
  const std::string key = keyOf(*key_file);
  RecordedStation station(6, 500);
  const auto config = [&] {
    ClientConfig client;
    client.connect_timeout = kPatience;
    const auto port = readWholeFile(folder.path() / "port");
    client.server.port = static_cast<std::uint16_t>(std::stoi(port.ok() ? *port : "0"));
    client.ca_file = disk.path() / "data" / "tls" / "ca.crt";
    client.program = programText("test");
    client.login = stationLogin("station-1", key);
    return client;
  };
  const auto started = [&](Process& server) {
    return eventually([&] { return fs::exists(folder.path() / "port") || server.wait(1ms).has_value(); }) &&
           fs::exists(folder.path() / "port");
  };
  {
    Process server("needlelab-server", arguments, log("first"));
    ASSERT_TRUE(started(server)) << server.said();
    (void)station.upload(config(), [&] { return server.wait(1ms).has_value(); });
    EXPECT_EQ(server.wait(), kExitFailed) << server.said();
    EXPECT_NE(server.said().find("make room"), std::string::npos) << server.said();
    EXPECT_NE(server.said().find(disk.path().string()), std::string::npos) << server.said();
  }
  fs::remove(folder.path() / "port");
  {
    auto with_floor = arguments;
    with_floor.back() = "1";
    Process server("needlelab-server", with_floor, log("full"));
    ASSERT_TRUE(started(server)) << server.said();
    EXPECT_NE(server.said().find("read_only"), std::string::npos) << server.said();
    EXPECT_TRUE(BlockingClient::connect(config()).ok()) << server.said();
    server.signal(SIGTERM);
    EXPECT_EQ(server.wait(), kExitDone) << server.said();
  }
  disk.resize("60m");
  EXPECT_EQ(missingOf(disk.path() / "data" / "needlelab.db", station, false), "");
  fs::remove(folder.path() / "port");
  {
    Process server("needlelab-server", arguments, log("second"));
    ASSERT_TRUE(started(server)) << server.said();
    EXPECT_TRUE(station.upload(config(), [] { return false; }));
    server.signal(SIGTERM);
    EXPECT_EQ(server.wait(), kExitDone) << server.said();
  }
  EXPECT_EQ(missingOf(disk.path() / "data" / "needlelab.db", station, true), "");
  disk.makeReadOnly();
  Process server("needlelab-server", arguments, log("third"));
  EXPECT_EQ(server.wait(), kExitFailed) << server.said();
  EXPECT_NE(server.said().find("read-only"), std::string::npos) << server.said();
}

}  // namespace
}  // namespace needlelab::test
