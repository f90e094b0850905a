#include "server/base/listen.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>

namespace needlelab {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;

TEST(Listen, aTakenPortIsSaidPlainly) {
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
  EXPECT_LE(unsent, 3 * kMostUnsentBytes);
  EXPECT_LE(taken, 8u * kMostUnsentBytes) << "with what the peer's kernel took";
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
