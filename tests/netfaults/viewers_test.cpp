// Viewers who read nothing, a byte at a time, or die: they lose their own frames, and nobody else notices.
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <iostream>

#include "base/clock.h"
#include "net/client.h"
#include "proxy/fault_proxy.h"
#include "server/running_server.h"
#include "soak/process_sample.h"
#include "wire/refusal.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kStations = 3, kGoodViewers = 2, kBadViewers = 100;

/// 20 samples of noise: frames of full size.
Bytes noisyFrame(Random& random) {
  std::vector<GestureSample> samples(20);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = i;
    for (double& x : samples[i].p_WT_m) x = random.in(-1, 1);
    for (double& x : samples[i].force_W_N) x = random.in(-50, 50);
    for (double& x : samples[i].torque_W_Nm) x = random.in(-50, 50);
    for (double& x : samples[i].wall_W_m) x = random.in(-1, 1);
    samples[i].speed_mps = random.in(-1, 1);
    samples[i].insertion_m = random.in(0, 1);
  }
  return encodeChunk(Resolution::standard(), samples);
}

struct Times {
  std::vector<double> ms;
  [[nodiscard]] double at(double share) {
    if (ms.empty()) return 1e9;
    std::sort(ms.begin(), ms.end());
    return ms[static_cast<std::size_t>(share * static_cast<double>(ms.size() - 1))];
  }
};

/// A station that streams: a live frame each 20 ms, a chunk each 100 ms, and how long each ack took.
class Streamer {
 public:
  Streamer(RunningServer& server, const std::string& name, std::uint64_t seed)
      : session_(name), client_(logIn(server, name)) {
    thread_ = std::thread([this, seed] { run(seed); });
  }
  ~Streamer() { stop(); }
  void stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  /// Ack times since the last call.
  Times take() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(times_, {});
  }
  [[nodiscard]] std::uint64_t acked() const { return acked_; }
  [[nodiscard]] std::uint64_t chunksSent() const { return chunks_; }

 private:
  static BlockingClient logIn(RunningServer& server, const std::string& name) {
    auto client = server.connect(stationLogin(name, server.addStation(name)));
    if (!client.ok()) throw std::runtime_error(client.error().message);
    return std::move(*client);
  }
  void run(std::uint64_t seed) {
    Random random(seed);
    const Bytes noise = noisyFrame(random);
    EXPECT_GT(noise.size(), 800u);
    ASSERT_TRUE(client_.send(session_.open()).ok());
    std::deque<Clock::time_point> sent;
    std::uint64_t frames = 0;
    auto due = Clock::now();
    while (!stop_) {
      due += 20ms;
      for (;;) {
        const auto left = std::chrono::duration_cast<milliseconds>(due - Clock::now());
        if (left <= 0ms) break;
        const auto got = client_.receive(left);
        if (!got.ok() && got.error().code != ErrorCode::kNotFound) {
          ADD_FAILURE() << "a station lost its connection: " << got.error().message;
          return;
        }
        if (!got.ok() || !got->has_ack()) continue;
        const auto now = Clock::now();
        const std::scoped_lock lock(mutex_);
        for (; acked_ < got->ack().committed_seqs(); ++acked_, sent.pop_front())
          times_.ms.push_back(std::chrono::duration<double, std::milli>(now - sent.front()).count());
      }
      pb::Envelope frame;
      frame.mutable_live_frame()->set_session_id(session_.id());
      frame.mutable_live_frame()->set_frame_seq(frames);
      frame.mutable_live_frame()->set_data(noise.data(), noise.size());
      frame.mutable_live_frame()->set_capture_unix_ns(wallNowNs());
      (void)client_.send(frame);
      if (frames++ % 5 == 0) {
        (void)client_.send(session_.chunk(chunks_++));
        sent.push_back(Clock::now());
      }
    }
    // what is on its way still comes
    if (acked_ < chunks_) session_.waitForAck(client_, chunks_);
    acked_ = chunks_.load();
    client_.finish();
  }
  FakeSession session_;
  BlockingClient client_;
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> acked_{0}, chunks_{0};
  std::mutex mutex_;
  Times times_;
  std::thread thread_;
};

void watchAll(BlockingClient& client) {
  for (std::uint32_t i = 0; i < kStations; ++i) {
    pb::Envelope envelope;
    envelope.mutable_subscribe()->set_subscription(i + 1);
    envelope.mutable_subscribe()->set_station("s" + std::to_string(i));
    ASSERT_TRUE(client.send(envelope).ok());
  }
}

