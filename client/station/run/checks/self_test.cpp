// Measures the facts; self_test_judge.cpp judges them.

#include "client/station/run/checks/self_test.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/device/factory/device_factory.h"
#include "client/effect_cost/tick_cost.h"
#include "client/net/link/blocking_client.h"
#include "client/net/link/server_link.h"
#include "client/station/run/checks/measure_delay.h"
#include "client/station/run/io/station_key.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/loop/real_time.h"
#include "common/base/files/files.h"
#include "common/base/histogram.h"
#include "common/base/program.h"
#include "common/base/range.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/gate/force_gate.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {

// --- computer, disk, engine ---

namespace {

std::string firstLine(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::string systemError(const char* what, const std::filesystem::path& path, int error) {
  return std::string(what) + " " + path.string() + ": " + std::strerror(error);
}

// returns the tick time of one profile's scene; an error if the profile is invalid
Result<double> tickOf(const EmbeddedFile& file, double rate_hz, std::string& id) {
  ASSIGN_OR_RETURN(const auto profile, parseProfile(file.text, file.name));
  id = profile.id();
  ASSIGN_OR_RETURN(auto scene, sceneSpecOf(profile));
  RETURN_IF_ERROR(addCompliance(scene));
  ASSIGN_OR_RETURN(const auto model, compile(scene, rate_hz));
  const auto gesture = measuringGesture(scene, rate_hz);
  TickRun run(model, gesture);
  return timeFor(0.02, [&] { run.tick(); }).median_ns;
}

}  // namespace

MachineFacts measureMachine() {
  MachineFacts facts;
  facts.text = machineText();
  facts.cores = static_cast<unsigned>(std::max(0L, ::sysconf(_SC_NPROCESSORS_ONLN)));
  facts.clock_source = firstLine("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  timespec resolution{};
  if (::clock_getres(CLOCK_MONOTONIC, &resolution) == 0)
    facts.clock_resolution_ns =
        static_cast<double>(resolution.tv_sec) * 1e9 + static_cast<double>(resolution.tv_nsec);
  facts.clock_cost_ns = clockCost_ns();
  return facts;
}

DiskFacts measureDisk(const std::filesystem::path& folder) {
  constexpr int kSyncs = 20;
  DiskFacts facts;
  facts.folder = folder.string();
  // this is the spool's folder, which the first lesson will use
  if (const auto made = makePrivateFolder(folder); !made) {
    facts.trouble = "the folder " + facts.folder + " cannot be made: " + made.error().message;
    return facts;
  }
  std::error_code error;
  const auto space = std::filesystem::space(folder, error);
  facts.free_bytes = error ? 0 : static_cast<double>(space.available);

  std::string name = (folder / "self-test-XXXXXX").string();
  const int fd = ::mkstemp(name.data());
  if (fd < 0) {
    facts.trouble = systemError("cannot write to", folder, errno);
    return facts;
  }
  const std::array<char, 8192> block{};
  std::vector<double> seconds;
  for (int i = 0; i < kSyncs && facts.trouble.empty(); ++i) {
    const std::int64_t from_ns = steadyNowNs();
    if (::write(fd, block.data(), block.size()) != static_cast<ssize_t>(block.size()) || ::fdatasync(fd) != 0)
      facts.trouble = systemError("cannot write to", folder, errno);
    seconds.push_back(static_cast<double>(steadyNowNs() - from_ns) * 1e-9);
  }
  ::close(fd);
  ::unlink(name.c_str());
  std::sort(seconds.begin(), seconds.end());
  facts.sync_median_s = seconds[seconds.size() / 2];
  facts.sync_max_s = seconds.back();
  return facts;
}

EngineFacts measureEngine(double rate_hz) {
  EngineFacts facts;
  for (const EmbeddedFile& file : sampleProfiles()) {
    std::string id;
    const auto tick_ns = tickOf(file, rate_hz, id);
    if (!tick_ns.ok()) {
      facts.trouble = tick_ns.error().message;
      return facts;
    }
    ++facts.scenes;
    if (*tick_ns > facts.tick_median_ns || facts.heaviest.empty()) {
      facts.tick_median_ns = *tick_ns;
      facts.heaviest = id;
    }
  }
  if (facts.scenes == 0) facts.trouble = "the program holds no sample scene";
  return facts;
}

// --- device ---

namespace {

constexpr double kWindow_s = 0.2;
constexpr double kKeptRate_hz = 1000;
constexpr std::uint32_t kWaitFor = kDeviceNotReady | kDeviceLost;

// mean square distance of a window's samples from their fitted line
double aboutLine(std::span<const ZeroForceSample> w) {
  const auto n = static_cast<double>(w.size());
  double t_mean = 0;
  Vec3 p_mean;
  for (const ZeroForceSample& s : w) {
    t_mean += s.t_s / n;
    p_mean += s.X_WH.p / n;
  }
  double tt = 0, pp = 0;
  Vec3 tp;
  for (const ZeroForceSample& s : w) {
    const double t = s.t_s - t_mean;
    const Vec3 p = s.X_WH.p - p_mean;
    tt += t * t;
    pp += normSquared(p);
    tp += p * t;
  }
  // the line uses two degrees of freedom per coordinate
  return tt > 0 ? std::max(0.0, pp - normSquared(tp) / tt) / (n - 2) : 0;
}

}  // namespace

double restNoise_m(std::span<const ZeroForceSample> samples) {
  std::vector<double> squares;
  for (std::size_t from = 0, i = 1; i <= samples.size(); ++i) {
    if (i < samples.size() && samples[i].t_s - samples[from].t_s < kWindow_s) continue;
    if (i - from >= 10) squares.push_back(aboutLine(samples.subspan(from, i - from)));
    from = i;
  }
  if (squares.empty()) return 0;
  return std::sqrt(medianOf(std::move(squares)));
}

DeviceFacts measureDevice(Device& device, TimeSource& clock, const DeviceTestSettings& settings,
                          const sigset_t& stop_signals, const std::function<void(const std::string&)>& log,
                          bool& stopped, TimeSource& time, TurnRunner& threads) {
  DeviceFacts facts;
  const double rate_hz = settings.rate_hz;
  facts.info = device.info();
  facts.rate_hz = rate_hz;
  stopped = false;
  if (Status opened = device.open(rate_hz); !opened.ok()) {
    facts.trouble = opened.error().message;
    return facts;
  }
  facts.info = device.info();

  // forwards each device status once
  std::string passed_on;
  const auto passOn = [&] {
    const std::string status = device.status();
    if (!status.empty() && status != passed_on) log(status);
    passed_on = status;
  };

  // some devices need time, or a person's hand, before they report
  ZeroForceLoop ready(device, clock, {rate_hz, ticksIn(settings.patience_s, rate_hz), 1});
  const auto waits = [&] {
    passOn();
    return ready.samples().empty() || (ready.condition() & kWaitFor) != 0;
  };
  ZeroForceRun run = runZeroForceLoop(ready, device, settings.real_time, stop_signals, waits, time, threads);
  stopped = run.stopped;

  ZeroForceSettings quiet;
  quiet.rate_hz = rate_hz;
  quiet.max_ticks = ticksIn(settings.seconds, rate_hz);
  quiet.keep_every = static_cast<std::uint64_t>(std::max(1.0, std::round(rate_hz / kKeptRate_hz)));
  ZeroForceLoop loop(device, clock, quiet);
  if (!stopped) {
    const auto reads = [&] {
      passOn();
      return true;
    };
    run = runZeroForceLoop(loop, device, settings.real_time, stop_signals, reads, time, threads);
    stopped = run.stopped;
  }
  facts.status = device.status();
  device.close();

  facts.loop = loop.stats();
  facts.realtime = run.realtime;
  const auto samples = loop.samples();
  Vec3 mean;
  for (const ZeroForceSample& s : samples) mean += s.X_WH.p / static_cast<double>(samples.size());
  for (const ZeroForceSample& s : samples) {
    facts.farthest_m = std::max(facts.farthest_m, norm(s.X_WH.p));
    facts.moved_m = std::max(facts.moved_m, norm(s.X_WH.p - mean));
  }
  if (!samples.empty()) facts.last_X_WH = samples.back().X_WH;
  facts.noise_m = restNoise_m(samples);
  return facts;
}

// --- server ---

namespace {

constexpr int kProbes = 8;
constexpr auto kProbePatience = std::chrono::seconds(2);

// measures several round trips
Status probe(BlockingClient& client, ClockProbe& clock) {
  for (int i = 1; i <= kProbes; ++i) {
    pb::Envelope ping;
    ping.mutable_ping()->set_id(static_cast<std::uint64_t>(i));
    const std::int64_t sent_ns = steadyNowNs();
    ping.mutable_ping()->set_sender_steady_ns(sent_ns);
    RETURN_IF_ERROR(client.send(ping));
    while (true) {
      ASSIGN_OR_RETURN(const auto answer, client.receive(kProbePatience));
      if (!answer.has_pong() || answer.pong().id() != static_cast<std::uint64_t>(i)) continue;
      clock.add(sent_ns, answer.pong().receiver_steady_ns(), steadyNowNs());
      break;
    }
  }
  return {};
}

}  // namespace

ServerFacts measureServer(const StationOptions& options, const Endpoint& server) {
  ServerFacts facts;
  facts.address = fmt::format("{}:{}", server.host, server.port);
  const auto key = loadStationKey(options.key_file);
  if (!key.ok()) {
    facts.trouble = key.error().message;
    return facts;
  }
  ClientConfig config;
  config.server = server;
  config.ca_file = options.ca_file;
  config.program = programText("station");
  config.login = stationLogin(options.station.empty() ? key->station : options.station, key->key);
  const std::int64_t from_ns = steadyNowNs();
  config.connect_timeout = kConnectOnceTimeout;
  auto client = BlockingClient::connect(config);
  if (!client.ok()) {
    facts.trouble = client.error().message;
    return facts;
  }
  const std::int64_t welcome_wall_ns = wallNowNs();
  facts.connect_s = static_cast<double>(steadyNowNs() - from_ns) * 1e-9;
  facts.name = client->welcome().name();
  facts.program = "server " + client->welcome().server_version();
  ClockProbe clock;
  if (auto probed = probe(*client, clock); !probed.ok()) {
    facts.trouble = probed.error().message;
    return facts;
  }
  facts.round_trip_s = static_cast<double>(clock.best()->round_trip_ns) * 1e-9;
  facts.clock_offset_s = static_cast<double>(client->welcome().server_unix_ns() - welcome_wall_ns) * 1e-9 +
                         facts.round_trip_s / 2;
  client->finish();
  return facts;
}

// --- output ---

const char* verdictText(Verdict verdict) {
  switch (verdict) {
    case Verdict::kOk:
      return "OK";
    case Verdict::kWarning:
      return "WARNING";
    case Verdict::kFailed:
      return "FAILED";
    case Verdict::kNotChecked:
      return "not checked";
  }
  return "?";
}

std::string selfTestText(const std::vector<Check>& checks) {
  constexpr std::size_t kVerdict = 13;
  std::size_t name = 0;
  for (const Check& check : checks) name = std::max(name, countCharacters(check.name) + 2);
  const std::size_t indent = name + kVerdict;
  std::string text;
  std::size_t count[4] = {};
  for (const Check& check : checks) {
    ++count[static_cast<std::size_t>(check.verdict)];
    std::string found = check.found;
    if (!check.limit.empty()) found += " (" + check.limit + ")";
    text += padded(check.name, name) + padded(verdictText(check.verdict), kVerdict);
    text += found.empty() ? "\n" : wrapped(found, indent).substr(indent);
    if (!check.advice.empty()) text += wrapped("→ " + check.advice, indent);
  }
  text += fmt::format("\n{} checks: {} OK, {} warnings, {} failed, {} not made\n", checks.size(), count[0],
                      count[1], count[2], count[3]);
  if (count[static_cast<std::size_t>(Verdict::kFailed)] > 0)
    text += "Do not begin a lesson before what FAILED is put right.\n";
  else if (count[static_cast<std::size_t>(Verdict::kWarning)] > 0)
    text += "Lessons can begin; the warnings say what would make them better.\n";
  else
    text += "Lessons can begin.\n";
  return text;
}

std::string selfTestJson(const std::vector<Check>& checks) {
  auto rows = nlohmann::ordered_json::array();
  for (const Check& check : checks) {
    nlohmann::ordered_json row = {{"check", check.name}, {"verdict", verdictText(check.verdict)}};
    row["value"] = check.value && std::isfinite(*check.value) ? nlohmann::ordered_json(*check.value)
                                                              : nlohmann::ordered_json(nullptr);
    row["unit"] = check.unit;
    row["found"] = check.found;
    row["limit"] = check.limit;
    row["advice"] = check.advice;
    rows.push_back(row);
  }
  return reportJson(rows);
}

// --- the command ---

namespace {

constexpr double kSelfTestDefault_s = 5, kSelfTestLongest_s = 600;

// keeps the simulated hand still during the test
DeviceOptions quietOptions(const StationOptions& options, double seconds) {
  DeviceOptions device{{}, {}, options.X_HT, options.hand};
  device.hand.plan = "rest";
  device.hand.hold_s = std::min(600.0, seconds + 5);
  device.hand.repeat = 0;
  device.hand.tremor_m = 0;
  return device;
}

}  // namespace

int runSelfTest(const StationOptions& options, const sigset_t& stop_signals) {
  const auto log = [](const std::string& text) { std::cerr << "station: " << text << std::endl; };
  if (options.seconds > kSelfTestLongest_s) {
    log(outOfRange("--seconds of a self-test", options.seconds, {0.001, kSelfTestLongest_s}).message);
    return kExitInvalid;
  }
  const double seconds = options.seconds > 0 ? options.seconds : kSelfTestDefault_s;
  SelfTestFacts facts;
  facts.device.spec = options.device;
  auto device = makeDevice(options.device, quietOptions(options, seconds));
  if (!device.ok() && device.error().code == ErrorCode::kInvalidInput) {
    log(device.error().message);
    return kExitInvalid;
  }
  if (!device.ok()) {
    facts.device.trouble = device.error().message;
  } else {
    log("testing " + (*device)->info().name + numberText(seconds).insert(0, " for ") +
        " s; it gives no force. Leave the handle alone");
    RtOptions real_time;
    real_time.cpu = coreForLoop(options.cpu);
    real_time.cpu_needs_fifo = !options.cpu;
    real_time.spin_ns = std::llround(options.spin_us * 1e3);
    real_time.rate_hz = options.rate_hz;
    LoopTime clock(real_time.spin_ns);
    bool stopped = false;
    DeviceTestSettings settings;
    settings.rate_hz = options.rate_hz;
    settings.seconds = seconds;
    settings.real_time = &real_time;
    facts.device = measureDevice(**device, clock, settings, stop_signals, log, stopped);
    if (stopped) {
      log("stopped; the test is not complete");
      return kExitFailed;
    }
  }
  facts.device.spec = options.device;
  facts.device.rate_hz = options.rate_hz;
  facts.device.hardware = options.device != "simulated" && !options.device.starts_with("recording:");
  facts.device.tool_given = options.tool_given;
  facts.device.X_HT = options.X_HT;
  if (facts.device.info) facts.device.delay = loopDelayOf(options, *facts.device.info);
  facts.machine = measureMachine();
  facts.monitor = {options.window.viewing, !options.headless, connectedMonitors()};
  facts.engine = measureEngine(options.rate_hz);
  facts.disk = measureDisk(options.spool);
  for (const Endpoint& server : options.servers) facts.servers.push_back(measureServer(options, server));

  const auto checks = judge(facts);
  const bool failed =
      std::any_of(checks.begin(), checks.end(), [](const Check& c) { return c.verdict == Verdict::kFailed; });
  return printReport(options, selfTestText(checks), selfTestJson(checks), failed ? kExitFailed : kExitDone);
}

}  // namespace needlelab
