/// What an attacker costs others: the time of another person's ping, and the server's memory, while a trainee
/// sends references of 524,200 empty ids from 8 connections as fast as they are refused. Server and peers
/// share one process and its memory. Goals (issue 18): ping p99 < 50 ms, growth < 64 MiB.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>
#include <vector>

#include "server/live/monitor/monitor.h"
#include "tests/unit/server/live/raw_peer.h"

namespace needlelab::test {
namespace {

constexpr const char* kPassword = "correct horse battery";
constexpr std::size_t kConnections = 8;
constexpr int kIds = 524'200;

struct Pings {
  std::vector<double> ms;
  std::uint64_t most_bytes = 0;
  [[nodiscard]] double quantile(double q) {
    std::sort(ms.begin(), ms.end());
    return ms.empty() ? 0 : ms[static_cast<std::size_t>(q * static_cast<double>(ms.size() - 1))];
  }
};

Pings pingFor(RawPeer& peer, std::chrono::seconds time) {
  Pings pings;
  const auto end = std::chrono::steady_clock::now() + time;
  while (std::chrono::steady_clock::now() < end) {
    pb::Envelope ping;
    ping.mutable_ping()->set_id(pings.ms.size() + 1);
    const std::int64_t from_ns = steadyNowNs();
    peer.send(ping);
    const auto pong = peer.receive();
    if (!pong || !pong->has_pong()) {
      std::fprintf(stderr, "attack_bench: the ping was not answered\n");
      std::_Exit(1);
    }
    pings.ms.push_back(static_cast<double>(steadyNowNs() - from_ns) * 1e-6);
    pings.most_bytes = std::max<std::uint64_t>(pings.most_bytes, processFacts().rss_bytes);
    std::this_thread::sleep_for(milliseconds(5));
  }
  return pings;
}

int run(std::chrono::seconds time) {
  RunningServer server([](ServerOptions& options) { options.bounds.refusals = SIZE_MAX; });
  server.addUser("tina", pb::TRAINEE, kPassword);
  server.addUser("ines", pb::INSTRUCTOR, kPassword);
  RawPeer other(server);
  (void)other.logIn(personLogin("ines", kPassword));
  std::vector<std::unique_ptr<RawPeer>> attackers;
  for (std::size_t i = 0; i < kConnections; ++i) {
    attackers.push_back(std::make_unique<RawPeer>(server));
    (void)attackers.back()->logIn(personLogin("tina", kPassword));
  }
  pb::Envelope reference;
  for (int i = 0; i < kIds; ++i) reference.mutable_request()->mutable_set_reference()->add_session_ids();
  const std::string bytes = RawPeer::framed(reference);
  reference.Clear();

  Pings quiet = pingFor(other, time);
  std::atomic<bool> over = false;
  std::atomic<std::uint64_t> refused = 0;
  std::vector<std::thread> threads;
  for (auto& attacker : attackers) {
    threads.emplace_back([&over, &refused, &bytes, peer = attacker.get()] {
      while (!over) {
        peer->write(bytes);
        if (!peer->receive()) return;
        ++refused;
      }
    });
  }
  Pings attacked = pingFor(other, time);
  over = true;
  for (std::thread& thread : threads) thread.join();
  const double growth_MiB =
      (static_cast<double>(attacked.most_bytes) - static_cast<double>(quiet.most_bytes)) / (1u << 20);
  std::printf(
      "ping p50 %.2f ms, p99 %.2f ms before; p50 %.2f ms, p99 %.2f ms during %llu refused references\n",
      quiet.quantile(0.5), quiet.quantile(0.99), attacked.quantile(0.5), attacked.quantile(0.99),
      static_cast<unsigned long long>(refused.load()));
  std::printf("memory grew by %.1f MiB\n", growth_MiB);
  return 0;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  return needlelab::test::run(std::chrono::seconds(argc > 1 ? std::atoi(argv[1]) : 10));
}
