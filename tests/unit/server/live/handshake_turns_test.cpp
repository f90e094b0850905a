// Tests the turns of TLS handshakes under load: connections that never continue must not block others.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;

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

  /// Whether the server's answer begins within `limit`: then it has given this peer a turn.
  [[nodiscard]] bool isAnswered(milliseconds limit) const {
    pollfd waits{fd_, POLLIN, 0};
    char byte = 0;
    return ::poll(&waits, 1, static_cast<int>(limit.count())) == 1 && ::recv(fd_, &byte, 1, MSG_PEEK) == 1;
  }

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

/// A turn, and a handshake as a whole, may last an hour here: a log-in that waits for a silent peer's turn
/// never ends.
constexpr auto kHour = std::chrono::hours(1);

std::function<void(ServerOptions&)> turns(std::size_t at_once, std::size_t of_address) {
  return [=](ServerOptions& options) {
    options.bounds.handshakes_at_once = at_once;
    options.bounds.handshakes_of_address = of_address;
    options.bounds.handshake_turn = kHour;
    options.limits.handshake_timeout = kHour;
  };
}

/// Silent peers. The kernel has their bytes before any later connection; `with_turn` of them have a turn.
std::vector<std::unique_ptr<SilentPeer>> silentPeers(RunningServer& server, std::size_t count,
                                                     std::size_t with_turn, const char* from,
                                                     const std::string& bytes) {
  std::vector<std::unique_ptr<SilentPeer>> peers;
  for (std::size_t i = 0; i < count; ++i)
    peers.push_back(std::make_unique<SilentPeer>(from, server.server().port(), bytes));
  const auto answered = [&] {
    return static_cast<std::size_t>(std::count_if(
        peers.begin(), peers.end(), [](const auto& peer) { return peer->isAnswered(milliseconds(1)); }));
  };
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (answered() < with_turn && std::chrono::steady_clock::now() < end) {
  }
  EXPECT_EQ(answered(), with_turn);
  return peers;
}

Result<BlockingClient> logIn(RunningServer& server, const std::string& key, milliseconds patience) {
  ClientConfig config = server.config(stationLogin("bench", key));
  config.connect_timeout = patience;
  return BlockingClient::connect(config);
}

constexpr auto kPatience = milliseconds(60'000);

TEST(HandshakeTurns, aRecordThatIsNotThereAsAWholeTakesNone) {
  RunningServer server(turns(1, 1));
  const std::string key = server.addStation("bench");
  const std::string whole = clientHello();
  ASSERT_GT(whole.size(), 100u);
  for (const std::size_t sent : {std::size_t{1}, std::size_t{11}, whole.size() - 1}) {
    SCOPED_TRACE(sent);
    server.restart();
    const auto peers = silentPeers(server, 2, 0, "127.0.0.1", whole.substr(0, sent));
    const auto in = logIn(server, key, kPatience);
    EXPECT_TRUE(in.ok()) << in.error().message;
  }
}

TEST(HandshakeTurns, oneAddressNeverHasThemAll) {
  RunningServer server(turns(4, 2));
  const std::string key = server.addStation("bench");
  const auto peers = silentPeers(server, 4, 2, "127.0.0.2", clientHello());
  const auto in = logIn(server, key, kPatience);
  EXPECT_TRUE(in.ok()) << in.error().message;
}

// The negative control: peers that hold all turns keep others waiting; otherwise the tests above would show
// nothing.
TEST(HandshakeTurns, othersWaitWhileAllTurnsAreTaken) {
  RunningServer server(turns(2, 2));
  const std::string key = server.addStation("bench");
  auto peers = silentPeers(server, 2, 2, "127.0.0.1", clientHello());
  EXPECT_FALSE(logIn(server, key, milliseconds(500)).ok());
  peers.clear();
  const auto in = logIn(server, key, kPatience);
  EXPECT_TRUE(in.ok()) << in.error().message;
}

TEST(HandshakeTurns, aTurnEndsWhenItsTimeIsOver) {
  RunningServer server([](ServerOptions& options) {
    turns(2, 2)(options);
    options.bounds.handshake_turn = milliseconds(100);
  });
  const std::string key = server.addStation("bench");
  const auto peers = silentPeers(server, 2, 2, "127.0.0.1", clientHello());
  const auto in = logIn(server, key, kPatience);
  EXPECT_TRUE(in.ok()) << in.error().message;
}

}  // namespace
}  // namespace needlelab
