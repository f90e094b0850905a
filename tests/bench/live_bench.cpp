/// The cost of one live frame for the server: three processes, as in production (server, stations, viewers),
/// over TLS on loopback. Frames and chunks are made beforehand, so the stations only send. The figures are
/// CPU times of processes, which a busy machine disturbs less than wall-clock times.
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "client/net/connect.h"
#include "common/base/clock.h"
#include "common/base/uuid.h"
#include "common/gesture/chunk.h"
#include "common/wire/tls.h"
#include "db/credentials.h"
#include "server/base/log.h"
#include "server/server.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/common/gesture/gesture_samples.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

struct Settings {
  std::size_t stations = 200, viewers = 10, warm_up_s = 2, seconds = 8;
  bool chunks = true;
};

constexpr std::int64_t kFrameNs = 20'000'000;
constexpr char kPassword[] = "correct horse battery";

[[noreturn]] void die(const std::string& text) {
  std::fprintf(stderr, "live_bench: %s\n", text.c_str());
  std::_Exit(1);
}
template <typename T>
T must(Result<T> result) {
  if (!result.ok()) die(result.error().message);
  return std::move(*result);
}

std::string stationName(std::size_t i) {
  return "s" + std::to_string(i);
}
StationKeyBytes keyOf(std::size_t i) {
  StationKeyBytes key{};
  for (std::size_t k = 0; k < sizeof i; ++k) key[k] = static_cast<std::uint8_t>(i >> (8 * k));
  return key;
}

double cpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto s = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return s(usage.ru_utime) + s(usage.ru_stime);
}

