/// Those who flood a server from other addresses of this machine (127.0.0.2 …), each kind in a thread of its
/// own and at a rate of its own, so that what they cost the server can be told from what they cost the
/// machine.
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
  std::atomic<std::uint64_t> turned_away{0};   ///< connections that the server did not take, or cut
};

/// Name and key of a station.
using StolenKey = std::pair<std::string, std::string>;

/// Thread: begins and ends with it. Two stations' keys were stolen: some floods come from behind the log-in.
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
  /// False when it is over; else after the pause.
  [[nodiscard]] bool goOn(int pause_ms) const;

  const std::filesystem::path ca_;
  const std::uint16_t port_;
  const StolenKey first_, second_;
  std::atomic<bool> over_{false};
  AttackCounts counts_;
  std::vector<std::thread> threads_;
};

}  // namespace needlelab::test
