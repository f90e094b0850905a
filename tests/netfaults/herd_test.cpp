// A thundering herd: the server is killed under load, and all stations reconnect at once.
#include <fmt/core.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/net/server_link.h"
#include "client/net/spool.h"
#include "client/net/uplink.h"
#include "common/base/files.h"
#include "common/base/uuid.h"
#include "common/gesture/chunk.h"
#include "common/gesture/session_hash.h"
#include "common/wire/protocol.h"
#include "common/wire/tls.h"
#include "server/server.h"
#include "tests/integration/process.h"
#include "tests/soak/process_sample.h"
#include "tests/support/random.h"
#include "tests/support/run_form.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

/// The herd's server: a process on a folder with many stations, killed and restarted.
class HerdServer {
 public:
  /// Makes the folder and `stations` keys, then starts the program.
  explicit HerdServer(std::size_t stations);
  /// Restarts on the same port.
  void start();
  void kill();
  /// SIGTERM; the exit code.
  int stop();
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] const TlsContext& tls() const { return tls_; }
  [[nodiscard]] const std::string& key(std::size_t station) const { return keys_[station]; }
  [[nodiscard]] static std::string nameOf(std::size_t station) { return fmt::format("herd-{}", station); }
  [[nodiscard]] std::string said() const { return process_->said(); }
  [[nodiscard]] pid_t pid() const { return process_->pid(); }

 private:
  TempFolder folder_;
  std::vector<std::string> keys_;
  TlsContext tls_;
  std::unique_ptr<Process> process_;
  std::uint16_t port_ = 0;
};

// A lightweight station: connects like the real one (ServerLink), sends a chunk of 1 s every second, and
// keeps unacknowledged chunks.

using HerdClock = std::chrono::steady_clock;

/// The chunks of all stations: equal, because only their number matters here.
class HerdChunks {
 public:
  explicit HerdChunks(std::size_t most);
  [[nodiscard]] const std::string& data(std::uint64_t seq) const { return chunks_.at(seq); }
  [[nodiscard]] std::uint64_t most() const { return chunks_.size(); }
  static constexpr std::uint64_t kSamples = 1000;

 private:
  std::vector<std::string> chunks_;
};

/// Results of all connection attempts. One thread.
struct HerdTally {
  std::vector<HerdClock::time_point> connected;  ///< logged in
  std::uint64_t lost = 0;                        ///< connections that ended
  std::map<std::string, std::uint64_t> failed;   ///< attempts, by the kind of failure
  std::uint64_t went_back = 0;  ///< sessions of which the server had less than it acknowledged
};

/// Thread: that of the io_context. Must outlive its coroutine.
class HerdStation {
 public:
  HerdStation(asio::io_context& io, ClientConfig config, std::uint64_t seed, const HerdChunks& chunks,
              HerdTally& tally);
  void connect() { link_.logIn(config_); }

  /// True if it is logged in, its session is open, and all chunks made before `since` are acknowledged.
  [[nodiscard]] bool whole() const { return open_ && committed_ >= backlog_; }
  /// Call at the server's kill: measures the time until full recovery, including the chunks made meanwhile.
  void outage() { open_ = false, whole_at_.reset(); }
  [[nodiscard]] std::optional<HerdClock::time_point> wholeAt() const { return whole_at_; }
  /// Stops making chunks, sends the rest and closes the session.
  void end() { ending_ = true; }
  [[nodiscard]] bool complete() const { return complete_; }
  [[nodiscard]] std::uint64_t committed() const { return committed_; }
  [[nodiscard]] const std::string& trouble() const { return trouble_; }

 private:
  LinkHandlers handlers();
  void onConnected();
  Task<> feed();
  void pump();
  [[nodiscard]] std::uint64_t made() const;
  [[nodiscard]] pb::Envelope openMessage() const;
  [[nodiscard]] pb::Envelope closeMessage() const;
  void handle(const pb::Envelope& envelope);

  asio::io_context& io_;
  ClientConfig config_;
  ServerLink link_;
  const HerdChunks& chunks_;
  HerdTally& tally_;
  std::string id_;
  HerdClock::time_point began_;
  bool open_ = false, ending_ = false, closing_ = false, complete_ = false;
  std::uint64_t sent_ = 0, committed_ = 0, backlog_ = 0, end_at_ = 0;
  std::optional<HerdClock::time_point> whole_at_;
  std::string trouble_;
};

