// Tests the turns of TLS handshakes under load: connections that never continue must not block others.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;
using TurnsClock = std::chrono::steady_clock;

/// A connection from an address of this machine that sends one message and then nothing.
class SilentPeer {
 public:
  SilentPeer(const char* from, std::uint16_t port, const std::string& bytes)
      : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = ::inet_addr(from);
    bool ok = ::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    address.sin_addr.s_addr = ::inet_addr("127.0.0.1");
    address.sin_port = htons(port);
    ok = ok && ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    ok = ok && ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
    if (!ok) throw std::runtime_error("cannot connect to the test's server");
  }
  ~SilentPeer() { ::close(fd_); }
  SilentPeer(const SilentPeer&) = delete;
  SilentPeer& operator=(const SilentPeer&) = delete;

 private:
  int fd_;
};

std::string clientHello() {
  const std::unique_ptr<SSL_CTX, void (*)(SSL_CTX*)> context(SSL_CTX_new(TLS_client_method()), SSL_CTX_free);
  const std::unique_ptr<SSL, void (*)(SSL*)> ssl(SSL_new(context.get()), SSL_free);
  BIO* const out = BIO_new(BIO_s_mem());
  SSL_set_bio(ssl.get(), BIO_new(BIO_s_mem()), out);
  (void)SSL_connect(ssl.get());
  std::string bytes(4096, '\0');
  bytes.resize(static_cast<std::size_t>(BIO_read(out, bytes.data(), static_cast<int>(bytes.size()))));
  return bytes;
}

/// Returns the duration of `count` log-ins, each behind new silent peers. A turn lasts at most one second, so
/// a log-in that waits for a turn takes about one second.
double logInsBehind(RunningServer& server, int count, const char* from, int silent,
                    const std::string& bytes) {
  const std::string name = "bench-" + std::to_string(bytes.size());
  const auto key = server.addStation(name);
  std::vector<std::unique_ptr<SilentPeer>> peers;
  double total_s = 0;
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < silent; ++k)
      peers.push_back(std::make_unique<SilentPeer>(from, server.server().port(), bytes));
    std::this_thread::sleep_for(milliseconds(50));  // until the server has seen them
    const auto begin = TurnsClock::now();
    EXPECT_TRUE(server.connect(stationLogin(name, key)).ok());
    total_s += std::chrono::duration<double>(TurnsClock::now() - begin).count();
  }
  return total_s;
}

TEST(HandshakeTurns, aRecordThatIsNotThereAsAWholeTakesNone) {
  RunningServer server([](ServerOptions& options) {
    options.bounds.handshakes_at_once = 1;
    options.bounds.handshakes_of_address = 1;
  });
  const std::string whole = clientHello();
  ASSERT_GT(whole.size(), 100u);
  for (const std::size_t sent : {std::size_t{1}, std::size_t{11}, whole.size() - 1}) {
    SCOPED_TRACE(sent);
    server.restart();
    EXPECT_LT(logInsBehind(server, 4, "127.0.0.1", 2, whole.substr(0, sent)), 2.0);
  }
}

TEST(HandshakeTurns, oneAddressNeverHasThemAll) {
  RunningServer server([](ServerOptions& options) {
    options.bounds.handshakes_at_once = 4;
    options.bounds.handshakes_of_address = 2;
  });
  EXPECT_LT(logInsBehind(server, 4, "127.0.0.2", 4, clientHello()), 2.0);
}

// The negative control: a peer that holds all turns delays others by a second; otherwise the tests above
// would show nothing.
TEST(HandshakeTurns, whoHasAllOfThemIsWaitedForForASecond) {
  RunningServer server([](ServerOptions& options) {
    options.bounds.handshakes_at_once = 2;
    options.bounds.handshakes_of_address = 2;
  });
  const double took_s = logInsBehind(server, 1, "127.0.0.1", 2, clientHello());
  EXPECT_GT(took_s, 0.5);
  EXPECT_LT(took_s, 10);
}

}  // namespace
}  // namespace needlelab
