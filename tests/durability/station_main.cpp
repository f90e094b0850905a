// needlelab-durability-station: a station's spool and uplink, without hand and loop. It writes every sample,
// before the spool gets it, and every answer of the server to a ledger that survives kills; the judge
// compares. Its seed determines all its actions.
#include <signal.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cmath>
#include <random>
#include <set>
#include <thread>

#include "client/net/uplink/uplink.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/time/clock.h"
#include "common/wire/tls.h"
#include "tests/durability/station_ledger.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

struct Options {
  std::string server, ca, key_file, spool, ledger;
  std::uint64_t seed = 1;
  int sessions = 1, samples = 300;
  double rate_hz = 100;   ///< declared rate: a chunk is one second
  double push_hz = 1000;  ///< actual rate
  int drain_s = 20;
  bool as_station = false;  ///< like a station: shows its samples to viewers, and waits before it tries again
};

std::atomic<bool> stop{false};

/// Sessions with an answer from the server. Thread: any.
class Heard {
 public:
  void add(const std::string& id) {
    const std::scoped_lock lock(mutex_);
    ids_.insert(id);
  }
  bool contains(const std::string& id) {
    const std::scoped_lock lock(mutex_);
    return ids_.contains(id);
  }

 private:
  std::mutex mutex_;
  std::set<std::string> ids_;
};

GestureSample sampleOf(std::uint64_t tick, std::mt19937_64& random) {
  std::uniform_real_distribution<double> noise(-1, 1);
  GestureSample s;
  s.tick = tick;
  s.time_ns = steadyNowNs();
  const double t = static_cast<double>(tick) * 0.01;
  for (int i = 0; i < 3; ++i) {
    s.p_WT_m[i] = 0.05 * std::sin(t + i) + 1e-5 * noise(random);
    s.force_W_N[i] = 3 * std::cos(t * 0.7 + i) + 0.01 * noise(random);
    s.torque_W_Nm[i] = 0.1 * noise(random);
  }
  for (double& q : s.q_WT) q = noise(random);
  s.speed_mps = 0.1 * noise(random);
  // the wall comes and goes
  if (tick / 20 % 2 == 0)
    for (double& wall : s.wall_W_m) wall = 0.02 * noise(random);
  s.insertion_m = 0.03 * std::abs(std::sin(t * 0.2));
  s.lateral_error_m = 0.001 * std::abs(noise(random));
  s.plunger = 0.5 + 0.5 * noise(random);
  s.device_ns = static_cast<std::int32_t>(random() % 200'000);
  s.engine_ns = static_cast<std::int32_t>(random() % 5'000);
  s.flags = static_cast<std::uint32_t>(random() % 16) | static_cast<std::uint32_t>(tick % 7 == 0) << 20;
  s.buttons = static_cast<std::uint32_t>(tick / 100 % 4);
  s.layer = static_cast<std::int8_t>(static_cast<int>(tick / 30 % 7) - 1);
  s.phase = static_cast<std::uint8_t>(tick / 50 % 5);
  return s;
}

pb::SessionDescription describe(const std::string& station, double rate_hz) {
  const Uuid id = makeUuidV7();
  pb::SessionDescription description;
  description.set_session_id(id.data(), id.size());
  description.set_station(station);
  description.set_trainee("tina");
  description.set_exercise_id("practice");
  description.set_profile_id("practice");
  description.set_profile_json("{}");
  description.set_engine_version(programVersion());
  description.set_rate_hz(rate_hz);
  description.set_started_unix_ns(wallNowNs());
  setResolution(description, Resolution::standard());
  return description;
}

/// Records one session in real time. Returns false if the spool refused.
bool record(const Options& options, Spool& spool, Uplink& uplink, StationLedger& ledger,
            const std::string& station, std::mt19937_64& random) {
  // before the spool has it: a kill in between leaves a session without samples
  const pb::SessionDescription description = describe(station, options.rate_hz);
  ledger.session(description);
  auto session = spool.create(description);
  if (!session.ok()) return std::fprintf(stderr, "%s\n", session.error().message.c_str()), false;
  auto ring = std::make_unique<SampleRing>();
  SpoolWriter::Callbacks callbacks;
  callbacks.durable = [&uplink] { uplink.wake(); };
  callbacks.trouble = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); };
  if (options.as_station) callbacks.piece = [&uplink](const SamplePiece& piece) { uplink.offer(piece); };
  SpoolWriterOptions writer_options;
  writer_options.rate_hz = options.rate_hz;
  SpoolWriter writer(*ring, *session, writer_options, callbacks);
  uplink.add(*session, true);

  // between half and all of the requested samples, so that ends fall anywhere in a chunk
  const auto most = static_cast<std::uint64_t>(options.samples);
  const std::uint64_t count = most - random() % (most / 2 + 1);
  const auto began = std::chrono::steady_clock::now();
  for (std::uint64_t i = 0, tick = 0; i < count && !stop; ++i, ++tick) {
    if (random() % 97 == 0) tick += random() % 5;  // missed ticks
    const GestureSample sample = sampleOf(tick, random);
    ledger.sample(sample);
    while (!ring->push(sample)) std::this_thread::sleep_for(1ms);
    std::this_thread::sleep_until(
        began + std::chrono::duration_cast<std::chrono::nanoseconds>(
                    std::chrono::duration<double>(static_cast<double>(i) / options.push_hz)));
  }
  if (const Status ended = writer.finish(60s); !ended.ok())
    return std::fprintf(stderr, "%s\n", ended.error().message.c_str()), false;
  ledger.end(**session);
  uplink.wake();
  return true;
}

