// Each start-up fault: the message, the advice and the exit code.
#include "server/live/limits/startup.h"

#include <gmock/gmock.h>
#include <netinet/in.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/wire/certificates.h"
#include "db/service/start/bootstrap.h"
#include "db/store/connection.h"
#include "server/service_manager.h"
#include "tests/integration/lab.h"
#include "tests/support/time_zone.h"

namespace needlelab {
namespace {

using namespace test;
using namespace std::chrono_literals;
namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

/// The folder of a stopped server; each test damages something in it.
class StartupTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(Store::open(data(), {}).ok());
    ASSERT_TRUE(
        ensureTlsFiles(tls(), {.hosts = {"localhost", "127.0.0.1", "::1"}, .domains = {"lab.example"}}).ok());
    // The certificate contains the server's name only after the first start with the authority's key.
    auto [code, said] = serveOnce({});
    ASSERT_EQ(code, kExitDone) << said;
  }
  [[nodiscard]] fs::path data() const { return folder_.path() / "data"; }
  [[nodiscard]] TlsFiles tls() const { return tlsFilesIn(data() / "tls"); }

  struct Ending {
    int code;
    std::string said;
  };
  /// Starts a server and stops it once it listens. Returns its exit status and its output.
  Ending serveOnce(const std::vector<std::string>& more, const std::string& shell = {}) {
    const auto log = folder_.path() / ("log-" + std::to_string(++runs_));
    fs::remove(folder_.path() / "port");
    std::vector<std::string> arguments = {"--data", data(), "--port-file", folder_.path() / "port"};
    if (std::find(more.begin(), more.end(), "--listen") == more.end())
      arguments.insert(arguments.end(), {"--listen", "127.0.0.1:0"});
    arguments.insert(arguments.end(), more.begin(), more.end());
    std::string program = "needlelab-server";
    if (!shell.empty()) {
      std::string line = shell + " exec '" NEEDLELAB_BIN "/needlelab-server'";
      for (const std::string& argument : arguments) line += " '" + argument + "'";
      arguments = {"-c", line};
      program = "/bin/sh";
    }
    Process process(program, arguments, log);
    (void)eventually([&] { return fs::exists(folder_.path() / "port") || process.wait(0ms); });
    if (!process.wait(0ms)) process.signal(SIGTERM);
    const auto code = process.wait();
    return {code.value_or(-1000), process.said()};
  }
  TempFolder folder_;
  int runs_ = 0;
};

TEST_F(StartupTest, aTakenPortNamesItsHolder) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(::listen(fd, 1), 0);
  ASSERT_EQ(::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size), 0);
  const auto [code, said] = serveOnce({"--listen", "127.0.0.1:" + std::to_string(ntohs(address.sin_port))});
  ::close(fd);
  EXPECT_EQ(code, kExitFailed);
  EXPECT_THAT(said,
              AllOf(HasSubstr("port is taken by operations_test (process " + std::to_string(::getpid())),
                    HasSubstr("--listen")));
  const auto metrics = serveOnce({"--metrics", "127.0.0.1:99999"});
  EXPECT_EQ(metrics.code, kExitInvalid);
  EXPECT_THAT(metrics.said, HasSubstr("--metrics"));
}

TEST_F(StartupTest, theKeyThatAKilledCommandLeftIsRemovedAndNamed) {
  const auto left = data() / "tls" / "ca-next.key.being-written-aB3dE9",
             kept = data() / "tls" / "ca.key.backup";
  for (const auto& path : {left, kept}) std::ofstream(path) << "half a key";
  const auto [code, said] = serveOnce({});
  EXPECT_EQ(code, kExitDone) << said;
  EXPECT_THAT(said, AllOf(HasSubstr("tls_leftover_removed"), HasSubstr(left.string())));
  EXPECT_FALSE(fs::exists(left));
  EXPECT_TRUE(fs::exists(kept));
}

TEST_F(StartupTest, leftoversOfAKilledProgramAreRemovedAndNamed) {
  const auto left = data() / "audit.head.being-written-aB3dE9";
  std::ofstream(left) << "half a head";
  const auto [code, said] = serveOnce({});
  EXPECT_EQ(code, kExitDone) << said;
  EXPECT_THAT(said, AllOf(HasSubstr("leftover_removed"), HasSubstr(left.string())));
  EXPECT_FALSE(fs::exists(left));
}

