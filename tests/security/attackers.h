/// Attackers flood a server from other addresses of this machine (127.0.0.2 …). Each kind of attack has its
/// own thread and rate, so that a test can separate the cost to the server from the cost to the machine.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace needlelab::test {

struct AttackCounts {
  std::atomic<std::uint64_t> garbage{0};       ///< connections that sent random bytes
  std::atomic<std::uint64_t> half_open{0};     ///< handshakes begun and held
  std::atomic<std::uint64_t> slow{0};          ///< bytes sent one at a time within TLS
  std::atomic<std::uint64_t> oversized{0};     ///< frames announced above the limit, before log-in
  std::atomic<std::uint64_t> oversized_in{0};  ///< … after log-in, by a station with a key
  std::atomic<std::uint64_t> guesses{0};       ///< wrong passwords
  std::atomic<std::uint64_t> churn{0};         ///< connections closed at once
  std::atomic<std::uint64_t> pings{0};         ///< sent as fast as possible by a station with a key
  std::atomic<std::uint64_t> turned_away{0};   ///< connections that the server refused or closed
};

/// A station's name and key.
using StolenKey = std::pair<std::string, std::string>;

/// The threads run for the object's lifetime. Two station keys were stolen, so some floods come from
/// logged-in connections.
class Attackers {
 public:
  Attackers(std::filesystem::path ca, std::uint16_t port, StolenKey first, StolenKey second);
  ~Attackers();
  Attackers(const Attackers&) = delete;
  Attackers& operator=(const Attackers&) = delete;
  [[nodiscard]] const AttackCounts& counts() const { return counts_; }

 private:
  void garbage();
  void halfOpen();
  void slowLoris();
  void oversized();
  void oversizedLoggedIn();
  void guesses();
  void churn();
  void pings();
  /// Waits for the pause. Returns false if the attack is over.
  [[nodiscard]] bool goOn(int pause_ms) const;

  const std::filesystem::path ca_;
  const std::uint16_t port_;
  const StolenKey first_, second_;
  std::atomic<bool> over_{false};
  AttackCounts counts_;
  std::vector<std::thread> threads_;
};

}  // namespace needlelab::test
