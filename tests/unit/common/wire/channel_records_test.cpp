// The load that TLS records may put on a channel's thread: key changes, and nearly empty records.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/ssl.h>

#include <boost/asio/post.hpp>
#include <memory>
#include <string>
#include <vector>

#include "common/wire/channel.h"
#include "tests/unit/common/wire/loopback.h"

namespace needlelab {
namespace {

using test::Loopback;

pb::Envelope numberedChunk(std::uint64_t seq, std::size_t bytes = 10) {
  pb::Envelope envelope;
  envelope.mutable_chunk()->set_seq(seq);
  envelope.mutable_chunk()->set_data(std::string(bytes, 'x'));
  return envelope;
}

/// The KeyUpdate is sent with the channel's next message.
void changeKeys(Channel& channel) {
  ASSERT_EQ(SSL_key_update(channel.ssl(), SSL_KEY_UPDATE_NOT_REQUESTED), 1);
  ASSERT_EQ(SSL_do_handshake(channel.ssl()), 1);
}

struct SendingEnds {
  std::shared_ptr<Channel> from, to;
};

/// The ends of `loop`: the sender first, then the receiver; `client_sends`: the client is the sender.
SendingEnds endsOf(const Loopback& loop, bool client_sends) {
  return client_sends ? SendingEnds{loop.client, loop.server} : SendingEnds{loop.server, loop.client};
}

class ChannelKeys : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    loop_.connect();
    loop_.server->established();
    loop_.client->established();
    ends_ = endsOf(loop_, GetParam());
  }
  /// Whether the next message from `from` arrives.
  bool arrives(std::size_t bytes = 10) {
    ends_.from->send(numberedChunk(++seq_, bytes));
    const auto got = loop_.receive(ends_.to);
    return got.ok() && got->chunk().seq() == seq_;
  }

  Loopback loop_;
  SendingEnds ends_;
  std::uint64_t seq_ = 0;
};

TEST_P(ChannelKeys, aPeerMayChangeKeysAFewTimesBeforeBeingCut) {
  for (std::uint64_t change = 0; change < kMaxKeyUpdates; ++change) {
    changeKeys(*ends_.from);
    ASSERT_TRUE(arrives()) << change;
  }
  changeKeys(*ends_.from);
  EXPECT_FALSE(arrives());
  EXPECT_TRUE(ends_.to->closed());
  EXPECT_EQ(ends_.to->closeReason(), CloseReason::kNetwork);
  EXPECT_THAT(ends_.to->closeText(), testing::HasSubstr("keys"));
}

TEST_P(ChannelKeys, ofManyKeyChangesTlsReadsOneTooMany) {
  for (int change = 0; change < 2000; ++change) changeKeys(*ends_.from);
  EXPECT_FALSE(arrives());
  EXPECT_TRUE(ends_.to->closed());
  EXPECT_EQ(keyUpdatesOf(ends_.to->ssl()), kMaxKeyUpdates + 1);
}

TEST_P(ChannelKeys, eachMiBThatIsSentAllowsAnotherChange) {
  for (std::uint64_t change = 0; change < kMaxKeyUpdates; ++change) changeKeys(*ends_.from);
  ASSERT_TRUE(arrives());
  // 1.8 MB: one MiB and less than two
  ASSERT_TRUE(arrives(900'000));
  ASSERT_TRUE(arrives(900'000));
  changeKeys(*ends_.from);
  EXPECT_TRUE(arrives());
  changeKeys(*ends_.from);
  EXPECT_FALSE(arrives());
}

TEST_P(ChannelKeys, eachMiBThatIsReceivedAllowsAnotherChange) {
  for (std::uint64_t change = 0; change < kMaxKeyUpdates; ++change) changeKeys(*ends_.from);
  ASSERT_TRUE(arrives());
  for (int i = 0; i < 2; ++i) {
    ends_.to->send(numberedChunk(0, 900'000));
    ASSERT_TRUE(loop_.receive(ends_.from).ok());
  }
  changeKeys(*ends_.from);
  EXPECT_TRUE(arrives());
}

INSTANTIATE_TEST_SUITE_P(BothEnds, ChannelKeys, testing::Bool(), [](const auto& of) {
  return std::string(of.param ? "ofTheClient" : "ofTheServer");
});

struct ReadTurns {
  std::vector<std::uint64_t> bytes;       // taken by each turn of the reader
  std::vector<std::uint64_t> neighbours;  // the neighbour's turns until then
  std::uint64_t neighbour = 0;
  bool over = false;
};

Task<> readInTurns(std::shared_ptr<Channel> channel, std::uint64_t bytes, std::shared_ptr<ReadTurns> turns) {
  while (channel->bytesReceived() < bytes) {
    const std::uint64_t before = channel->bytesReceived();
    const Status more = co_await channel->readMore();
    if (!more.ok()) break;
    turns->bytes.push_back(channel->bytesReceived() - before);
    turns->neighbours.push_back(turns->neighbour);
  }
  turns->over = true;
}

Task<> takeTurnsBeside(asio::io_context& io, std::shared_ptr<ReadTurns> turns) {
  while (!turns->over) {
    co_await asio::post(io, asio::use_awaitable);
    ++turns->neighbour;
  }
}

TEST(ChannelRecords, aTurnReadsABoundedNumberAndOthersGetTurns) {
  Loopback loop;
  loop.connect();
  loop.server->established();
  const std::string body = numberedChunk(5, 1000).SerializeAsString();
  std::string bytes;
  appendFrameHeader(bytes, body.size());
  bytes += body;
  for (const char byte : bytes) {
    std::size_t written = 0;
    ASSERT_EQ(SSL_write_ex(loop.client->ssl(), &byte, 1, &written), 1);
  }
  // sends them all, and itself as one record
  ASSERT_TRUE(loop.client->send(numberedChunk(6)));
  ASSERT_TRUE(loop.runUntil([&] { return loop.client->bytesSent() > 0; }));

  const auto turns = std::make_shared<ReadTurns>();
  asio::co_spawn(loop.io, takeTurnsBeside(loop.io, turns), rethrow);
  asio::co_spawn(loop.io, readInTurns(loop.server, bytes.size(), turns), rethrow);
  ASSERT_TRUE(loop.runUntil([&] { return turns->over; }));
  ASSERT_GE(turns->bytes.size(), bytes.size() / Channel::kRecordsATurn);
  // the last turn also has the other message's record
  for (std::size_t turn = 0; turn + 1 < turns->bytes.size(); ++turn) {
    EXPECT_LE(turns->bytes[turn], static_cast<std::uint64_t>(Channel::kRecordsATurn)) << turn;
    EXPECT_LT(turns->neighbours[turn], turns->neighbours[turn + 1]) << turn;
  }
  for (const std::uint64_t seq : {5u, 6u}) {
    const auto got = loop.receive(loop.server);
    ASSERT_TRUE(got.ok()) << got.error().message;
    EXPECT_EQ(got->chunk().seq(), seq);
  }
  // the neighbour must end before the loop
  loop.runFor(Loopback::Ms(1));
}

}  // namespace
}  // namespace needlelab