TEST_F(StartupTest, aPipeInAFilesPlaceIsNamedAndNotWaitedFor) {
  for (const char* name : {"audit.head", "needlelab.db-journal", "tls/ca.key"}) {
    const auto path = data() / name, aside = folder_.path() / "aside";
    const bool was = fs::exists(path);
    if (was) fs::rename(path, aside);
    ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
    const auto [code, said] = serveOnce({});
    EXPECT_EQ(code, kExitInvalid) << said;
    EXPECT_THAT(said, HasSubstr(path.string() + ": is a pipe"));
    fs::remove(path);
    if (was) fs::rename(aside, path);
  }
}

TEST_F(StartupTest, aFolderInUseNamesItsUser) {
  const auto lock = FolderLock::take(data(), "needlelab-server");
  ASSERT_TRUE(lock.ok());
  const auto [code, said] = serveOnce({});
  EXPECT_EQ(code, kExitFailed);
  EXPECT_THAT(said, HasSubstr("needlelab-server, process " + std::to_string(::getpid())));
}

TEST_F(StartupTest, aNewerSchemaAndADamagedDatabaseAreNamed) {
  {
    auto writer = Connection::open(data() / "needlelab.db", {.mode = Connection::Mode::kWriter});
    ASSERT_TRUE(writer->script("PRAGMA user_version=999; PRAGMA wal_checkpoint(TRUNCATE)").ok());
  }
  auto ended = serveOnce({});
  EXPECT_EQ(ended.code, kExitInvalid) << "systemd tries no more";
  EXPECT_THAT(ended.said, AllOf(HasSubstr("version 999"), HasSubstr("newer program")));
  // the first page of the file is overwritten
  std::fstream(data() / "needlelab.db", std::ios::in | std::ios::out | std::ios::binary)
      << std::string(4096, '#');
  ended = serveOnce({});
  EXPECT_EQ(ended.code, kExitFailed);
  EXPECT_THAT(ended.said, AllOf(HasSubstr("needlelab.db"), HasSubstr("not a database")));
}

