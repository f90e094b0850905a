// TLS while a program ends, and limits of a peer's handshake.
#include "common/wire/tls.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "tests/unit/common/wire/loopback.h"

namespace needlelab {
namespace {

constexpr int kStillWorks = 7, kWorksNoMore = 9;

/// Returns whether TLS works: then only the file is missing.
bool tlsWorks() {
  const auto made = makeClientTls("/nowhere/ca.crt");
  return !made.ok() && made.error().code == ErrorCode::kInvalidInput;
}

/// Xlib calls `exit` when its display is lost. The station's handler, registered before its first use of TLS,
/// then lets the lesson be sent.
[[noreturn]] void exitWhileALessonIsSent() {
  keepTlsAtExit();
  std::atexit([] { ::_exit(tlsWorks() ? kStillWorks : kWorksNoMore); });
  if (!tlsWorks()) ::_exit(kWorksNoMore);
  std::exit(1);
}

// in a separate process that has not used TLS before
TEST(TlsDeathTest, isThereForAThreadThatSendsWhileTheProgramExits) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(exitWhileALessonIsSent(), testing::ExitedWithCode(kStillWorks), "");
}

/// The first `records` records of a ClientHello of 65,536 bytes, with one byte each: 6 bytes of TLS.
Bytes helloInRecordsOfOneByte(std::size_t records) {
  const Bytes message_header{1, 1, 0, 0};  // ClientHello, its length
  Bytes all;
  for (std::size_t i = 0; i < records; ++i) {
    const std::uint8_t content = i < message_header.size() ? message_header[i] : std::uint8_t{0};
    for (const std::uint8_t byte :
         {std::uint8_t{22}, std::uint8_t{3}, std::uint8_t{1}, std::uint8_t{0}, std::uint8_t{1}, content})
      all.push_back(byte);
  }
  return all;
}

TEST(TlsHandshake, endsAtItsByteBoundBeforeTheMessageIsComplete) {
  constexpr std::size_t kRecordsInBound = kMaxHandshakeBytes / 6;
  SSL* const ssl = SSL_new(test::TestTls::get().server->native_handle());
  TlsEngine engine(ssl);
  SSL_free(ssl);
  const Bytes within = helloInRecordsOfOneByte(kRecordsInBound);
  engine.feed(within);
  EXPECT_EQ(engine.handshake(true), TlsStep::kWantsInput);
  const Bytes beyond = helloInRecordsOfOneByte(1000);
  engine.feed(beyond);
  EXPECT_EQ(engine.handshake(true), TlsStep::kFailed);
  EXPECT_THAT(engine.failure(), testing::HasSubstr("handshake is too long"));
  EXPECT_TRUE(engine.hasInput()) << "the rest was not read";
}

Bytes bytesOfOutput(const TlsEngine& engine) {
  return {engine.output().begin(), engine.output().end()};
}

/// A handshake in which both sides offer these groups; empty: our programs' own.
bool shakeHands(std::string clients_groups, std::string servers_groups) {
  SSL* const near = SSL_new(test::TestTls::get().client->native_handle());
  SSL* const far = SSL_new(test::TestTls::get().server->native_handle());
  const auto limit = [](SSL* ssl, std::string& groups) {
    return groups.empty() || SSL_ctrl(ssl, SSL_CTRL_SET_GROUPS_LIST, 0, groups.data()) == 1;
  };
  EXPECT_TRUE(limit(near, clients_groups));
  EXPECT_TRUE(limit(far, servers_groups));
  TlsEngine client(near), server(far);
  SSL_free(near);
  SSL_free(far);
  TlsStep client_step = TlsStep::kWantsInput, server_step = TlsStep::kWantsInput;
  Bytes hello, answer;  // an engine's input must exist until it was read
  for (int flight = 0; flight < 4; ++flight) {
    client_step = client.handshake(false);
    hello = bytesOfOutput(client);
    client.sent(hello.size());
    server.feed(hello);
    server_step = server.handshake(true);
    answer = bytesOfOutput(server);
    server.sent(answer.size());
    client.feed(answer);
  }
  return client_step == TlsStep::kDone && server_step == TlsStep::kDone;
}

TEST(TlsHandshake, takesCurvesOnlyAtBothSides) {
  EXPECT_TRUE(shakeHands("", ""));
  for (const char* const curve : {"X25519", "P-256", "P-384"}) {
    EXPECT_TRUE(shakeHands(curve, "")) << curve;
    EXPECT_TRUE(shakeHands("", curve)) << curve;
  }
  for (const char* const other : {"ffdhe2048", "ffdhe8192", "P-521", "X448"}) {
    EXPECT_FALSE(shakeHands(other, "")) << other;
    EXPECT_FALSE(shakeHands("", other)) << other;
  }
}

TEST(TlsHandshake, ofOurProgramsHasAThirdOfTheBoundAtMost) {
  std::size_t from_client = 0, from_server = 0;
  SSL* const near = SSL_new(test::TestTls::get().client->native_handle());
  SSL* const far = SSL_new(test::TestTls::get().server->native_handle());
  TlsEngine client(near), server(far);
  SSL_free(near);
  SSL_free(far);
  TlsStep client_step = TlsStep::kWantsInput, server_step = TlsStep::kWantsInput;
  Bytes hello, answer;
  for (int flight = 0; flight < 4; ++flight) {
    client_step = client.handshake(false);
    hello = bytesOfOutput(client);
    client.sent(hello.size());
    from_client += hello.size();
    server.feed(hello);
    server_step = server.handshake(true);
    answer = bytesOfOutput(server);
    server.sent(answer.size());
    from_server += answer.size();
    client.feed(answer);
  }
  EXPECT_EQ(client_step, TlsStep::kDone);
  EXPECT_EQ(server_step, TlsStep::kDone);
  EXPECT_LE(std::max(from_client, from_server), kMaxHandshakeBytes / 3);
}

}  // namespace
}  // namespace needlelab