/// A viewer who reads all that comes, and when.
class GoodViewer {
 public:
  explicit GoodViewer(BlockingClient client) : client_(std::move(client)) {
    thread_ = std::thread([this] { run(); });
  }
  ~GoodViewer() {
    stop_ = true;
    thread_.join();
  }
  Times take() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(times_, {});
  }

 private:
  void run() {
    watchAll(client_);
    while (!stop_) {
      const auto got = client_.receive(20ms);
      if (!got.ok() || !got->has_live_frame()) continue;
      const std::scoped_lock lock(mutex_);
      times_.ms.push_back(1e-6 * static_cast<double>(wallNowNs() - got->live_frame().capture_unix_ns()));
    }
  }
  BlockingClient client_;
  std::atomic<bool> stop_{false};
  std::mutex mutex_;
  Times times_;
  std::thread thread_;
};

class ViewersTest : public testing::Test {
 protected:
  ViewersTest()
      : server_([](ServerOptions& options) {
          options.limits.socket_buffer_bytes = 8192;  // so that a viewer is slow after few bytes
          options.limits.write_timeout = 2500ms;
          options.limits.close_grace = 5s;
        }) {
    server_.addUser("ines", pb::INSTRUCTOR, "password1");
    auto first = server_.connect(personLogin("ines", "password1"));
    if (!first.ok()) throw std::runtime_error(first.error().message);
    token_ = first->welcome().token();
  }
  [[nodiscard]] ClientConfig viewerConfig(bool small_buffers) {
    pb::Login login;
    login.set_token(token_);
    ClientConfig config = server_.config(login);
    config.connect_timeout = 20s;
    config.limits.close_grace = 20ms;
    if (small_buffers) config.limits.socket_buffer_bytes = 4096;
    return config;
  }
  BlockingClient viewer(bool small_buffers) {
    auto client = BlockingClient::connect(viewerConfig(small_buffers));
    if (!client.ok()) throw std::runtime_error(client.error().message);
    return std::move(*client);
  }

  RunningServer server_;
  std::string token_;
};