TEST_F(StartupTest, aBadCertificateIsReplacedOrReported) {
  const auto good = *readWholeFile(tls().certificate), key = *readWholeFile(tls().key);
  // With the authority's key available, the server repairs itself.
  std::ofstream(tls().certificate) << "spoilt";
  EXPECT_EQ(serveOnce({}).code, kExitDone);
  EXPECT_TRUE(readCertificate(tls().certificate).ok());

  // Without the key, each fault has its own message.
  fs::rename(tls().ca_key, folder_.path() / "ca.key");
  const auto refused = [&](const std::string& words, const std::vector<std::string>& more = {}) {
    const auto [code, said] = serveOnce(more);
    EXPECT_EQ(code, kExitInvalid) << said;
    EXPECT_THAT(said, AllOf(HasSubstr(words), HasSubstr("ca.key"), HasSubstr("put it back")));
  };
  refused("server.crt is not for 'other.example', only for ", {"--host-name", "other.example"});
  refused("server.crt is not for 'third.example', only for ", {"--host-name", "localhost,third.example"});
  std::ofstream(tls().key) << key;  // of the one before
  refused("do not fit each other");
  std::ofstream(tls().certificate) << "spoilt";
  refused("server.crt holds no certificate");
  std::ofstream(tls().certificate) << good;
  std::ofstream(tls().key) << "spoilt";
  refused("server.key holds no private key");

  // an expired certificate, signed by the right authority
  std::ofstream(tls().key) << key;
  FILE* file = std::fopen(tls().certificate.c_str(), "r");
  X509* const certificate = PEM_read_X509(file, nullptr, nullptr, nullptr);
  std::fclose(file);
  file = std::fopen((folder_.path() / "ca.key").c_str(), "r");
  EVP_PKEY* const authority = PEM_read_PrivateKey(file, nullptr, nullptr, nullptr);
  std::fclose(file);
  ASSERT_TRUE(certificate != nullptr && authority != nullptr);
  X509_gmtime_adj(X509_getm_notBefore(certificate), -20 * 86'400);
  X509_gmtime_adj(X509_getm_notAfter(certificate), -10 * 86'400);
  ASSERT_GT(X509_sign(certificate, authority, EVP_sha256()), 0);
  file = std::fopen(tls().certificate.c_str(), "w");
  PEM_write_X509(file, certificate);
  std::fclose(file);
  X509_free(certificate);
  EVP_PKEY_free(authority);
  refused("server.crt has expired on ");
}

TEST_F(StartupTest, aRenewedCertificateKeepsTheOldNames) {
  ASSERT_TRUE(renewServerCertificate(tls(), {"lab.example"}).ok());
  ASSERT_TRUE(renewServerCertificate(tls(), {"10.0.0.9"}).ok());
  EXPECT_THAT(readCertificate(tls().certificate)->hosts,
              testing::IsSupersetOf({"localhost", "127.0.0.1", "::1", "lab.example", "10.0.0.9"}));
  EXPECT_EQ(serveOnce({}).code, kExitDone);
}

TEST_F(StartupTest, aServerOnAFullDiskIsReadOnly) {
  const auto [code, said] = serveOnce({"--min-free", "9999999999"});
  EXPECT_EQ(code, kExitDone) << said;
  EXPECT_THAT(said, AllOf(HasSubstr("read_only"), HasSubstr("MiB are left"), HasSubstr("make room")));
}

TEST_F(StartupTest, noRoomForANewDatabaseIsReportedBeforeAnyWrite) {
  fs::remove(data() / "needlelab.db");
  const auto [code, said] = serveOnce({"--min-free", "9999999999"});
  EXPECT_EQ(code, kExitFailed);
  EXPECT_THAT(said, AllOf(HasSubstr("MiB left"), HasSubstr("--min-free")));
}

TEST_F(StartupTest, tooFewFilesAreAWarningWithNumbersAndTheWayOut) {
  const auto [code, said] = serveOnce({}, "ulimit -n 200;");
  EXPECT_EQ(code, kExitDone) << said;
  EXPECT_THAT(said, AllOf(HasSubstr("few_files"), HasSubstr("may open 200 files"),
                          HasSubstr("LimitNOFILE=4160"), HasSubstr("--max-connections 136")));
  EXPECT_THAT(serveOnce({"--max-connections", "136"}, "ulimit -n 200;").said,
              testing::Not(HasSubstr("few_files")));
}

TEST_F(StartupTest, aFolderWithoutRightsNamesOwnerAndMode) {
  if (::geteuid() != 0 || !fs::exists("/usr/bin/setpriv"))
    GTEST_SKIP() << "needs root and setpriv, to be somebody else";
  fs::permissions(folder_.path(), fs::perms::owner_all | fs::perms::others_all, fs::perm_options::add);
  const auto log = folder_.path() / "nobody.log";
  Process process("/usr/bin/setpriv",
                  {"--reuid=65534", "--regid=65534", "--clear-groups", NEEDLELAB_BIN "/needlelab-server",
                   "--data", data(), "--listen", "127.0.0.1:0"},
                  log);
  const auto code = process.wait();
  if (code == 127 || code == 126) GTEST_SKIP() << "the program lies where no one else may read";
  EXPECT_EQ(code, kExitFailed);
  EXPECT_THAT(process.said(), AllOf(HasSubstr("may not write in " + data().string()),
                                    HasSubstr("mode 0700, owner root"), HasSubstr("chown")));
}

TEST(Startup, aClockBeforeTheYear2020IsRefused) {
  EXPECT_TRUE(checkClock(1'577'836'800).ok());
  const test::WithZone zone(test::kStJohns);
  const Status early = checkClock(86'400);
  ASSERT_FALSE(early.ok());
  EXPECT_THAT(early.error().message, AllOf(HasSubstr("1970-01-01 20:30:00 NST"), HasSubstr("set the clock")));
  EXPECT_EQ(exitCodeOf(early.error()), kExitFailed);
}

TEST(ServiceManager, withoutSystemdNothingHappens) {
  for (const char* name : {"LISTEN_PID", "LISTEN_FDS", "NOTIFY_SOCKET", "WATCHDOG_USEC"}) ::unsetenv(name);
  EXPECT_TRUE(takeListenSockets()->empty());
  EXPECT_FALSE(notifyManager("READY=1"));
  EXPECT_FALSE(watchdogPeriod());
  // Sockets for another process are not used.
  ::setenv("LISTEN_PID", "1", 1);
  ::setenv("LISTEN_FDS", "1", 1);
  EXPECT_TRUE(takeListenSockets()->empty());
  EXPECT_EQ(std::getenv("LISTEN_FDS"), nullptr) << "and our children shall not take them for theirs";
  ::setenv("LISTEN_PID", std::to_string(::getpid()).c_str(), 1);
  ::setenv("LISTEN_FDS", "99", 1);
  EXPECT_FALSE(takeListenSockets().ok());
  ::setenv("WATCHDOG_USEC", "30000000", 1);
  EXPECT_EQ(watchdogPeriod(), std::chrono::microseconds(15'000'000));
  ::setenv("WATCHDOG_PID", "1", 1);
  EXPECT_FALSE(watchdogPeriod()) << "asked of another process";
  ::unsetenv("WATCHDOG_USEC");
  ::unsetenv("WATCHDOG_PID");
}

}  // namespace
}  // namespace needlelab
