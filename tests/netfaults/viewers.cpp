#include "tests/netfaults/viewers.h"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <stdexcept>
#include <utility>

#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

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

BlockingClient logIn(RunningServer& server, const std::string& name) {
  auto client = server.connect(stationLogin(name, server.addStation(name)));
  if (!client.ok()) throw std::runtime_error(client.error().message);
  return std::move(*client);
}

}  // namespace

double Delays::at(double share) const {
  if (ms.empty()) return 0;
  std::vector<double> sorted = ms;
  std::sort(sorted.begin(), sorted.end());
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

Streamer::Streamer(RunningServer& server, const std::string& name, std::uint64_t seed)
    : session_(name), client_(logIn(server, name)), thread_([this, seed] { run(seed); }) {}

void Streamer::stop() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

Delays Streamer::take() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(delays_, {});
}

void Streamer::run(std::uint64_t seed) {
  Random random(seed);
  const Bytes noise = noisyFrame(random);
  EXPECT_GT(noise.size(), 800u);
  ASSERT_TRUE(client_.send(session_.open()).ok());
  std::deque<Clock::time_point> sent;
  std::uint64_t frames = 0;
  auto due = Clock::now();
  while (!stop_) {
    due = std::max(due + 20ms, Clock::now() + 1ms);  // late frames are not sent in a burst
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
        delays_.ms.push_back(std::chrono::duration<double, std::milli>(now - sent.front()).count());
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
  // bytes in flight still arrive
  if (acked_ < chunks_) session_.waitForAck(client_, chunks_);
  acked_ = chunks_.load();
  client_.finish();
}

Instructor::Instructor(RunningServer& server) : server_(server) {
  server.addUser("ines", pb::INSTRUCTOR, "correct horse");
  auto first = server.connect(personLogin("ines", "correct horse"));
  if (!first.ok()) throw std::runtime_error(first.error().message);
  token_ = first->welcome().token();
}

ClientConfig Instructor::config(bool small_buffers) const {
  pb::Login login;
  login.set_token(token_);
  ClientConfig config = server_.config(login);
  config.connect_timeout = 60s;
  config.limits.close_grace = 20ms;
  if (small_buffers) config.limits.socket_buffer_bytes = 4096;
  return config;
}

BlockingClient Instructor::connect(bool small_buffers) const {
  auto client = BlockingClient::connect(config(small_buffers));
  if (!client.ok()) throw std::runtime_error(client.error().message);
  return std::move(*client);
}

void watchAll(BlockingClient& client) {
  for (std::uint32_t i = 0; i < kStreamers; ++i) {
    pb::Envelope envelope;
    envelope.mutable_subscribe()->set_subscription(i + 1);
    envelope.mutable_subscribe()->set_station(fmt::format("s{}", i));
    ASSERT_TRUE(client.send(envelope).ok());
  }
}

GoodViewer::GoodViewer(BlockingClient client) : client_(std::move(client)), thread_([this] { run(); }) {}

GoodViewer::~GoodViewer() {
  stop_ = true;
  thread_.join();
}

Delays GoodViewer::take() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(delays_, {});
}

void GoodViewer::run() {
  watchAll(client_);
  while (!stop_) {
    const auto got = client_.receive(20ms);
    if (!got.ok() || !got->has_live_frame()) continue;
    ++frames_;
    const std::scoped_lock lock(mutex_);
    delays_.ms.push_back(1e-6 * static_cast<double>(wallNowNs() - got->live_frame().capture_unix_ns()));
  }
}

Crowd::Crowd(std::uint16_t server_port, const Instructor& instructor, std::size_t viewers)
    : slow_network_(server_port, 1,
                    [](std::uint64_t, Random&) {
                      ConnectionScript script;
                      script.down.slow_from = 4000;  // after the log-in
                      script.down.piece_bytes = 1;
                      script.down.bytes_per_s = 100;
                      return script;
                    }),
      dead_network_(server_port) {
  for (std::size_t i = 0; i < viewers; ++i) {
    ClientConfig config = instructor.config(true);
    if (i % 3 == 1) config.server.port = slow_network_.port();
    if (i % 3 == 2) config.server.port = dead_network_.port();
    auto client = BlockingClient::connect(config);
    if (!client.ok()) throw std::runtime_error(fmt::format("{}: {}", i, client.error().message));
    viewers_.push_back(std::move(*client));
  }
  for (BlockingClient& viewer : viewers_) {
    watchAll(viewer);
    (void)viewer.receive(1ms);  // sends the subscriptions
  }
  dead_network_.cutAll(Cut::kSilent);
}

std::vector<BlockingClient*> Crowd::mute() {
  std::vector<BlockingClient*> mute;
  for (std::size_t i = 0; i < viewers_.size(); i += 3) mute.push_back(&viewers_[i]);
  return mute;
}

void withSlowViewers(ServerOptions& options, milliseconds patience) {
  options.limits.socket_buffer_bytes = 8192;
  options.limits.write_timeout = patience;
  options.limits.idle_timeout = 1h;
  options.limits.close_grace = 5s;
}

}  // namespace needlelab::test
