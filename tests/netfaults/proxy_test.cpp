// The bad network follows its script; the other tests rely on this.
#include <gtest/gtest.h>
#include <poll.h>

#include <array>
#include <mutex>

#include "tests/support/patience.h"
#include "tests/support/proxy/fault_proxy.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// An echo server; records each connection's bytes and its end.
class EchoServer {
 public:
  struct Seen {
    std::string bytes;
    std::string end;  // eof, reset, or empty while open
  };
  EchoServer() : acceptor_(io_, Tcp::endpoint(asio::ip::address_v4::loopback(), 0)) {
    asio::co_spawn(io_, accept(), rethrow);
    thread_ = std::thread([this] { io_.run(); });
  }
  ~EchoServer() {
    io_.stop();
    thread_.join();
  }
  [[nodiscard]] std::uint16_t port() const { return acceptor_.local_endpoint().port(); }
  std::vector<Seen> seen() {
    const std::scoped_lock lock(mutex_);
    return seen_;
  }
  /// Empty if that connection has not come yet.
  Seen seen(std::size_t n) {
    const std::scoped_lock lock(mutex_);
    return n < seen_.size() ? seen_[n] : Seen{};
  }

 private:
  Task<> accept() {
    for (std::size_t n = 0;; ++n) {
      auto [error, socket] = co_await acceptor_.async_accept(kUseTuple);
      if (error) co_return;
      {
        const std::scoped_lock lock(mutex_);
        seen_.emplace_back();
      }
      asio::co_spawn(io_, serve(std::move(socket), n), rethrow);
    }
  }
  Task<> serve(Tcp::socket socket, std::size_t n) {
    std::array<char, 4096> buffer;
    for (;;) {
      auto [error, count] = co_await socket.async_read_some(asio::buffer(buffer), kUseTuple);
      {
        const std::scoped_lock lock(mutex_);
        if (error) seen_[n].end = error == asio::error::eof ? "eof" : "reset";
        seen_[n].bytes.append(buffer.data(), count);
      }
      if (error) co_return;
      auto [failed, written] = co_await asio::async_write(socket, asio::buffer(buffer, count), kUseTuple);
      if (!failed) continue;
      const std::scoped_lock lock(mutex_);
      seen_[n].end = "reset";
      co_return;
    }
  }
  asio::io_context io_{1};
  Tcp::acceptor acceptor_;
  std::mutex mutex_;
  std::vector<Seen> seen_;
  std::thread thread_;
};

/// A plain socket with blocking calls and a time limit on reads.
class Peer {
 public:
  explicit Peer(std::uint16_t port) {
    socket_.connect(Tcp::endpoint(asio::ip::address_v4::loopback(), port));
    socket_.set_option(Tcp::no_delay(true));
  }
  /// May also be called from another thread.
  void send(const std::string& bytes) {
    boost::system::error_code ignored;
    asio::write(socket_, asio::buffer(bytes), ignored);
  }
  /// Reads that many bytes, or fewer at the end of the connection or after `limit`.
  std::string read(std::size_t count, std::chrono::milliseconds limit = kPatience) {
    std::string bytes(count, '\0');
    std::size_t got = 0;
    const auto end = Clock::now() + limit;
    error_ = {};
    while (got < count && !error_) {
      pollfd ready{socket_.native_handle(), POLLIN, 0};
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
      if (left <= 0ms || ::poll(&ready, 1, static_cast<int>(left.count())) <= 0) {
        error_ = asio::error::would_block;
        break;
      }
      got += socket_.read_some(asio::buffer(bytes.data() + got, count - got), error_);
    }
    bytes.resize(got);
    return bytes;
  }
  [[nodiscard]] bool sawEof() const { return error_ == asio::error::eof; }
  [[nodiscard]] bool sawReset() const { return error_ == asio::error::connection_reset; }
  [[nodiscard]] bool sawNothing() const { return error_ == asio::error::would_block; }
  void close() { socket_.close(); }

 private:
  asio::io_context io_;
  Tcp::socket socket_{io_};
  boost::system::error_code error_;
};

FaultProxy::Scripts always(const ConnectionScript& script) {
  return [script](std::uint64_t, Random&) { return script; };
}

std::string pattern(std::size_t bytes) {
  Random random(7);
  std::string text(bytes, '\0');
  for (char& c : text) c = static_cast<char>(random.bits());
  return text;
}

