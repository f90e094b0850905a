/// How old the closed sessions of a spool are, whatever the station's clock says.
#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>

namespace needlelab {

/// The time that the spool saw passing: the server's clock from one log-in to the next, in steps of at most a
/// day and never back; while the program runs, in steps of no more than has passed here. So no jump of a
/// clock, here or at the server, ages a session by more than a day, and going to and fro between servers
/// whose clocks differ ages none. A station that is seldom connected keeps its sessions longer, within the
/// quota. Kept in a file: it goes on after a restart, and begins at 0 again when the file is damaged, which
/// keeps sessions longer as well. Thread: any.
class SpoolClock {
 public:
  static constexpr std::int64_t kMostStep_ns = std::int64_t{86'400} * 1'000'000'000;

  /// Goes on from what the file says.
  explicit SpoolClock(std::filesystem::path file);

  /// Notes the server's time (Welcome.server_unix_ns) at a log-in. `steady_ns`: this machine's steady clock
  /// at the same moment; 0: not known. Writes the file at most once a minute of the server's time. A disk
  /// that refuses costs only time that is not counted after a restart.
  void note(std::int64_t server_unix_ns, std::int64_t steady_ns = 0);
  /// The time seen so far, in ns.
  [[nodiscard]] std::int64_t nowNs() const;
  /// The server's time when it was last noted; 0: never.
  [[nodiscard]] std::int64_t lastServerUnixNs() const;

 private:
  std::filesystem::path file_;
  mutable std::mutex mutex_;  // guards all that follows
  std::int64_t seen_ns_ = 0;
  std::int64_t server_unix_ns_ = 0;  // when it was last noted; 0: never
  std::int64_t steady_ns_ = 0;       // at that moment; 0: not known, or of an earlier run
};

/// "this computer's clock is 1.5 h ahead of the server's"; empty for less than a minute.
std::string clockOffText(std::int64_t ahead_ns);

}  // namespace needlelab