int run(const Options& options) {
  // NAME:64 hexadecimal digits
  const auto text = readWholeFile(options.key_file);
  if (!text.ok()) return std::fprintf(stderr, "%s\n", text.error().message.c_str()), 2;
  const std::string station = text->substr(0, text->find(':'));
  std::string key;
  for (std::size_t i = station.size() + 1; key.size() < 32 && i + 1 < text->size(); i += 2)
    key += static_cast<char>(std::stoi(text->substr(i, 2), nullptr, 16));

  StationLedger ledger(options.ledger);
  auto spool = Spool::open(options.spool);
  auto servers = parseEndpoints(options.server);
  auto tls = makeClientTls(options.ca);
  if (!spool.ok() || !servers.ok() || !tls.ok()) {
    const Error& error = !spool.ok() ? spool.error() : !servers.ok() ? servers.error() : tls.error();
    return std::fprintf(stderr, "%s\n", error.message.c_str()), 2;
  }
  for (const std::string& note : (*spool)->notes()) std::fprintf(stderr, "%s\n", note.c_str());
  const auto waiting = (*spool)->unfinished();
  // a kill may have come between a session's end and its ledger line
  for (const auto& session : waiting) ledger.end(*session);
  for (const auto& session : (*spool)->closedButNotSafe()) ledger.end(*session);
  SpoolKeep keep;
  keep.min_free_bytes = 0;
  for (const std::string& note : (*spool)->cleanUp(keep)) std::fprintf(stderr, "%s\n", note.c_str());

  const auto not_safe = (*spool)->closedButNotSafe();

  UplinkConfig config;
  config.client.tls = *tls;
  config.client.setServers(*servers);
  config.client.program = "needlelab-durability-station";
  config.client.login = stationLogin(station, key);
  if (!options.as_station) {
    config.first_retry = 20ms;
    config.max_retry = 100ms;
  }
  UplinkEvents events;
  events.report = [](const std::string& words) { std::fprintf(stderr, "%s\n", words.c_str()); };
  Heard heard;
  events.acknowledged = [&](const pb::Ack& ack) {
    ledger.acknowledged(ack);
    heard.add(ack.session_id());
  };
  events.closed = [&ledger](const pb::SessionClosed& closed) { ledger.closed(closed); };
  Uplink uplink(std::move(config), std::move(events));
  for (const auto& session : waiting) uplink.add(session, false);
  for (const auto& session : not_safe) uplink.add(session, false);

  std::mt19937_64 random(options.seed);
  for (int i = 0; i < options.sessions && !stop; ++i)
    if (!record(options, **spool, uplink, ledger, station, random)) return 1;
  const auto patience = std::chrono::seconds(options.drain_s);
  // the uplink asks whether the server still has the closed sessions: wait for the answer before exit
  const auto until = std::chrono::steady_clock::now() + patience;
  for (const auto& session : not_safe) {
    const std::string& id = session->description().session_id();
    // a session without chunks is not asked about: the server names it on connection if it is open there
    const bool asked = session->contents().chunks > 0;
    const auto answered = [&] { return asked ? heard.contains(id) : uplink.state().connections > 0; };
    while (!answered() && !stop && std::chrono::steady_clock::now() < until) std::this_thread::sleep_for(5ms);
  }
  const bool still_done = uplink.waitUntilDone(patience);
  uplink.stop();
  if (!still_done) std::fprintf(stderr, "not all could be sent: %s\n", uplink.state().error.c_str());
  return still_done ? 0 : 3;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) try {
  needlelab::test::Options options;
  CLI::App app("needlelab-durability-station: spool and uplink under test, with a ledger");
  app.add_option("--server", options.server)->required();
  app.add_option("--ca", options.ca)->required();
  app.add_option("--key", options.key_file)->required();
  app.add_option("--spool", options.spool)->required();
  app.add_option("--ledger", options.ledger)->required();
  app.add_option("--seed", options.seed);
  app.add_option("--sessions", options.sessions);
  app.add_option("--samples", options.samples, "in a session, at most");
  app.add_option("--rate", options.rate_hz, "as declared: a chunk is one second of it");
  app.add_option("--push", options.push_hz, "samples a second");
  app.add_option("--drain", options.drain_s, "seconds");
  app.add_flag("--as-station", options.as_station,
               "shows its samples to viewers, and waits before it tries again, as a station");
  CLI11_PARSE(app, argc, argv);
  ::signal(SIGTERM, [](int) { needlelab::test::stop = true; });
  return needlelab::test::run(options);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