using namespace std::chrono_literals;

constexpr std::uint64_t kWindow = 64;

/// Maps failures of the same kind to the same text.
std::string kindOf(const Error& error) {
  for (const char* kind : {"refused", "reset", "no answer within", "no log-in within", "RATE_LIMITED",
                           "CONFLICT", "closed the connection", "bye"})
    if (error.message.find(kind) != std::string::npos) return kind;
  return error.message.substr(0, 120);
}

HerdServer::HerdServer(std::size_t stations) {
  {
    ServerOptions options;
    options.data = folder_.path() / "data";
    options.listen = "127.0.0.1:0";
    auto server = Server::start(std::move(options));
    if (!server.ok()) throw std::runtime_error(server.error().message);
    for (std::size_t i = 0; i < stations; ++i) {
      pb::Request request;
      request.mutable_add_station()->set_name(nameOf(i));
      Outcome outcome = (*server)->store().service().execute({"root", pb::ADMINISTRATOR}, request);
      if (outcome.error) throw std::runtime_error(outcome.error->message);
      keys_.push_back(outcome.reply.station_key().key());
    }
    tls_ = *makeClientTls((*server)->caFile());
  }
  start();
}

void HerdServer::start() {
  const auto file = folder_.path() / "port";
  std::filesystem::remove(file);
  process_ =
      std::make_unique<Process>("needlelab-server",
                                std::vector<std::string>{"--data", folder_.path() / "data", "--listen",
                                                         fmt::format("127.0.0.1:{}", port_), "--port-file",
                                                         file, "--log-level", "warning"},
                                folder_.path() / "server.log");
  std::string text;
  const bool up = eventually(
      [&] {
        auto read = readWholeFile(file);
        if (read.ok()) text = *read;
        return !text.empty();
      },
      60s);
  if (!up) throw std::runtime_error("the server did not start: " + process_->said());
  port_ = static_cast<std::uint16_t>(std::stoi(text));
}

void HerdServer::kill() {
  process_->signal(SIGKILL);
  (void)process_->wait(10s);
}

int HerdServer::stop() {
  process_->signal(SIGTERM);
  return process_->wait(60s).value_or(-1000);
}

HerdChunks::HerdChunks(std::size_t most) {
  Random random(1);
  double x_m = 0, v_m_s = 0;
  for (std::size_t seq = 0; seq < most; ++seq) {
    std::vector<GestureSample> samples(kSamples);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      v_m_s += random.in(-1e-4, 1e-4) - 1e-3 * v_m_s;
      x_m += 1e-3 * v_m_s;
      samples[i].tick = seq * kSamples + i;
      samples[i].time_ns = static_cast<std::int64_t>(samples[i].tick) * 1'000'000;
      samples[i].p_WT_m[2] = x_m;
      samples[i].force_W_N[2] = 300 * x_m;
    }
    const Bytes bytes = encodeChunk(Resolution::standard(), samples);
    chunks_.emplace_back(bytes.begin(), bytes.end());
  }
}

HerdStation::HerdStation(asio::io_context& io, ClientConfig config, std::uint64_t seed,
                         const HerdChunks& chunks, HerdTally& tally)
    : io_(io),
      config_(std::move(config)),
      link_(io, {.seed = seed}, handlers()),
      chunks_(chunks),
      tally_(tally),
      began_(HerdClock::now()) {
  const Uuid id = makeUuidV7();
  id_.assign(id.begin(), id.end());
}

std::uint64_t HerdStation::made() const {
  if (ending_) return end_at_;
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(HerdClock::now() - began_).count();
  return std::min<std::uint64_t>(static_cast<std::uint64_t>(seconds) + 1, chunks_.most());
}

LinkHandlers HerdStation::handlers() {
  return {.accept = {},
          .connected = [this](const pb::Welcome&) { onConnected(); },
          .message =
              [this](pb::Envelope& envelope) {
                handle(envelope);
                if (complete_) link_.stop("done");
              },
          .judge =
              [this](const LinkEnd& end) {
                return trouble_.empty() ? retryOfStation(end, !complete_) : Retry::kNever;
              },
          .away =
              [this](const LinkEnd& end) {
                open_ = closing_ = false;
                if (!end.was_connected)
                  ++tally_.failed[kindOf(end.error)];
                else if (!complete_)
                  ++tally_.lost;
              }};
}

