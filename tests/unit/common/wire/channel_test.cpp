#include "common/wire/channel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/bio.h>
#include <openssl/ssl.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/unit/common/wire/loopback.h"

namespace needlelab {
namespace {

using std::chrono::milliseconds;
using test::Loopback;
using test::TestTls;

pb::Envelope chunk(std::uint64_t seq, std::size_t bytes = 10) {
  pb::Envelope envelope;
  envelope.mutable_chunk()->set_seq(seq);
  envelope.mutable_chunk()->set_data(std::string(bytes, 'x'));
  return envelope;
}

Frame liveFrame(std::uint64_t seq, std::size_t bytes) {
  pb::Envelope envelope;
  envelope.mutable_live_frame()->set_frame_seq(seq);
  envelope.mutable_live_frame()->set_data(std::string(bytes, 'x'));
  return *encodeFrame(envelope);
}

TEST(Channel, controlMessagesArriveInOrderAndWhole) {
  Loopback loop;
  loop.connect();
  loop.server->established();
  loop.client->established();
  for (std::uint64_t seq = 0; seq < 200; ++seq) ASSERT_TRUE(loop.client->send(chunk(seq, seq * 37 % 5000)));
  ASSERT_TRUE(loop.client->send(chunk(200, 900'000)));
  for (std::uint64_t seq = 0; seq <= 200; ++seq) {
    const auto got = loop.receive(loop.server);
    ASSERT_TRUE(got.ok()) << got.error().message;
    EXPECT_EQ(got->chunk().seq(), seq);
    EXPECT_EQ(got->chunk().data().size(), seq < 200 ? seq * 37 % 5000 : 900'000);
  }
}

// A client that is not a Channel: raw TLS, so that a test can send bytes that a Channel never sends.
class RawClient {
 public:
  explicit RawClient(Loopback& loop, ChannelLimits limits = {}) : loop_(loop) {
    auto [far, near] = loop.sockets();
    loop.server = Channel::make(TlsStream(std::move(far), *TestTls::get().server), limits);
    stream_ = std::make_unique<TlsStream>(std::move(near), *TestTls::get().client);
    int done = 0;
    asio::co_spawn(loop.io, Loopback::shake(loop.server, asio::ssl::stream_base::server, &done), rethrow);
    stream_->async_handshake(asio::ssl::stream_base::client,
                             [&](const boost::system::error_code&) { ++done; });
    EXPECT_TRUE(loop.runUntil([&] { return done == 2; }));
  }
  void write(const std::string& bytes) {
    bool done = false;
    asio::async_write(*stream_, asio::buffer(bytes),
                      [&](const boost::system::error_code&, std::size_t) { done = true; });
    EXPECT_TRUE(loop_.runUntil([&] { return done; }));
  }
  TlsStream& stream() { return *stream_; }

 private:
  Loopback& loop_;
  std::unique_ptr<TlsStream> stream_;
};

TEST(Channel, aPeerThatWritesByteByByteIsUnderstood) {
  Loopback loop;
  RawClient client(loop);
  const std::string body = chunk(5).SerializeAsString();
  std::string bytes;
  appendFrameHeader(bytes, body.size());
  for (const char byte : bytes + body) client.write(std::string(1, byte));
  const auto got = loop.receive(loop.server);
  ASSERT_TRUE(got.ok());
  EXPECT_EQ(got->chunk().seq(), 5u);
}

TEST(Channel, aFrameOver4KiBBeforeLogInIsRefused) {
  Loopback loop;
  RawClient client(loop);
  std::string bytes;
  appendFrameHeader(bytes, kMaxFrameBytesBeforeLogin + 1);
  client.write(bytes);
  const auto got = loop.receive(loop.server);
  ASSERT_FALSE(got.ok());
  EXPECT_EQ(got.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(got.error().message, testing::HasSubstr("4096"));
}

TEST(Channel, aFrameThatIsNoEnvelopeIsCorrupt) {
  Loopback loop;
  RawClient client(loop);
  client.write(std::string("\0\0\0\3\xff\xff\xff", 7));
  const auto got = loop.receive(loop.server);
  ASSERT_FALSE(got.ok());
  EXPECT_EQ(got.error().code, ErrorCode::kCorrupt);
}

TEST(Channel, aPeerThatDisappearsInMidFrameEndsTheChannel) {
  Loopback loop;
  RawClient client(loop);
  client.write(std::string("\0\0\0\x50half", 8));
  client.stream().next_layer().close();
  const auto got = loop.receive(loop.server);
  ASSERT_FALSE(got.ok());
  EXPECT_EQ(got.error().code, ErrorCode::kUnavailable);
  EXPECT_TRUE(loop.server->closed());
  EXPECT_EQ(loop.server->closeReason(), CloseReason::kPeerClosed);
}

TEST(Channel, aHalfOpenPeerTimesOut) {
  Loopback loop;
  ChannelLimits limits;
  limits.idle_timeout = milliseconds(150);
  limits.close_grace = milliseconds(100);
  RawClient client(loop, limits);  // sends nothing and does not close, like a pulled cable
  loop.server->established();
  const auto got = loop.receive(loop.server);
  ASSERT_FALSE(got.ok());
  EXPECT_EQ(loop.server->closeReason(), CloseReason::kIdle);
  EXPECT_TRUE(loop.runUntil([&] { return loop.server->closed(); }));
}

TEST(Channel, aPeerThatNeverLogsInTimesOutDespiteTraffic) {
  Loopback loop;
  ChannelLimits limits;
  limits.handshake_timeout = milliseconds(200);
  limits.close_grace = milliseconds(50);
  RawClient client(loop, limits);
  const std::string slow = std::string("\0\0\x0f\0", 4) + std::string(3000, 'x');
  std::size_t at = 0;
  auto got = std::make_shared<std::optional<Error>>();
  asio::co_spawn(
      loop.io,
      [](std::shared_ptr<Channel> channel, std::shared_ptr<std::optional<Error>> out) -> Task<> {
        auto result = co_await channel->receive();
        out->emplace(result.error());
      }(loop.server, got),
      rethrow);
  while (!got->has_value() && at < slow.size()) {
    client.write(slow.substr(at++, 1));
    loop.runFor(milliseconds(5));
  }
  EXPECT_TRUE(got->has_value());
  EXPECT_EQ(loop.server->closeReason(), CloseReason::kHandshake);
  EXPECT_LT(at, slow.size()) << "it was heard to its end";
}

/// The server's side of the handshake: its result, once it has ended.
std::optional<Status> serverHandshake(Loopback& loop, const std::shared_ptr<Channel>& server) {
  const auto result = std::make_shared<std::optional<Status>>();
  asio::co_spawn(
      loop.io,
      [](std::shared_ptr<Channel> channel, std::shared_ptr<std::optional<Status>> out) -> Task<> {
        auto status = co_await channel->handshake(asio::ssl::stream_base::server);
        out->emplace(std::move(status));
      }(server, result),
      rethrow);
  (void)loop.runUntil([&] { return result->has_value(); });
  return *result;
}

TEST(Channel, whoNeverStartsTlsTimesOut) {
  Loopback loop;
  auto [far, near] = loop.sockets();
  ChannelLimits limits;
  limits.handshake_timeout = milliseconds(100);
  auto server = Channel::make(TlsStream(std::move(far), *TestTls::get().server), limits);
  const auto result = serverHandshake(loop, server);
  ASSERT_TRUE(result.has_value());
  EXPECT_FALSE(result->ok());
  EXPECT_TRUE(server->closed());
}

TEST(Channel, garbageInPlaceOfTlsFailsTheHandshake) {
  Loopback loop;
  auto [far, near] = loop.sockets();
  auto server = Channel::make(TlsStream(std::move(far), *TestTls::get().server), {});
  asio::write(near, asio::buffer(std::string("GET / HTTP/1.1\r\nHost: x\r\n\r\n")));
  ASSERT_TRUE(serverHandshake(loop, server).has_value());
  EXPECT_EQ(server->closeReason(), CloseReason::kHandshake);
}

TEST(Channel, aSlowReaderOfControlMessagesIsDisconnectedByName) {
  Loopback loop;
  ChannelLimits limits;
  limits.control_queue_bytes = 100'000;
  limits.socket_buffer_bytes = 8192;
  limits.close_grace = milliseconds(5000);
  loop.connect(limits, limits);
  loop.server->established();
  loop.client->established();
  int sent = 0;
  while (loop.server->send(chunk(0, 5000)) && sent < 10'000) {
    ++sent;
    loop.io.poll();
  }
  EXPECT_LT(sent, 10'000);
  EXPECT_EQ(loop.server->closeReason(), CloseReason::kQueueOverflow);
  EXPECT_LE(loop.server->controlQueueBytes(), 100'000u);
  // A late reader still gets the reason.
  for (;;) {
    const auto got = loop.receive(loop.client);
    ASSERT_TRUE(got.ok()) << got.error().message;
    if (got->has_chunk()) continue;
    ASSERT_TRUE(got->has_refusal());
    EXPECT_EQ(got->refusal().reason(), pb::Refusal::QUEUE_OVERFLOW);
    EXPECT_TRUE(got->refusal().fatal());
    break;
  }
}

TEST(Channel, aMessagesHoldIsReleasedWhenSentOrDropped) {
  Loopback loop;
  ChannelLimits limits;
  limits.socket_buffer_bytes =
      65'536;  // less than the long message; with much less the network waits for its timers
  loop.connect(limits, limits);
  loop.server->established();
  loop.client->established();
  const auto held = std::make_shared<const int>(0);
  ASSERT_TRUE(loop.server->send(chunk(0, 900'000), held));
  ASSERT_TRUE(loop.server->send(chunk(1), held));
  for (int turn = 0; turn < 1000; ++turn) loop.io.poll();
  EXPECT_LT(loop.server->controlQueueBytes(), 1000u) << "the long message has left the queue";
  EXPECT_EQ(held.use_count(), 3) << "but no one has read it";
  ASSERT_TRUE(loop.receive(loop.client).ok());
  ASSERT_TRUE(loop.receive(loop.client).ok());
  EXPECT_TRUE(loop.runUntil([&] { return held.use_count() == 1; }));
  ASSERT_TRUE(loop.server->send(chunk(2, 900'000), held));
  for (int turn = 0; turn < 1000; ++turn) loop.io.poll();
  EXPECT_EQ(held.use_count(), 2);
  loop.server->close(CloseReason::kLocal, "the test cuts it");
  EXPECT_EQ(held.use_count(), 1);
  EXPECT_FALSE(loop.server->send(chunk(3), held));
  EXPECT_EQ(held.use_count(), 1);
}

TEST(Channel, aPeerThatStopsReadingIsCutByTheWriteTimeOut) {
  Loopback loop;
  ChannelLimits limits;
  limits.socket_buffer_bytes = 8192;
  limits.write_timeout = milliseconds(150);
  loop.connect(limits, limits);
  loop.server->established();
  for (int i = 0; i < 100; ++i) loop.server->send(chunk(0, 20'000));
  EXPECT_TRUE(loop.runUntil([&] { return loop.server->closed(); }));
  EXPECT_EQ(loop.server->closeReason(), CloseReason::kWriteTimeout);
}

TEST(Channel, aSlowReaderLosesTheOldestFramesAndLearnsTheirCount) {
  Loopback loop;
  ChannelLimits limits;
  limits.socket_buffer_bytes = 65536;
  limits.live_age = milliseconds(50);
  loop.connect(limits, limits);
  loop.server->established();
  loop.client->established();
  // one second of frames without a reader: kernel buffers fill up, then the queue drops frames
  std::uint64_t seq = 0;
  for (; seq < 100; ++seq) {
    loop.server->sendLive(liveFrame(seq, 20'000), true);
    loop.runFor(milliseconds(5));
  }
  EXPECT_FALSE(loop.server->closing()) << "a slow viewer is not disconnected for live frames";
  EXPECT_GT(loop.server->live().dropped(), 20u);
  EXPECT_LE(loop.server->live().bytes(), 15u * 20'100u) << "50 ms of frames at 5 ms each, and some room";
  // Now it reads: the frames are in order, the last frame reports all drops, and the counts agree.
  std::uint64_t received = 0, next = 0, told = 0;
  while (received + loop.server->live().dropped() < seq) {
    const auto got = loop.receive(loop.client, milliseconds(20));
    if (!got.ok()) continue;  // meanwhile, too, each frame arrives or is dropped
    const auto& frame = got->live_frame();
    EXPECT_GE(frame.frame_seq(), next);
    next = frame.frame_seq() + 1;
    told = frame.dropped_for_you();
    ++received;
  }
  loop.server->sendLive(liveFrame(seq, 10), true);
  const auto last = loop.receive(loop.client);
  ASSERT_TRUE(last.ok());
  EXPECT_EQ(last->live_frame().dropped_for_you(), loop.server->live().dropped());
  EXPECT_GE(last->live_frame().dropped_for_you(), told);
  EXPECT_EQ(received + loop.server->live().dropped(), seq);
}

TEST(Channel, liveFramesThatFollowCloselyLeaveTogetherAndInOrder) {
  Loopback loop;
  loop.connect();
  loop.server->established();
  loop.client->established();
  const auto written = [&] { return ::BIO_number_written(::SSL_get_wbio(loop.server->ssl())); };
  const std::uint64_t cipher_before = written(), plain_before = loop.server->bytesSent();
  constexpr std::uint64_t kFrames = 200;
  for (std::uint64_t seq = 0; seq < kFrames; ++seq) {
    loop.server->sendLive(liveFrame(seq, 100), true);
    // like single frames from many stations: each arrives in its own turn
    loop.io.poll();
  }
  for (std::uint64_t seq = 0; seq < kFrames; ++seq) {
    const auto got = loop.receive(loop.client);
    ASSERT_TRUE(got.ok()) << got.error().message;
    ASSERT_EQ(got->live_frame().frame_seq(), seq);
  }
  // a TLS 1.3 record adds 22 bytes to its content: header, type, tag
  const std::uint64_t records = (written() - cipher_before - (loop.server->bytesSent() - plain_before)) / 22;
  EXPECT_LT(records, kFrames / 2) << "each frame had a record of its own";
}

TEST(Channel, aFrameAloneDoesNotWaitForOthers) {
  Loopback loop;
  ChannelLimits limits;
  limits.live_gather = std::chrono::hours(1);
  loop.connect(limits);
  loop.server->established();
  loop.client->established();
  loop.server->sendLive(liveFrame(0, 100), true);
  ASSERT_TRUE(loop.receive(loop.client).ok());
  // Alone the next frame would wait; a control message sends it along.
  loop.server->sendLive(liveFrame(1, 100), true);
  EXPECT_FALSE(loop.receive(loop.client, milliseconds(50)).ok());
  loop.server->send(chunk(7));
  EXPECT_TRUE(loop.receive(loop.client)->has_chunk());
  const auto live = loop.receive(loop.client);
  ASSERT_TRUE(live.ok());
  EXPECT_EQ(live->live_frame().frame_seq(), 1u);
}

TEST(Channel, manyRecordsThatAreThereAtOnceAreAllTaken) {
  Loopback loop;
  RawClient client(loop);
  loop.server->established();
  // small ones, a very large one that begins in the middle of a record, small ones again
  std::string bytes;
  for (std::uint64_t seq = 0; seq < 700; ++seq) {
    const std::string body = chunk(seq, seq == 300 ? 1'000'000 : seq % 90).SerializeAsString();
    appendFrameHeader(bytes, body.size());
    bytes += body;
  }
  auto done = std::make_shared<bool>(false);
  auto kept = std::make_shared<std::string>(std::move(bytes));
  asio::async_write(client.stream(), asio::buffer(*kept),
                    [done, kept](const boost::system::error_code&, std::size_t) { *done = true; });
  for (std::uint64_t seq = 0; seq < 700; ++seq) {
    const auto got = loop.receive(loop.server);
    ASSERT_TRUE(got.ok()) << got.error().message;
    ASSERT_EQ(got->chunk().seq(), seq);
    ASSERT_EQ(got->chunk().data().size(), seq == 300 ? 1'000'000 : seq % 90);
  }
  EXPECT_TRUE(loop.runUntil([&] { return *done; }));
}

TEST(Channel, damagedRecordsEndTheChannelAndNothingOfThemIsSeen) {
  Loopback loop;
  RawClient client(loop);
  loop.server->established();
  // bypasses TLS: writes bytes into the socket that are not TLS records
  asio::write(client.stream().next_layer(),
              asio::buffer(std::string("\x17\x03\x03\x00\x20", 5) + std::string(32, 'x')));
  const auto got = loop.receive(loop.server);
  ASSERT_FALSE(got.ok());
  EXPECT_EQ(got.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(loop.server->closeReason(), CloseReason::kNetwork);
}

TEST(Channel, controlOvertakesLive) {
  Loopback loop;
  loop.connect();
  loop.server->established();
  loop.client->established();
  for (int i = 0; i < 10; ++i) loop.server->sendLive(liveFrame(0, 100), true);
  loop.server->send(chunk(77));
  const auto first = loop.receive(loop.client);
  ASSERT_TRUE(first.ok());
  EXPECT_TRUE(first->has_chunk());
}

TEST(Channel, finishSendsTheQueueBeforeClosing) {
  Loopback loop;
  loop.connect();
  loop.client->established();
  for (int i = 0; i < 50; ++i) loop.server->send(chunk(0, 50'000));
  pb::Envelope bye;
  bye.mutable_bye()->set_reason("enough");
  // The client's unread bytes must not turn the close into a reset, which would destroy data in flight.
  loop.client->send(chunk(1));
  loop.runFor(milliseconds(50));
  loop.server->finish(CloseReason::kLocal, "enough", &bye);
  EXPECT_FALSE(loop.server->send(chunk(0))) << "nothing can be sent behind the last message";
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(loop.receive(loop.client).ok()) << i;
  const auto last = loop.receive(loop.client);
  ASSERT_TRUE(last.ok());
  EXPECT_EQ(last->bye().reason(), "enough");
  EXPECT_FALSE(loop.receive(loop.client).ok());
  EXPECT_TRUE(loop.runUntil([&] { return loop.server->closed(); }));
  EXPECT_EQ(loop.server->closeReason(), CloseReason::kLocal);
}

TEST(Channel, finishIsCutAfterItsGrace) {
  Loopback loop;
  ChannelLimits limits;
  limits.close_grace = milliseconds(100);
  limits.socket_buffer_bytes = 8192;
  loop.connect(limits, limits);
  for (int i = 0; i < 50; ++i) loop.server->send(chunk(0, 50'000));
  loop.server->finish(CloseReason::kLocal, "enough");
  EXPECT_TRUE(loop.runUntil([&] { return loop.server->closed(); }));
}

TEST(Channel, silenceIsBrokenByAPing) {
  Loopback loop;
  ChannelLimits limits;
  limits.keepalive = milliseconds(50);
  loop.connect(limits);
  const auto got = loop.receive(loop.client);
  ASSERT_TRUE(got.ok());
  EXPECT_TRUE(got->has_ping());
}

}  // namespace
}  // namespace needlelab