TEST_F(ViewersTest, aHundredSlowOrDeadViewersHoldNobodyUp) {
  std::vector<std::unique_ptr<Streamer>> stations;
  for (std::size_t i = 0; i < kStations; ++i)
    stations.push_back(std::make_unique<Streamer>(server_, "s" + std::to_string(i), i));
  std::vector<std::unique_ptr<GoodViewer>> good;
  for (std::size_t i = 0; i < kGoodViewers; ++i) good.push_back(std::make_unique<GoodViewer>(viewer(false)));

  const auto measure = [&](std::chrono::milliseconds time) {
    for (const auto& station : stations) station->take();
    for (const auto& each : good) each->take();
    std::this_thread::sleep_for(time);
    std::pair<Times, Times> all;
    for (const auto& station : stations)
      for (const double ms : station->take().ms) all.first.ms.push_back(ms);
    for (const auto& each : good)
      for (const double ms : each->take().ms) all.second.ms.push_back(ms);
    return all;
  };
  std::this_thread::sleep_for(300ms);
  auto [acks, live] = measure(1200ms);

  // a third reads nothing, a third gets single bytes through a bad network, a third dies without a word
  FaultProxy slow_network(server_.server().port(), 1, [](std::uint64_t, Random&) {
    ConnectionScript script;
    script.down.slow_from = 4000;  // behind the log-in
    script.down.piece_bytes = 1;
    script.down.bytes_per_s = 100;
    return script;
  });
  FaultProxy dead_network(server_.server().port());
  std::vector<BlockingClient> bad;
  for (std::size_t i = 0; i < kBadViewers; ++i) {
    ClientConfig config = viewerConfig(true);
    if (i % 3 == 1) config.server.port = slow_network.port();
    if (i % 3 == 2) config.server.port = dead_network.port();
    auto client = BlockingClient::connect(config);
    ASSERT_TRUE(client.ok()) << i << ": " << client.error().message;
    watchAll(*client);
    (void)client->receive(1ms);  // sends the subscriptions
    bad.push_back(std::move(*client));
  }
  dead_network.cutAll(Cut::kSilent);
  const auto silent_since = Clock::now();
  std::this_thread::sleep_for(300ms);  // until their sockets are full
  const auto memory_before = sampleProcess(::getpid());
  auto [acks_beside, live_beside] = measure(1200ms);
  const auto memory_after = sampleProcess(::getpid());
  const auto line = [](const char* what, Times& alone, Times& beside) {
    std::cout << what << ": p50 " << alone.at(0.5) << " ms, p95 " << alone.at(0.95) << " ms alone; p50 "
              << beside.at(0.5) << " ms, p95 " << beside.at(0.95) << " ms beside " << kBadViewers
              << " slow or dead viewers\n";
  };
  line("acks", acks, acks_beside);
  line("live", live, live_beside);
  EXPECT_GT(acks_beside.ms.size(), acks.ms.size() / 2);
  EXPECT_GT(live_beside.ms.size(), live.ms.size() / 2);
  EXPECT_LT(acks_beside.at(0.5), 4 * acks.at(0.5) + 40);
  EXPECT_LT(live_beside.at(0.5), 4 * live.at(0.5) + 40);
  // 100 queues of frames that are 100 ms old at most, not all that was sent since
  const std::uint64_t grown_KiB =
      memory_after->anon_KiB - std::min(memory_after->anon_KiB, memory_before->anon_KiB);
  std::cout << "memory grew by " << grown_KiB << " KiB while they did not read\n";
  EXPECT_LT(grown_KiB, kBadViewers * 64) << "the whole process, server and clients";

  // who reads again gets fresh frames, and is told of every one that it lost. The newest of them: the others
  // may have stood still for longer than the server waits, because a hundred log-ins took their time
  static_assert(kBadViewers % 3 == 1, "the last one is on a good network");
  std::map<std::string, std::uint64_t> last_seq;
  std::uint64_t gaps = 0, told = 0;
  double newest_ms = 1e9;
  const auto until = Clock::now() + 5s;
  while (Clock::now() < until && !(told > 0 && told == gaps && newest_ms < 500)) {
    const auto got = bad.back().receive(50ms);
    if (!got.ok() && got.error().code != ErrorCode::kNotFound) {
      ADD_FAILURE() << got.error().message;
      break;
    }
    if (!got.ok() || !got->has_live_frame()) continue;
    const pb::LiveFrame& frame = got->live_frame();
    const auto [last, first] = last_seq.try_emplace(frame.station(), frame.frame_seq());
    if (!first) gaps += frame.frame_seq() - last->second - 1;
    last->second = frame.frame_seq();
    told = std::max<std::uint64_t>(told, frame.dropped_for_you());
    newest_ms = 1e-6 * static_cast<double>(wallNowNs() - frame.capture_unix_ns());
  }
  std::cout << "a viewer who read again lost " << gaps << " frames and was told of " << told << "\n";
  EXPECT_GT(told, 10u);
  EXPECT_EQ(told, gaps);

  // who never reads again is ended by the server: the write took too long
  std::this_thread::sleep_until(silent_since + 2500ms + 2500ms / 4 + 1s);
  for (std::size_t i = 3; i < bad.size(); i += 30) {
    const auto end = Clock::now() + 5s;
    Result<pb::Envelope> got = bad[i].receive(50ms);
    while ((got.ok() || got.error().code == ErrorCode::kNotFound) && Clock::now() < end)
      got = bad[i].receive(50ms);
    EXPECT_FALSE(got.ok()) << "viewer " << i << " is still connected";
    EXPECT_FALSE(bad[i].connected());
  }
  for (const auto& station : stations) station->stop();
  for (const auto& station : stations) EXPECT_EQ(station->acked(), station->chunksSent());
}

// replies are never dropped; who asks and asks and does not read is sent away with a reason, and its memory
// is bounded by the queue's limit
TEST_F(ViewersTest, aViewerWhoDoesNotReadItsRepliesIsEndedByTheQueuesLimit) {
  Streamer station(server_, "s0", 1);
  FakeSession big("s1");
  {
    auto writer = server_.connect(stationLogin("s1", server_.addStation("s1")));
    ASSERT_TRUE(writer.ok());
    (void)writer->send(big.open());
    for (std::uint64_t seq = 0; seq < 60; ++seq) (void)writer->send(big.chunk(seq));
    big.waitForAck(*writer, 60);
  }
  asio::io_context io;
  std::string reason;
  std::size_t replies = 0;
  const auto greedy = [&]() -> Task<> {
    auto connected = co_await connectClient(viewerConfig(true));
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
    // sends, and does not read a byte, until the server has had enough
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
  io.run_for(20s);
  EXPECT_NE(reason.find("QUEUE_OVERFLOW"), std::string::npos) << reason << " after " << replies << " replies";
  EXPECT_LT(replies, 600u);
  station.stop();
  EXPECT_EQ(station.acked(), station.chunksSent());
}

}  // namespace
}  // namespace needlelab::test
