// A lab on PostgreSQL records what a restored backup proves (needlelab-admin backup verified).
#include <arpa/inet.h>
#include <fmt/core.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "db/audit/audit.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"
#include "tests/support/store/postgres_database.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

/// A fake PostgreSQL that asks each connection for its password in clear text, and a passfile with that of
/// db-a.example.
class CleartextListener {
 public:
  CleartextListener() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof at;
    if (::bind(socket_, reinterpret_cast<sockaddr*>(&at), length) != 0 || ::listen(socket_, 8) != 0 ||
        ::getsockname(socket_, reinterpret_cast<sockaddr*>(&at), &length) != 0)
      throw std::runtime_error("cannot listen");
    port_ = ntohs(at.sin_port);
    const std::string file = passfile();
    std::ofstream(file) << "db-a.example:*:*:needlelab:of-the-database\n";
    ::chmod(file.c_str(), 0600);
    thread_ = std::thread([this] { serve(); });
  }
  ~CleartextListener() {
    ::shutdown(socket_, SHUT_RDWR);
    thread_.join();
    ::close(socket_);
  }
  CleartextListener(const CleartextListener&) = delete;
  CleartextListener& operator=(const CleartextListener&) = delete;
  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] std::string passfile() const { return folder_.path() / "db.pass"; }
  /// Everything received since the last call, except requests for TLS.
  std::string received() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(received_, {});
  }

 private:
  static bool read(int from, std::string& into, std::size_t bytes) {
    into.resize(bytes);
    return ::recv(from, into.data(), bytes, MSG_WAITALL) == static_cast<ssize_t>(bytes);
  }
  static std::uint32_t number(const std::string& text) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(text[i]);
    return value;
  }
  /// Reads messages without a type byte, then with one.
  void serve() {
    for (int peer = -1; (peer = ::accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC)) >= 0; ::close(peer)) {
      const timeval patience{5, 0};
      ::setsockopt(peer, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
      constexpr std::uint32_t kWantsTls = 80877103, kWantsGss = 80877104;
      constexpr char kInClear[] = {'R', 0, 0, 0, 8, 0, 0, 0, 3};
      std::string head, body;
      bool asked = false;
      while (read(peer, head, asked ? 5 : 4) &&
             read(peer, body, (number(head.substr(asked ? 1 : 0)) - 4) & 0xffff)) {
        if (!asked && (number(body) == kWantsTls || number(body) == kWantsGss)) {
          (void)::send(peer, "N", 1, MSG_NOSIGNAL);
          continue;
        }
        const std::scoped_lock lock(mutex_);
        received_ += body + "\n";
        if (asked) break;
        asked = true;
        (void)::send(peer, kInClear, sizeof kInClear, MSG_NOSIGNAL);
      }
    }
  }

  test::TempFolder folder_;
  const int socket_;
  int port_ = 0;
  std::mutex mutex_;
  std::string received_;
  std::thread thread_;
};

class VerifiedBackups : public test::ServiceTest {
 protected:
  void SetUp() override {
    addStation();
    auto reader = store->readers().borrow();
    const auto lab = MetaStore(**reader).get(kLabKey);
    ASSERT_OK(MetaStore(restored.writer).set(kLabKey, **lab));
    ASSERT_OK(change([&](Connection& c) { return put(c); }));
    ASSERT_OK(put(restored.writer));
  }
  Status put(Connection& to) const {
    SessionStore sessions(to);
    if (auto opened = sessions.open(test::describe(id), 1); !opened) return opened.error();
    for (std::uint64_t seq = 0; seq < 4; ++seq)
      if (auto appended = sessions.append(id, seq, test::chunkOf(seq)); !appended) return appended.error();
    return {};
  }
  static pb::Request verified(const std::string& path, bool counts_as_safe) {
    pb::Request request;
    request.mutable_backup()->set_path(path);
    request.mutable_backup()->set_counts_as_safe(counts_as_safe);
    return request;
  }
  [[nodiscard]] std::string restoredUrl() const { return test::urlFormOf(restored.address.url); }
  std::uint64_t safe() {
    auto reader = store->readers().borrow();
    return *SessionStore(**reader).safeSeqs(id);
  }
  test::TestDb restored;
  const Uuid id = makeUuidV7();
};

