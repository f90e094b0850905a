// Viewers that read nothing, read one byte at a time, or die: they lose their own frames and do not affect
// others. tests/bench/realtime measures what they cost others in time.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <memory>

#include "tests/netfaults/viewers.h"
#include "tests/operations/prometheus_text.h"
#include "tests/soak/process_sample.h"
#include "tests/support/patience.h"
#include "tests/support/sanitized.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

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