void HerdStation::onConnected() {
  tally_.connected.push_back(HerdClock::now());
  sent_ = committed_;
  backlog_ = made();
  link_.send(openMessage());
  asio::co_spawn(io_, feed(), rethrow);
}

// a chunk each second, as long as this connection lasts
Task<> HerdStation::feed() {
  const std::uint64_t connection = link_.connections();
  asio::steady_timer timer(io_);
  while (link_.online() && link_.connections() == connection) {
    pump();
    timer.expires_after(250ms);
    co_await timer.async_wait(kUseTuple);
  }
}

void HerdStation::pump() {
  if (!open_ || !link_.online()) return;
  if (ending_ && end_at_ == 0) {
    ending_ = false;
    const std::uint64_t all = made();
    ending_ = true;
    end_at_ = std::max(all, sent_);
  }
  while (sent_ < made() && sent_ < committed_ + kWindow) {
    pb::Envelope envelope;
    envelope.mutable_chunk()->set_session_id(id_);
    envelope.mutable_chunk()->set_seq(sent_);
    envelope.mutable_chunk()->set_data(chunks_.data(sent_));
    if (!link_.send(envelope)) return;
    ++sent_;
  }
  if (ending_ && committed_ == end_at_ && !std::exchange(closing_, true)) link_.send(closeMessage());
}

void HerdStation::handle(const pb::Envelope& envelope) {
  if (envelope.has_session_opened() && !open_) {
    const std::uint64_t next = envelope.session_opened().next_seq();
    if (next < committed_) ++tally_.went_back;
    committed_ = sent_ = next;
    open_ = true;
  } else if (envelope.has_ack()) {
    committed_ = std::max(committed_, envelope.ack().committed_seqs());
  } else if (envelope.has_session_closed()) {
    complete_ = envelope.session_closed().state() == pb::SESSION_COMPLETE;
    if (!complete_) trouble_ = "not complete";
  } else if (envelope.has_refusal() && !envelope.refusal().fatal()) {
    trouble_ = reasonName(envelope.refusal().reason()) + ": " + envelope.refusal().text();
  }
  if (whole() && !whole_at_) whole_at_ = HerdClock::now();
  pump();
}

