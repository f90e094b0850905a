/// Log-ins of good stations while strangers hold TLS handshakes: each sends a complete first message and then
/// nothing. Goal: from 2 and from 20 attacking addresses at least 95 % of the good ones, TCP to Welcome,
/// within 1 s, while 50 stations reconnect. The server is a program of its own; attackers and stations share
/// the machine with it.
#include <fmt/core.h>
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "client/net/link/blocking_client.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/time/clock.h"
#include "common/wire/tls.h"
#include "tests/bench/result_folder.h"
#include "tests/load/server/own_server.h"
#include "tests/support/silent_peer.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kStations = 50;
constexpr std::size_t kSilentMost = 1200;  ///< held at once, of all attackers
constexpr double kSilentPerSecond = 500;   ///< begun, of all attackers
constexpr auto kBetweenLogins = 500ms;     ///< of one station
constexpr double kGoal_percent = 95;

struct Settings {
  std::filesystem::path results;
  std::string commit;
  std::size_t seconds = 10;
};

[[noreturn]] void die(const std::string& text) {
  std::fprintf(stderr, "handshake_bench: %s\n", text.c_str());
  std::_Exit(1);
}
template <typename T>
T must(Result<T> result) {
  if (!result.ok()) die(result.error().message);
  return std::move(*result);
}

struct Row {
  std::size_t addresses = 0, silent = 0, refused = 0;  ///< silent: begun; refused: the server took no more
  std::vector<double> log_in_ms;                       ///< of the good ones; a failure counts as infinite
  [[nodiscard]] double within1s_percent() const {
    const auto good = std::count_if(log_in_ms.begin(), log_in_ms.end(), [](double ms) { return ms <= 1000; });
    return 100 * static_cast<double>(good) / static_cast<double>(std::max<std::size_t>(1, log_in_ms.size()));
  }
  [[nodiscard]] double quantile_ms(double q) const {
    if (log_in_ms.empty()) return 0;
    return log_in_ms[static_cast<std::size_t>(q * static_cast<double>(log_in_ms.size() - 1))];
  }
};

/// Begins handshakes from its addresses and holds the newest of them.
void attack(std::size_t addresses, std::uint16_t port, const std::atomic<bool>& over, Row& row) {
  const std::string hello = clientHello();
  std::deque<std::unique_ptr<SilentPeer>> held;
  const std::int64_t begin_ns = steadyNowNs();
  while (!over) {
    const auto due =
        static_cast<std::size_t>(1e-9 * static_cast<double>(steadyNowNs() - begin_ns) * kSilentPerSecond);
    if (row.silent >= due) {
      std::this_thread::sleep_for(2ms);
      continue;
    }
    const std::string from = "127.0.0." + std::to_string(2 + row.silent++ % addresses);
    try {
      held.push_back(std::make_unique<SilentPeer>(from, port, hello));
    } catch (const std::runtime_error&) {
      ++row.refused;
    }
    if (held.size() > kSilentMost) held.pop_front();
  }
}

Row measure(std::size_t addresses, const OwnServer& server, const Enrolled& enrolled,
            const Settings& settings) {
  Row row;
  row.addresses = addresses;
  std::atomic<bool> over{false};
  std::thread attacker;
  if (addresses > 0) attacker = std::thread([&] { attack(addresses, server.port(), over, row); });
  std::this_thread::sleep_for(2s);  // until the attackers hold what they can
  std::mutex mutex;
  const auto tls = must(makeClientTls(server.caFile()));
  std::vector<std::thread> stations;
  for (std::size_t i = 0; i < kStations; ++i) {
    stations.emplace_back([&, i] {
      ClientConfig config;
      config.server.port = server.port();
      config.tls = tls;
      config.program = programText("bench");
      config.login = stationLogin(enrolled.stations[i].first, enrolled.stations[i].second);
      std::this_thread::sleep_for(kBetweenLogins * static_cast<int>(i) / static_cast<int>(kStations));
      while (!over) {
        const std::int64_t begin_ns = steadyNowNs();
        {
          const auto client = BlockingClient::connect(config);
          const double ms = client.ok() ? 1e-6 * static_cast<double>(steadyNowNs() - begin_ns) : 1e9;
          const std::lock_guard lock(mutex);
          row.log_in_ms.push_back(ms);
        }
        std::this_thread::sleep_for(kBetweenLogins);
      }
    });
  }
  std::this_thread::sleep_for(std::chrono::seconds(settings.seconds));
  over = true;
  for (std::thread& station : stations) station.join();
  if (attacker.joinable()) attacker.join();
  std::sort(row.log_in_ms.begin(), row.log_in_ms.end());
  return row;
}

int run(const Settings& settings) {
  rlimit files{};
  ::getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = files.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &files);
  TempFolder folder;
  const Enrolled enrolled = must(enrol(folder.path() / "data", kStations));
  const auto bin = std::filesystem::read_symlink("/proc/self/exe").parent_path();

  std::string text =
      "| attacking addresses | handshakes begun and held | log-ins | within 1 s | p50 | p99 | goal |\n"
      "|---|---|---|---|---|---|---|\n";
  bool passed = true;
  for (const std::size_t addresses : {std::size_t{0}, std::size_t{2}, std::size_t{20}}) {
    // a fresh server each time: it knows no address yet
    OwnServer server(bin / "needlelab-server", folder.path());
    if (const Status started = server.start(); !started.ok()) die(started.error().message);
    const Row row = measure(addresses, server, enrolled, settings);
    const bool good = row.within1s_percent() >= kGoal_percent;
    passed = passed && good;
    text += fmt::format("| {} | {} ({} refused) | {} | {:.1f} % | {:.0f} ms | {:.0f} ms | ≥ {:.0f} %: {} |\n",
                        row.addresses, row.silent, row.refused, row.log_in_ms.size(), row.within1s_percent(),
                        row.quantile_ms(0.5), row.quantile_ms(0.99), kGoal_percent, good ? "PASS" : "FAIL");
    if (const Status stopped = server.stop(); !stopped.ok()) die(stopped.error().message);
  }
  std::fputs(text.c_str(), stdout);
  if (!settings.results.empty()) {
    const std::string machine = machineText();
    const auto to = settings.results / folderName(machine);
    std::filesystem::create_directories(to);
    const std::string page = fmt::format(
        "# Log-ins beside silent handshakes\n\n{}, {}, commit {}.\n{} stations log in every {} ms; TCP, TLS, "
        "log-in.\n\n{}",
        nowText(), machine, settings.commit.empty() ? "unknown" : settings.commit, kStations,
        kBetweenLogins.count(), text);
    if (const Status written = writeFileAtomically(to / "handshakes.md", viewOf(page)); !written.ok())
      die(written.error().message);
  }
  return passed ? 0 : 1;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  needlelab::test::Settings settings;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    if (name == "--results")
      settings.results = value;
    else if (name == "--commit")
      settings.commit = value;
    else if (name == "--seconds")
      settings.seconds = std::max(1ul, std::strtoul(value.c_str(), nullptr, 10));
    else
      return std::fprintf(stderr, "handshake_bench: unknown option %s\n", name.c_str()), 2;
  }
  return needlelab::test::run(settings);
}
