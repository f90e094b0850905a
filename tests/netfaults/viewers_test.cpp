// Viewers that read nothing, read one byte at a time, or die: they lose their own frames and do not affect
// others. tests/bench/realtime measures what they cost others in time.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "client/net/link/connect.h"
#include "common/base/time/clock.h"
#include "common/wire/protocol.h"
#include "tests/netfaults/viewers.h"
#include "tests/operations/prometheus_text.h"
#include "tests/soak/process_sample.h"
#include "tests/support/patience.h"
#include "tests/support/sanitized.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// Compares a viewer's frame gaps with the reported drops. The next frame of any station reports a drop; the
/// next frame of the same station shows the gap. So the gaps never exceed the reported drops, and are at
/// least those reported before each station's last frame.
class LossLedger {
 public:
  void add(const pb::LiveFrame& frame) {
    const auto [last, first] = last_seq_.try_emplace(frame.station(), frame.frame_seq());
    if (!first) gaps_ += frame.frame_seq() - last->second - 1;
    last->second = frame.frame_seq();
    told_ = frame.dropped_for_you();
    since_mark_.insert(frame.station());
    if (since_mark_.size() < kStreamers) return;
    if (quiet_ = told_ == mark_; quiet_ && !before_) before_ = told_ - gaps_;
    if (before_ && gaps_ < mark_ - *before_) wrong_ = "told of a loss that did not happen";
    if (before_ && gaps_ > told_ - *before_) wrong_ = "a loss was not told";
    settled_ = mark_ - before_.value_or(0);
    mark_ = told_;
    since_mark_.clear();
  }
  /// True after at least one frame of each station without a new loss; losses before the first frame are then
  /// known.
  [[nodiscard]] bool quiet() const { return quiet_; }
  /// Reported losses that were found as gaps.
  [[nodiscard]] std::uint64_t settled() const { return settled_; }
  [[nodiscard]] const std::string& wrong() const { return wrong_; }

 private:
  std::map<std::string, std::uint64_t> last_seq_;
  std::set<std::string> since_mark_;
  std::uint64_t gaps_ = 0, told_ = 0, mark_ = 0, settled_ = 0;
  std::optional<std::uint64_t> before_;  // lost before the first frame: reported, but no gap
  bool quiet_ = false;
  std::string wrong_;
};

/// Reads live frames until `enough`; returns an error message, or empty.
std::string readUntil(BlockingClient& viewer, LossLedger& ledger,
                      const std::function<bool(const pb::LiveFrame&)>& enough) {
  for (const auto until = Clock::now() + kPatience; Clock::now() < until;) {
    const auto got = viewer.receive(50ms);
    if (!got.ok() && got.error().code != ErrorCode::kNotFound) return got.error().message;
    if (!got.ok() || !got->has_live_frame()) continue;
    ledger.add(got->live_frame());
    if (!ledger.wrong().empty()) return ledger.wrong();
    if (enough(got->live_frame())) return {};
  }
  return "the expected message did not come";
}

/// The server never gives up on a viewer.
class ViewersTest : public testing::Test {
 protected:
  explicit ViewersTest(milliseconds patience = 1h)
      : server_([=](ServerOptions& options) {
          withSlowViewers(options, patience);
          options.metrics = "0";
        }),
        instructor_(server_) {
    for (std::size_t i = 0; i < kStreamers; ++i)
      stations_.push_back(std::make_unique<Streamer>(server_, fmt::format("s{}", i), i));
  }
  // Waits until each station had `chunks` more acknowledged.
  [[nodiscard]] bool acknowledges(std::uint64_t chunks) const {
    for (const auto& station : stations_)
      if (!eventually([&, goal = station->acked() + chunks] { return station->acked() >= goal; }))
        return false;
    return true;
  }
  void expectAllAcknowledged() {
    for (const auto& station : stations_) station->stop();
    for (const auto& station : stations_) EXPECT_EQ(station->acked(), station->chunksSent());
  }

  RunningServer server_;
  Instructor instructor_;
  std::vector<std::unique_ptr<Streamer>> stations_;
};