pb::Envelope HerdStation::openMessage() const {
  pb::Envelope envelope;
  pb::SessionDescription& d = *envelope.mutable_open_session()->mutable_description();
  d.set_session_id(id_);
  d.set_station(config_.login.station().station());
  d.set_trainee("tina");
  d.set_exercise_id("practice");
  d.set_profile_id("practice");
  d.set_profile_json("{}");
  d.set_engine_version("test");
  d.set_rate_hz(1000);
  d.set_started_unix_ns(1'000'000'000);
  setResolution(d, Resolution::standard());
  return envelope;
}

pb::Envelope HerdStation::closeMessage() const {
  SessionHash hash;
  for (std::uint64_t seq = 0; seq < end_at_; ++seq) hash.update(viewOf(chunks_.data(seq)));
  const Digest digest = hash.digest();
  pb::Envelope envelope;
  pb::CloseSession& close = *envelope.mutable_close_session();
  close.set_session_id(id_);
  close.set_chunks(end_at_);
  close.set_samples(end_at_ * HerdChunks::kSamples);
  close.set_hash(digest.data(), digest.size());
  return envelope;
}

double secondsSince(HerdClock::time_point from, HerdClock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

struct Storm {
  std::size_t stations;
  std::chrono::milliseconds outage;
  std::chrono::milliseconds patience;
};

// The whole herd in one thread of this process; TLS on both sides shares the machine's cores.
void run(const Storm& storm) {
  HerdServer server(storm.stations);
  const HerdChunks chunks(600);
  HerdTally tally;
  asio::io_context io{1};
  std::vector<std::unique_ptr<HerdStation>> herd;
  for (std::size_t i = 0; i < storm.stations; ++i) {
    ClientConfig config;
    config.server = {"127.0.0.1", server.port()};
    config.tls = server.tls();
    config.program = "herd";
    config.login = stationLogin(HerdServer::nameOf(i), server.key(i));
    herd.push_back(std::make_unique<HerdStation>(io, config, i + 1, chunks, tally));
    herd.back()->connect();
  }
  const auto count = [&](auto condition) {
    return static_cast<std::size_t>(
        std::count_if(herd.begin(), herd.end(), [&](const auto& s) { return condition(*s); }));
  };
  const auto until = [&](auto condition, std::chrono::milliseconds limit) {
    const auto end = HerdClock::now() + limit;
    while (!condition() && HerdClock::now() < end) io.run_for(5ms);
    return condition();
  };
  // the first storm: all connect for the first time
  const auto first = HerdClock::now();
  ASSERT_TRUE(until([&] { return count([](const HerdStation& s) { return s.whole(); }) == storm.stations; },
                    storm.patience))
      << server.said().substr(0, 2000);
  std::cout << "herd of " << storm.stations << ": first log-ins and chunks took "
            << secondsSince(first, HerdClock::now()) << " s";
  for (const auto& [kind, times] : tally.failed) std::cout << "; " << times << " × " << kind;
  std::cout << '\n';
  io.run_for(2s);  // streaming

  for (const auto& station : herd) station->outage();
  server.kill();
  io.run_for(storm.outage);
  tally = {};
  const auto killed_for = storm.outage;
  const auto start = HerdClock::now();
  // starting takes time too, and the stations keep trying meanwhile
  std::atomic<bool> up{false};
  std::thread starter([&] {
    server.start();
    up = true;
  });
  const bool started = until([&] { return up.load(); }, 60s);
  starter.join();
  ASSERT_TRUE(started);
  const auto listening = HerdClock::now();
  EXPECT_TRUE(until(
      [&] { return count([](const HerdStation& s) { return s.wholeAt().has_value(); }) == storm.stations; },
      storm.patience))
      << count([](const HerdStation& s) { return s.wholeAt().has_value(); }) << " of " << storm.stations
      << " are whole again\n"
      << server.said().substr(0, 2000);

  std::vector<double> whole_s, connected_s;
  for (const auto& station : herd)
    if (station->wholeAt()) whole_s.push_back(secondsSince(listening, *station->wholeAt()));
  for (const auto& at : tally.connected) connected_s.push_back(secondsSince(listening, at));
  std::sort(whole_s.begin(), whole_s.end());
  std::sort(connected_s.begin(), connected_s.end());
  ASSERT_FALSE(whole_s.empty());
  // the most handshakes within any second
  std::size_t most = 0;
  for (std::size_t i = 0, j = 0; j < connected_s.size(); ++j) {
    while (connected_s[j] - connected_s[i] > 1.0) ++i;
    most = std::max(most, j - i + 1);
  }
  std::cout << "outage " << killed_for.count() << " ms, start " << secondsSince(start, listening)
            << " s; whole again (logged in, resumed, backlog acknowledged) after the server listens: median "
            << whole_s[whole_s.size() / 2] << " s, 95 % " << whole_s[whole_s.size() * 95 / 100] << " s, last "
            << whole_s.back() << " s; " << tally.connected.size() << " log-ins, at most " << most
            << " in a second; lost again " << tally.lost;
  for (const auto& [kind, times] : tally.failed) std::cout << "; " << times << " × " << kind;
  if (const auto sample = sampleProcess(server.pid()))
    std::cout << "; server " << sample->rss_KiB / 1024 << " MiB, " << sample->handles << " handles";
  std::cout << '\n';
  EXPECT_EQ(tally.went_back, 0u) << "acknowledged, and not there after the kill";
  // connected stations stay connected: the reconnecting others end no connection
  EXPECT_EQ(tally.lost, 0u);

  // complete: the server checks each session's count and hash from its database
  for (const auto& station : herd) station->end();
  EXPECT_TRUE(
      until([&] { return count([](const HerdStation& s) { return s.complete(); }) == storm.stations; },
            storm.patience));
  for (const auto& station : herd) EXPECT_EQ(station->trouble(), "");
  EXPECT_EQ(server.stop(), 0);
}

TEST(HerdTest, sixtyStationsAreWholeAgainAfterAKill) {
  run({60, 500ms, 40s});
}

TEST(HerdTest, aThousandStationsAreWholeAgainAfterAKill) {
  if (!longForm()) GTEST_SKIP() << "takes some minutes: NEEDLELAB_LONG=1";
  run({1000, 3s, 180s});
}

}  // namespace
}  // namespace needlelab::test