/// The measured time, after the warm-up; steady clock, shared by all processes.
struct Span {
  Span() = default;
  Span(const Settings& settings, std::int64_t start_ns)
      : begin_ns(start_ns + static_cast<std::int64_t>(settings.warm_up_s) * 1'000'000'000),
        end_ns(begin_ns + static_cast<std::int64_t>(settings.seconds) * 1'000'000'000) {}
  std::int64_t begin_ns = std::numeric_limits<std::int64_t>::max(), end_ns = begin_ns;
};

struct Pipe {
  int fd[2];
  Pipe() {
    if (::pipe(fd) != 0) die("pipe");
  }
  void write(const void* data, std::size_t size) const {
    if (::write(fd[1], data, size) != static_cast<ssize_t>(size)) die("a process ended early");
  }
  void read(void* data, std::size_t size) const {
    auto* at = static_cast<char*>(data);
    while (size > 0) {
      const ssize_t got = ::read(fd[0], at, size);
      if (got <= 0) die("a process ended early");
      at += got;
      size -= static_cast<std::size_t>(got);
    }
  }
};

/// The report of a process.
struct Figures {
  double cpu_s = 0, network_cpu_s = 0;
  std::uint64_t frames = 0, late = 0;
  std::uint64_t p50_us = 0, p99_us = 0, max_us = 0;
};

double threadCpuSeconds(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// --- server
void runServer(const Settings& settings, const std::filesystem::path& folder, const Pipe& ready,
               const Pipe& go, const Pipe& out) {
  setLogLevel(LogLevel::kError);
  ServerOptions options;
  options.data = folder;
  options.listen = "127.0.0.1:0";
  auto server = must(Server::start(std::move(options)));
  const Status added = server->store().writer().run([&](Connection& writer) -> Status {
    for (std::size_t i = 0; i < settings.stations; ++i) {
      if (auto done = StationStore(writer).add(stationName(i), hashStationKey(keyOf(i)), 1); !done)
        return done;
    }
    return {};
  });
  if (!added.ok()) die(added.error().message);
  pb::Request request;
  request.mutable_add_user()->set_name("viewer");
  request.mutable_add_user()->set_role(pb::INSTRUCTOR);
  request.mutable_add_user()->set_password(kPassword);
  if (auto outcome = server->store().service().execute({"root", pb::ADMINISTRATOR}, request); outcome.error)
    die(outcome.error->message);
  clockid_t clock{};
  std::thread network([&] { server->run(); });
  pthread_getcpuclockid(network.native_handle(), &clock);
  const std::uint16_t port = server->port();
  ready.write(&port, sizeof port);
  std::int64_t start_ns = 0;
  go.read(&start_ns, sizeof start_ns);
  const Span span(settings, start_ns);
  std::this_thread::sleep_for(std::chrono::nanoseconds(span.begin_ns - steadyNowNs()));
  const double before = cpuSeconds(), network_before = threadCpuSeconds(clock);
  std::this_thread::sleep_for(std::chrono::nanoseconds(span.end_ns - steadyNowNs()));
  Figures figures;
  figures.cpu_s = cpuSeconds() - before;
  figures.network_cpu_s = threadCpuSeconds(clock) - network_before;
  const auto counters = server->store().writer().counters();
  std::printf("  writer: %.1f items a group, commit p50 %.2f p99 %.2f ms, checkpoint p99 %.2f ms\n",
              static_cast<double>(counters.group_items.sum()) /
                  static_cast<double>(std::max<std::uint64_t>(1, counters.group_items.count())),
              counters.commit_ns.quantile(0.5) * 1e-6, counters.commit_ns.quantile(0.99) * 1e-6,
              counters.checkpoint_ns.quantile(0.99) * 1e-6);
  std::fflush(stdout);
  out.write(&figures, sizeof figures);
  server->stop();
  network.join();
}

Task<> readOn(std::shared_ptr<Channel> channel) {
  for (;;) {
    auto got = co_await channel->receive();
    if (!got.ok()) co_return;
    if (got->has_ping()) channel->send(pongTo(got->ping(), steadyNowNs()));
    if (got->has_refusal()) die("refused: " + got->refusal().text());
  }
}

// --- stations
struct FakeStation {
  std::shared_ptr<Channel> channel;
  std::string session;
  std::uint64_t frame_seq = 0, chunk_seq = 0;
  std::int64_t next_due_ns = 0, next_chunk_ns = 0;
};

Task<> connectStation(ClientConfig config, FakeStation* station, std::size_t* connected) {
  auto connection = co_await connectClient(config);
  if (!connection.ok()) die(connection.error().message);
  station->channel = connection->channel;
  const Uuid id = makeUuidV7();
  station->session.assign(id.begin(), id.end());
  pb::Envelope envelope;
  pb::SessionDescription& d = *envelope.mutable_open_session()->mutable_description();
  d.set_session_id(station->session);
  d.set_station(config.login.station().station());
  d.set_trainee("tina");
  d.set_exercise_id("practice");
  d.set_profile_id("practice");
  d.set_profile_json("{}");
  d.set_engine_version("bench");
  d.set_rate_hz(1000);
  d.set_started_unix_ns(wallNowNs());
  d.mutable_resolution()->set_length_m(1e-6);
  station->channel->send(envelope);
  ++*connected;
  co_await readOn(station->channel);
}

struct Material {
  std::vector<Bytes> frames, chunks;
  Material() {
    const auto samples = test::smoothGesture(20'000);
    for (std::size_t at = 0; at < samples.size(); at += 20)
      frames.push_back(encodeChunk(Resolution::standard(), std::span(samples).subspan(at, 20)));
    for (std::size_t at = 0; at < samples.size(); at += 1000)
      chunks.push_back(encodeChunk(Resolution::standard(), std::span(samples).subspan(at, 1000)));
  }
};

Task<> sendAll(const Settings& settings, std::vector<FakeStation>* stations, Span span, Figures* figures) {
  const Material material;
  asio::steady_timer timer(co_await asio::this_coro::executor);
  const std::int64_t wall_minus_steady = wallNowNs() - steadyNowNs();
  const auto count = static_cast<std::int64_t>(stations->size());
  const std::int64_t start = steadyNowNs();
  for (std::int64_t i = 0; i < count; ++i) {
    (*stations)[static_cast<std::size_t>(i)].next_due_ns = start + kFrameNs * i / count;
    (*stations)[static_cast<std::size_t>(i)].next_chunk_ns = start + 1'000'000'000 * i / count;
  }
  std::size_t at = 0;  // they are due in turn
  double before = 0;
  for (;;) {
    const std::int64_t now = steadyNowNs();
    if (before == 0 && now >= span.begin_ns) before = cpuSeconds();
    if (now >= span.end_ns) break;
    for (;; at = (at + 1) % stations->size()) {
      FakeStation& station = (*stations)[at];
      if (station.next_due_ns > now) break;
      pb::Envelope envelope;
      pb::LiveFrame& frame = *envelope.mutable_live_frame();
      const Bytes& data = material.frames[(station.frame_seq + at) % material.frames.size()];
      frame.set_session_id(station.session);
      frame.set_frame_seq(station.frame_seq++);
      frame.set_data(data.data(), data.size());
      frame.set_due_steady_ns(station.next_due_ns);
      frame.set_capture_unix_ns(station.next_due_ns + wall_minus_steady);
      if (auto encoded = encodeFrame(envelope); encoded.ok()) station.channel->sendLive(*encoded, true);
      if (now >= span.begin_ns) ++figures->frames;
      station.next_due_ns += kFrameNs;
      if (settings.chunks && station.next_chunk_ns <= now) {
        pb::Envelope durable;
        const Bytes& bytes = material.chunks[(station.chunk_seq + at) % material.chunks.size()];
        durable.mutable_chunk()->set_session_id(station.session);
        durable.mutable_chunk()->set_seq(station.chunk_seq++);
        durable.mutable_chunk()->set_data(bytes.data(), bytes.size());
        station.channel->send(durable);
        station.next_chunk_ns += 1'000'000'000;
      }
    }
    timer.expires_after(1ms);
    co_await timer.async_wait(kUseTuple);
  }
  figures->cpu_s = cpuSeconds() - before;
  for (const FakeStation& station : *stations) figures->late += station.channel->live().dropped();
}

ClientConfig configFor(std::uint16_t port, const std::filesystem::path& folder, pb::Login login) {
  ClientConfig config;
  config.server.port = port;
  config.tls = must(makeClientTls(folder / "tls" / "ca.crt"));
  config.program = "bench";
  config.connect_timeout = 60s;
  config.login = std::move(login);
  return config;
}

void runStations(const Settings& settings, const std::filesystem::path& folder, std::uint16_t port,
                 const Pipe& ready, const Pipe& go, const Pipe& out) {
  asio::io_context io{1};
  std::vector<FakeStation> stations(settings.stations);
  ClientConfig config = configFor(port, folder, {});
  for (std::size_t i = 0; i < stations.size(); ++i) {
    std::size_t connected = 0;
    const StationKeyBytes key = keyOf(i);
    config.login = stationLogin(stationName(i), std::string(key.begin(), key.end()));
    asio::co_spawn(io, connectStation(config, &stations[i], &connected), rethrow);
    while (connected == 0) io.run_one();
  }
  const std::uint16_t done = 1;
  ready.write(&done, sizeof done);
  std::int64_t start_ns = 0;
  go.read(&start_ns, sizeof start_ns);
  Figures figures;
  bool ended = false;
  asio::co_spawn(io, sendAll(settings, &stations, Span(settings, start_ns), &figures),
                 [&](std::exception_ptr error) {
                   rethrow(error);
                   ended = true;
                 });
  while (!ended) io.run_one();
  out.write(&figures, sizeof figures);
}

// --- viewers
Task<> view(ClientConfig config, std::vector<std::string> stations, const Span* span,
            std::vector<std::uint32_t>* latencies_us, Figures* figures, std::size_t* connected) {
  auto connection = co_await connectClient(config);
  if (!connection.ok()) die(connection.error().message);
  const auto channel = connection->channel;
  std::uint32_t number = 0;
  for (const std::string& station : stations) {
    pb::Envelope envelope;
    envelope.mutable_subscribe()->set_subscription(++number);
    envelope.mutable_subscribe()->set_station(station);
    channel->send(envelope);
  }
  std::size_t subscribed = 0;
  for (;;) {
    auto got = co_await channel->receive();
    if (!got.ok()) co_return;
    if (got->has_ping()) channel->send(pongTo(got->ping(), steadyNowNs()));
    if (got->has_subscribed() && ++subscribed == stations.size()) ++*connected;
    if (!got->has_live_frame()) continue;
    const std::int64_t now = wallNowNs();
    if (steadyNowNs() < span->begin_ns) continue;
    ++figures->frames;
    figures->late = std::max<std::uint64_t>(figures->late, got->live_frame().dropped_for_you());
    latencies_us->push_back(static_cast<std::uint32_t>(
        std::max<std::int64_t>(0, now - got->live_frame().capture_unix_ns()) / 1000));
  }
}

void runViewers(const Settings& settings, const std::filesystem::path& folder, std::uint16_t port,
                const Pipe& ready, const Pipe& go, const Pipe& out) {
  asio::io_context io{1};
  std::vector<std::uint32_t> latencies_us;
  latencies_us.reserve(settings.stations * 50 * (settings.seconds + 1));
  Figures figures;
  Span span;  // known only when all are connected
  std::size_t connected = 0;
  for (std::size_t v = 0; v < settings.viewers; ++v) {
    std::vector<std::string> mine;
    for (std::size_t i = v; i < settings.stations; i += settings.viewers) mine.push_back(stationName(i));
    const std::size_t before = connected;
    asio::co_spawn(io,
                   view(configFor(port, folder, personLogin("viewer", kPassword)), mine, &span, &latencies_us,
                        &figures, &connected),
                   rethrow);
    while (connected == before) io.run_one();
  }
  const std::uint16_t done = 1;
  ready.write(&done, sizeof done);
  std::int64_t start_ns = 0;
  go.read(&start_ns, sizeof start_ns);
  span = Span(settings, start_ns);
  io.run_until(std::chrono::steady_clock::now() + std::chrono::nanoseconds(span.begin_ns - steadyNowNs()));
  const double before = cpuSeconds();
  io.run_until(std::chrono::steady_clock::now() + std::chrono::nanoseconds(span.end_ns - steadyNowNs()));
  figures.cpu_s = cpuSeconds() - before;
  std::sort(latencies_us.begin(), latencies_us.end());
  if (!latencies_us.empty()) {
    figures.p50_us = latencies_us[latencies_us.size() / 2];
    figures.p99_us = latencies_us[latencies_us.size() * 99 / 100];
    figures.max_us = latencies_us.back();
  }
  out.write(&figures, sizeof figures);
}

int run(const Settings& settings) {
  test::TempFolder folder;
  const auto data = folder.path() / "data";
  Pipe ready[3], go[3], out[3];
  pid_t children[3] = {};
  std::uint16_t port = 0;
  for (int role = 0; role < 3; ++role) {
    std::fflush(stdout);
    children[role] = ::fork();
    if (children[role] == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (role == 0) runServer(settings, data, ready[0], go[0], out[0]);
      if (role == 1) runStations(settings, data, port, ready[1], go[1], out[1]);
      if (role == 2) runViewers(settings, data, port, ready[2], go[2], out[2]);
      std::_Exit(0);
    }
    std::uint16_t answer = 0;
    ready[role].read(&answer, sizeof answer);
    if (role == 0) port = answer;
  }
  std::printf("pids: server %d, stations %d, viewers %d\n", children[0], children[1], children[2]);
  std::fflush(stdout);
  const std::int64_t start_ns = steadyNowNs() + 300'000'000;
  for (const Pipe& pipe : go) pipe.write(&start_ns, sizeof start_ns);
  Figures figures[3];
  for (int role = 0; role < 3; ++role) out[role].read(&figures[role], sizeof figures[role]);
  for (const pid_t child : children) ::waitpid(child, nullptr, 0);

  const auto& [server, stations, viewers] = figures;
  const double frames = static_cast<double>(std::max<std::uint64_t>(1, viewers.frames));
  const auto seconds = static_cast<double>(settings.seconds);
  std::printf(
      "%zu stations, %zu viewers, %zu s: %.0f frames/s sent, %.0f/s seen (%.2f %%), dropped at stations "
      "%llu, for a viewer %llu\n",
      settings.stations, settings.viewers, settings.seconds, static_cast<double>(stations.frames) / seconds,
      frames / seconds, 100 * frames / static_cast<double>(std::max<std::uint64_t>(1, stations.frames)),
      static_cast<unsigned long long>(stations.late), static_cast<unsigned long long>(viewers.late));
  std::printf(
      "  CPU per frame seen, us: server %.2f (network thread %.2f), stations %.2f, viewers %.2f, all %.2f; "
      "of a core: server %.2f, all %.2f\n",
      1e6 * server.cpu_s / frames, 1e6 * server.network_cpu_s / frames, 1e6 * stations.cpu_s / frames,
      1e6 * viewers.cpu_s / frames, 1e6 * (server.cpu_s + stations.cpu_s + viewers.cpu_s) / frames,
      server.cpu_s / seconds, (server.cpu_s + stations.cpu_s + viewers.cpu_s) / seconds);
  std::printf("  due to seen, ms: p50 %.2f, p99 %.2f, greatest %.2f (add 20 for the frame's first sample)\n",
              1e-3 * static_cast<double>(viewers.p50_us), 1e-3 * static_cast<double>(viewers.p99_us),
              1e-3 * static_cast<double>(viewers.max_us));
  return 0;
}

}  // namespace
}  // namespace needlelab

int main(int argc, char** argv) {
  needlelab::Settings settings;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    const auto value = static_cast<std::size_t>(std::strtoul(argv[i + 1], nullptr, 10));
    if (name == "--stations")
      settings.stations = value;
    else if (name == "--viewers")
      settings.viewers = value;
    else if (name == "--seconds")
      settings.seconds = value;
    else if (name == "--chunks")
      settings.chunks = value != 0;
    else
      return std::fprintf(stderr, "live_bench: unknown option %s\n", name.c_str()), 2;
  }
  return needlelab::run(settings);
}
