#include "server/base/listen.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/sockios.h>
#include <netinet/tcp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace needlelab {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;

TEST(Listen, aPortInUseIsReportedPlainly) {
  asio::io_context io;
  const auto first = listenOn(io, *resolveListen("127.0.0.1:0"), "127.0.0.1:0");
  ASSERT_TRUE(first.ok());
  const auto second = listenOn(io, first->local_endpoint(), "127.0.0.1:x");
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().message, testing::HasSubstr("taken"));
}

TEST(Listen, whatIsNoAddressIsInvalid) {
  for (const char* text : {"127.0.0.1:99999", "", "no.such.name.invalid:1"}) {
    EXPECT_EQ(resolveListen(text).error().code, ErrorCode::kInvalidInput) << text;
  }
}

TEST(Listen, theKernelTakesLittleOfWhatAPeerDoesNotRead) {
  asio::io_context io;
  auto acceptor = listenOn(io, *resolveListen("127.0.0.1:0"), "127.0.0.1:0");
  ASSERT_TRUE(acceptor.ok());
  std::optional<Tcp::socket> accepted;
  asio::co_spawn(io,
                 acceptLoop(*acceptor, "accept_failed",
                            [&](Tcp::socket socket) { accepted.emplace(std::move(socket)); }),
                 rethrow);
  Tcp::socket peer(io);
  peer.open(Tcp::v4());
  peer.set_option(asio::socket_base::receive_buffer_size(4096));
  peer.connect(acceptor->local_endpoint());
  while (!accepted) io.run_one_for(std::chrono::milliseconds(20));
  const std::string piece(std::size_t{1} << 20, 'x');
  std::size_t taken = 0;
  for (int i = 0; i < 16; ++i) {
    const ssize_t count =
        ::send(accepted->native_handle(), piece.data(), piece.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    taken += static_cast<std::size_t>(std::max<ssize_t>(count, 0));
  }
  EXPECT_GT(taken, 0u);
  int unsent = 0;
  ASSERT_EQ(::ioctl(accepted->native_handle(), SIOCOUTQNSD, &unsent), 0);
  EXPECT_LE(unsent, 3 * kMaxUnsentBytes);
  EXPECT_LE(taken, 8u * kMaxUnsentBytes) << "with what the peer's kernel took";
  acceptor->close();
  io.run_for(std::chrono::milliseconds(20));
}

/// The server's end of a connection accepted by an acceptLoop, and its peer.
struct AcceptedPair {
  asio::io_context io;
  Result<Tcp::acceptor> acceptor = listenOn(io, *resolveListen("127.0.0.1:0"), "127.0.0.1:0");
  std::optional<Tcp::socket> accepted;
  Tcp::socket peer{io};

  AcceptedPair() {
    asio::co_spawn(io,
                   acceptLoop(*acceptor, "accept_failed",
                              [this](Tcp::socket socket) { accepted.emplace(std::move(socket)); }),
                   rethrow);
    peer.open(Tcp::v4());
    peer.set_option(asio::socket_base::receive_buffer_size(4 << 20));
    peer.connect(acceptor->local_endpoint());
    while (!accepted) io.run_one_for(std::chrono::milliseconds(20));
  }
  ~AcceptedPair() {
    acceptor->close();
    io.run_for(std::chrono::milliseconds(20));
  }
};

/// Bytes that the kernel accepts at once.
std::size_t takenFrom(Tcp::socket& socket) {
  const std::string piece(std::size_t{64} << 10, 'x');
  for (std::size_t taken = 0;;) {
    const ssize_t count =
        ::send(socket.native_handle(), piece.data(), piece.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count <= 0) return taken;
    taken += static_cast<std::size_t>(count);
  }
}

/// Reads what is available. Returns its size in bytes.
std::size_t drainedFrom(Tcp::socket& socket) {
  std::string room(std::size_t{64} << 10, '\0');
  for (std::size_t all = 0;;) {
    const ssize_t count = ::recv(socket.native_handle(), room.data(), room.size(), MSG_DONTWAIT);
    if (count <= 0) return all;
    all += static_cast<std::size_t>(count);
  }
}

int optionOf(Tcp::socket& socket, int level, int option) {
  int value = 0;
  socklen_t size = sizeof value;
  EXPECT_EQ(::getsockopt(socket.native_handle(), level, option, &value, &size), 0);
  return value;
}

TEST(Listen, theKernelsMemoryOfAConnectionHasBoundsThatDoNotGrow) {
  AcceptedPair pair;
  Tcp::socket& socket = *pair.accepted;
  EXPECT_EQ(optionOf(socket, SOL_SOCKET, SO_RCVBUF), 2 * kKernelBufferBytes);
  EXPECT_EQ(optionOf(socket, SOL_SOCKET, SO_SNDBUF), 2 * kKernelBufferBytes);
  EXPECT_EQ(optionOf(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT), kMaxUnsentBytes);
  EXPECT_EQ(optionOf(socket, IPPROTO_TCP, TCP_USER_TIMEOUT), static_cast<int>(kMaxUnacknowledgedMs));
  for (int i = 0; i < 200; ++i) {
    (void)takenFrom(pair.peer);
    (void)drainedFrom(socket);
    (void)takenFrom(socket);
    (void)drainedFrom(pair.peer);
  }
  EXPECT_EQ(optionOf(socket, SOL_SOCKET, SO_RCVBUF), 2 * kKernelBufferBytes);
  EXPECT_EQ(optionOf(socket, SOL_SOCKET, SO_SNDBUF), 2 * kKernelBufferBytes);
}

// The finding: 120 connections of a trainee, whose windows had grown, held 240 MB of requests that the server
// did not read.
TEST(Listen, theKernelTakesLittleOfWhatTheServerDoesNotRead) {
  AcceptedPair pair;
  std::size_t read = 0;  // while the server reads, the kernel lets the window grow
  while (read < 40u << 20) {
    (void)takenFrom(pair.peer);
    read += drainedFrom(*pair.accepted);
  }
  (void)takenFrom(pair.peer);
  int unread = 0;
  ASSERT_EQ(::ioctl(pair.accepted->native_handle(), FIONREAD, &unread), 0);
  EXPECT_GT(unread, 0);
  EXPECT_LE(unread, 2 * kKernelBufferBytes);
}

// The finding: 150 connections of a trainee that acknowledged nothing held 148 MB.
TEST(Listen, theKernelTakesLittleOfWhatAPeerDoesNotAcknowledge) {
  AcceptedPair pair;
  std::size_t read = 0;
  while (read < 40u << 20) {
    (void)takenFrom(*pair.accepted);
    read += drainedFrom(pair.peer);
  }
  // from now on the peer's kernel drops everything that arrives
  sock_filter drop_all{BPF_RET | BPF_K, 0, 0, 0};
  const sock_fprog filter{1, &drop_all};
  ASSERT_EQ(::setsockopt(pair.peer.native_handle(), SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter), 0);
  (void)takenFrom(*pair.accepted);
  int unacknowledged = 0;
  ASSERT_EQ(::ioctl(pair.accepted->native_handle(), SIOCOUTQ, &unacknowledged), 0);
  EXPECT_GT(unacknowledged, 0);
  EXPECT_LE(unacknowledged, 3 * kKernelBufferBytes) << "with a segment of the loopback (64 KiB) too much";
}

TEST(Listen, allWhoWaitAreAcceptedInTurnsOfABoundedNumber) {
  constexpr std::size_t kWaiting = kAcceptsATurn + 10;
  asio::io_context io;
  auto acceptor = listenOn(io, *resolveListen("127.0.0.1:0"), "127.0.0.1:0");
  ASSERT_TRUE(acceptor.ok());
  std::vector<Tcp::socket> peers, accepted;
  for (std::size_t i = 0; i < kWaiting; ++i) {
    peers.emplace_back(io);
    peers.back().connect(acceptor->local_endpoint());
  }
  asio::co_spawn(io,
                 acceptLoop(*acceptor, "accept_failed",
                            [&](Tcp::socket socket) { accepted.push_back(std::move(socket)); }),
                 rethrow);
  while (accepted.empty()) io.run_one_for(std::chrono::milliseconds(20));
  EXPECT_EQ(accepted.size(), static_cast<std::size_t>(kAcceptsATurn));
  while (accepted.size() < kWaiting) io.run_one_for(std::chrono::milliseconds(20));
  // the next one is accepted when it arrives
  peers.emplace_back(io);
  peers.back().connect(acceptor->local_endpoint());
  while (accepted.size() < kWaiting + 1) io.run_one_for(std::chrono::milliseconds(20));
  acceptor->close();
  io.run_for(std::chrono::milliseconds(20));
}

TEST(Listen, theCertificateNamesWhatTheServerIsCalled) {
  const auto names = certificateNames("192.0.2.7:7750", {"lab.example"}, {"example"});
  EXPECT_THAT(names.hosts, ElementsAre("lab.example", "192.0.2.7"));
  for (const char* host : {"localhost", "127.0.0.1", "::1"}) EXPECT_THAT(names.own, Contains(host).Times(1));
  EXPECT_THAT(names.domains, ElementsAre("example"));
  EXPECT_THAT(certificateNames("0.0.0.0:7750", {}, {}).hosts, IsEmpty());
  EXPECT_THAT(certificateNames("[::]:7750", {}, {}).hosts, IsEmpty());
  EXPECT_THAT(certificateNames("localhost:7750", {}, {}).hosts, IsEmpty()) << "its own already";
}

}  // namespace
}  // namespace needlelab