TEST_F(ViewersTest, aHundredSlowOrDeadViewersDelayNoOne) {
  constexpr std::size_t kCrowd = 100;
  std::vector<std::unique_ptr<GoodViewer>> good;
  for (int i = 0; i < 2; ++i) good.push_back(std::make_unique<GoodViewer>(instructor_.connect(false)));
  const Crowd crowd(server_.server().port(), instructor_, kCrowd);
  ASSERT_TRUE(acknowledges(3)) << "until the crowd's sockets are full";

  const auto before = sampleProcess(::getpid());
  std::vector<std::uint64_t> goals;
  for (const auto& viewer : good) goals.push_back(viewer->frames() + 100);
  EXPECT_TRUE(acknowledges(12)) << "chunks are not stored";
  for (std::size_t i = 0; i < good.size(); ++i)
    EXPECT_TRUE(eventually([&] { return good[i]->frames() >= goals[i]; }))
        << "viewer " << i << " gets no frames";
  const auto after = sampleProcess(::getpid());
  // 100 queues with frames of at most 100 ms, not everything sent since; a sanitizer holds freed memory for a
  // while
  const auto grown_KiB = after->anon_KiB - std::min(after->anon_KiB, before->anon_KiB);
  if (!kSanitized) {
    EXPECT_LT(grown_KiB, kCrowd * 64) << "the whole process, server and clients";
  }
  expectAllAcknowledged();
}

TEST_F(ViewersTest, aRecoveredViewerGetsFreshFramesAndEachLossCount) {
  ClientConfig config = instructor_.config(false);
  config.limits.socket_buffer_bytes = 16384;  // full after few frames
  auto standing = BlockingClient::connect(config);
  ASSERT_TRUE(standing.ok()) << standing.error().message;
  watchAll(*standing);
  LossLedger ledger;
  EXPECT_EQ(readUntil(*standing, ledger, [&](const auto&) { return ledger.quiet(); }), "");
  const std::uint64_t before = ledger.settled();
  ASSERT_TRUE(acknowledges(9)) << "45 frames of each station, far more than its sockets hold";
  const auto reads_since_ns = wallNowNs();
  EXPECT_EQ(readUntil(*standing, ledger,
                      [&](const pb::LiveFrame& frame) {
                        return ledger.settled() > before + 10 && frame.capture_unix_ns() > reads_since_ns;
                      }),
            "")
      << "after " << ledger.settled() << " losses";
  expectAllAcknowledged();
}

// replies are never dropped; the server disconnects a client that keeps asking without reading, with a
// reason, and the queue's limit bounds its memory
TEST_F(ViewersTest, aViewerThatIgnoresRepliesIsClosedAtTheQueueLimit) {
  FakeSession big("s9");
  {
    auto writer = server_.connect(stationLogin("s9", server_.addStation("s9")));
    ASSERT_TRUE(writer.ok());
    (void)writer->send(big.open());
    for (std::uint64_t seq = 0; seq < 60; ++seq) (void)writer->send(big.chunk(seq));
    big.waitForAck(*writer, 60);
  }
  std::string reason;
  std::size_t replies = 0;
  asio::io_context io;
  const auto greedy = [&]() -> Task<> {
    auto connected = co_await connectClient(instructor_.config(true));
    EXPECT_TRUE(connected.ok());
    if (!connected.ok()) co_return;
    Channel& channel = *connected->channel;
    pb::Envelope ask;
    ask.mutable_request()->mutable_read_chunks()->set_session_id(big.id());
    ask.mutable_request()->mutable_read_chunks()->set_max_chunks(60);
    for (std::uint64_t id = 1; id <= 600; ++id) {
      ask.mutable_request()->set_id(id);
      channel.send(ask);
    }
    // sends without reading until the server disconnects
    asio::steady_timer pause(io, 2500ms);
    co_await pause.async_wait(kUseTuple);
    for (;;) {
      auto got = co_await channel.receive();
      if (!got.ok()) co_return;
      if (got->has_reply()) ++replies;
      if (got->has_refusal()) reason = got->refusal().text() + " " + reasonName(got->refusal().reason());
    }
  };
  asio::co_spawn(io, greedy(), rethrow);
  io.run_for(kPatience);
  EXPECT_NE(reason.find("QUEUE_OVERFLOW"), std::string::npos) << reason << " after " << replies << " replies";
  EXPECT_LT(replies, 600u);
  expectAllAcknowledged();
}

/// The server gives up on a viewer as soon as a write takes too long.
class ImpatientServerTest : public ViewersTest {
 protected:
  ImpatientServerTest() : ViewersTest(500ms) {}
};

TEST_F(ImpatientServerTest, endsViewersThatNeverReadAgain) {
  const Crowd crowd(server_.server().port(), instructor_, 9);
  const auto open = [&] {
    const Scrape scrape = parsePrometheus(httpGet(server_.server().metricsPort(), "/metrics").body);
    return scrape["needlelab_connections{role=\"instructor\",state=\"authenticated\"}"];
  };
  // those behind the slow network still read
  EXPECT_TRUE(eventually([&] { return open() <= 3; })) << open() << " of 9 are still connected";
  expectAllAcknowledged();
}

}  // namespace
}  // namespace needlelab::test