TEST_F(VerifiedBackups, aRestoredBackupMakesChunksSafeWhereThatIsAskedFor) {
  const auto unasked = get(admin, verified(restoredUrl(), false)).backup_done();
  EXPECT_EQ(unasked.chunks_verified(), 4u);
  EXPECT_EQ(unasked.disk(), pb::BackupDone::DISK_UNKNOWN);
  EXPECT_FALSE(unasked.safe());
  EXPECT_EQ(safe(), 0u);
  const auto asked = get(admin, verified(restoredUrl(), true)).backup_done();
  EXPECT_TRUE(asked.safe());
  EXPECT_EQ(safe(), 3u) << "the session is open: its last chunk stays at the station";
  pb::Request audit;
  audit.mutable_list_audit()->set_action("backup");
  const auto lines = get(admin, audit).audit();
  ASSERT_EQ(lines.entries_size(), 4);
  EXPECT_THAT(lines.entries(0).detail(), HasSubstr("4 chunks, Safe because it was asked for"));
  EXPECT_THAT(lines.entries(1).detail(), HasSubstr("to be compared"));
  EXPECT_THAT(lines.entries(2).detail(), HasSubstr("not Safe"));
}

TEST_F(VerifiedBackups, whatIsNoRestoredDatabaseIsRefusedWithTheRemedy) {
  const auto said = [&](const pb::Request& request) {
    const Outcome outcome = ask(admin, request);
    EXPECT_TRUE(outcome.error.has_value());
    return outcome.error ? outcome.error->message : "";
  };
  EXPECT_THAT(said(verified("/var/backups/needlelab.db", true)),
              HasSubstr("needlelab-admin backup verified"));
  pb::Request kept = verified(restoredUrl(), true);
  kept.mutable_backup()->set_keep(3);
  EXPECT_THAT(said(kept), HasSubstr("needlelab-admin backup verified"));
  EXPECT_THAT(said(verified("postgresql://ada:secret@/lab?host=/tmp", true)), HasSubstr("password"));
  EXPECT_THAT(said(verified(restoredUrl() + "-nowhere", true)), HasSubstr("postgres"));
  EXPECT_EQ(safe(), 0u);
  EXPECT_EQ(refusal(manager, verified(restoredUrl(), true)), ErrorCode::kDenied);
}

TEST_F(VerifiedBackups, anAddressThatRedirectsAPasswordIsRefusedBeforeConnecting) {
  CleartextListener attacker;
  ::setenv("PGPASSFILE", attacker.passfile().c_str(), 1);
  const std::string trap = fmt::format("hostaddr=127.0.0.1&port={}", attacker.port());
  // what the listener receives if the address is not checked
  EXPECT_FALSE(openAt(StoreAddress("needlelab.db", "postgresql://needlelab@db-a.example/needlelab?" + trap),
                      Connection::Mode::kReader)
                   .ok());
  EXPECT_THAT(attacker.received(), HasSubstr("of-the-database"));
  const std::pair<std::string, const char*> addresses[] = {
      {"postgresql://needlelab@db-a.example/needlelab?" + trap, "the address has hostaddr"},
      {"postgresql://needlelab@db-a.example/needlelab?sslmode=verify-full&" + trap, "hostaddr"},
      {"postgresql://needlelab@/needlelab?host=/tmp&" + trap, "hostaddr"},
      {"postgresql://needlelab@db-a.example/needlelab?host%61ddr=127.0.0.1", "hostaddr"},
      {"postgresql://needlelab@/needlelab?host=/tmp&passfile=/etc/hostname", "passfile"},
      {"postgresql:///needlelab?service=other", "service"},
      {"postgresql:///needlelab?sslkey=/etc/hostname", "sslkey"},
      {"postgresql:///needlelab?sslrootcert=/tmp/mine", "sslrootcert"},
      {"postgresql:///needlelab?options=-cstatement_timeout%3D1", "options"},
      {"postgresql://needlelab@db-a.example/needlelab", "names the host db-a.example"},
      {"postgresql://needlelab@db-a.example/needlelab?sslmode=require", "sslmode=verify-full"},
      {"postgresql://needlelab@127.0.0.1,db-a.example/needlelab?sslmode=disable",
       "names the host db-a.example"}};
  for (const auto& [address, words] : addresses) {
    const Outcome outcome = ask(admin, verified(address, true));
    ASSERT_TRUE(outcome.error.has_value()) << address;
    EXPECT_EQ(outcome.error->code, ErrorCode::kInvalidInput) << address;
    EXPECT_THAT(outcome.error->message, HasSubstr(words)) << address;
  }
  EXPECT_EQ(attacker.received(), "") << "nothing more has connected";
  // when it does connect, its line is written first
  const std::string nobody = fmt::format("postgresql://ada@127.0.0.1:{}/needlelab", attacker.port());
  ASSERT_TRUE(ask(admin, verified(nobody, true)).error.has_value());
  pb::Request audit;
  audit.mutable_list_audit()->set_action("backup");
  const auto lines = get(admin, audit).audit();
  ASSERT_EQ(lines.entries_size(), 1);
  EXPECT_EQ(lines.entries(0).subject(), nobody);
  EXPECT_THAT(attacker.received(), testing::Not(HasSubstr("of-the-database")))
      << "the passfile has no such host";
  ::unsetenv("PGPASSFILE");
}

}  // namespace
}  // namespace needlelab