TEST(FaultProxyTest, withoutAScriptAllBytesPassInBothDirections) {
  EchoServer server;
  FaultProxy proxy(server.port());
  Peer peer(proxy.port());
  const std::string bytes = pattern(300'000);
  std::thread sender([&] { peer.send(bytes); });
  EXPECT_EQ(peer.read(bytes.size()), bytes);
  sender.join();
  EXPECT_EQ(proxy.counts().bytes_up, bytes.size());
  peer.close();
  EXPECT_TRUE(eventually([&] { return server.seen(0).end == "eof"; }));
  EXPECT_TRUE(eventually([&] { return proxy.counts().open == 0; }));
}

TEST(FaultProxyTest, delayPiecesAndBandwidthTakeTheirTimeAndKeepTheOrder) {
  EchoServer server;
  ConnectionScript script;
  script.up.delay = 60ms;
  script.down.jitter = 20ms;
  script.up.piece_bytes = 1;
  script.down.bytes_per_s = 20'000;
  FaultProxy proxy(server.port(), 1, always(script));
  Peer peer(proxy.port());
  const std::string bytes = pattern(4000);
  const auto began = Clock::now();
  peer.send(bytes);
  EXPECT_EQ(peer.read(bytes.size()), bytes);
  // 60 ms on the way there, 4000 bytes at 20 kB/s back
  EXPECT_GE(Clock::now() - began, 60ms + 190ms);
}

TEST(FaultProxyTest, aCutComesAfterExactlySoManyBytes) {
  for (const Cut cut : {Cut::kFin, Cut::kReset}) {
    EchoServer server;
    ConnectionScript script;
    script.cut_at = 777;
    script.cut = cut;
    FaultProxy proxy(server.port(), 1, always(script));
    Peer peer(proxy.port());
    peer.send(pattern(2000));
    peer.read(2000);
    EXPECT_TRUE(cut == Cut::kFin ? peer.sawEof() || peer.sawReset() : peer.sawReset());
    EXPECT_TRUE(eventually([&] { return !server.seen(0).end.empty(); }));
    EXPECT_EQ(server.seen(0).end, cut == Cut::kFin ? "eof" : "reset");
    EXPECT_LE(server.seen(0).bytes.size(), 777u);
    if (cut == Cut::kFin) {
      EXPECT_EQ(server.seen(0).bytes, pattern(2000).substr(0, 777));
    }
    EXPECT_EQ(proxy.counts().cuts, 1u);
  }
}

TEST(FaultProxyTest, aHalfOpenConnectionSwallowsAndShowsNoEnd) {
  EchoServer server;
  FaultProxy proxy(server.port());
  auto peer = std::make_unique<Peer>(proxy.port());
  peer->send("before");
  EXPECT_EQ(peer->read(6), "before");
  proxy.cutAll(Cut::kSilent);
  peer->send("after");
  EXPECT_EQ(peer->read(5, 150ms), "");
  EXPECT_TRUE(peer->sawNothing());
  peer->close();
  std::this_thread::sleep_for(50ms);
  EXPECT_EQ(server.seen(0).bytes, "before");
  EXPECT_EQ(server.seen(0).end, "") << "the server must not hear of the end";
  EXPECT_EQ(proxy.counts().silent, 1u);
}

TEST(FaultProxyTest, lateBytesOfAnOlderConnectionComeBehindTheNewerOnes) {
  EchoServer server;
  FaultProxy proxy(server.port(), 1, [](std::uint64_t n, Random&) {
    ConnectionScript script;
    if (n == 0) {
      script.hold_at = 5;
      script.late_after = 60ms;
    }
    return script;
  });
  auto older = std::make_unique<Peer>(proxy.port());
  older->send("first and late");
  EXPECT_TRUE(eventually([&] { return server.seen(0).bytes == "first"; }));
  older->close();
  std::this_thread::sleep_for(50ms);
  EXPECT_EQ(server.seen(0).bytes, "first");
  EXPECT_EQ(server.seen(0).end, "");
  Peer newer(proxy.port());
  newer.send("newer");
  EXPECT_EQ(newer.read(5), "newer");
  EXPECT_TRUE(eventually([&] { return server.seen(0).bytes == "first and late"; }));
  EXPECT_TRUE(eventually([&] { return !server.seen(0).end.empty(); }));
  EXPECT_EQ(proxy.counts().late, 1u);
}

TEST(FaultProxyTest, corruptsOneBitStallsRefusesAndRepeats) {
  EchoServer server;
  FaultProxy proxy(server.port(), 1, [](std::uint64_t n, Random&) {
    ConnectionScript script;
    if (n == 0) script.up.corrupt_at = 100;
    if (n == 1) script.up.stall_at = 10, script.up.stall = 150ms;
    if (n == 2) script.refuse = true;
    if (n == 3) script.duplicates = 2;
    return script;
  });
  const std::string bytes = pattern(200);
  Peer flipped(proxy.port());
  flipped.send(bytes);
  std::string expected = bytes;
  expected[100] ^= 0x10;
  EXPECT_EQ(flipped.read(200), expected);

  Peer stalled(proxy.port());
  const auto began = Clock::now();
  stalled.send(bytes);
  EXPECT_EQ(stalled.read(200), bytes);
  EXPECT_GE(Clock::now() - began, 140ms);

  Peer refused(proxy.port());
  EXPECT_EQ(refused.read(1), "");
  EXPECT_TRUE(refused.sawReset());

  Peer repeated(proxy.port());
  repeated.send(bytes);
  EXPECT_EQ(repeated.read(200), bytes);
  EXPECT_TRUE(eventually([&] {
    const auto seen = server.seen();
    return seen.size() == 5 && seen[3].bytes == bytes && seen[4].bytes == bytes;
  })) << "the original and two repetitions, beside the two before";
}

}  // namespace
}  // namespace needlelab::test
