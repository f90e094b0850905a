/// The age of a spool's closed sessions, independent of the station's clock.
#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>

namespace needlelab {

/// The time that has passed as seen by the spool: the server's clock from one log-in to the next, in steps of
/// at most a day, never backwards; while the program runs, each step is at most the time that has passed
/// here. So no clock jump, here or at the server, ages a session by more than a day, and switching between
/// servers with different clocks does not age it. A rarely connected station keeps its sessions longer,
/// within the quota. Stored in a file: continues after a restart, and restarts at 0 if the file is damaged,
/// which also keeps sessions longer. Thread: any.
class SpoolClock {
 public:
  static constexpr std::int64_t kMaxStep_ns = std::int64_t{86'400} * 1'000'000'000;

  /// Continues from the value in the file.
  explicit SpoolClock(std::filesystem::path file);

  /// Notes the server's time (Welcome.server_unix_ns) at a log-in. `steady_ns`: this machine's steady clock
  /// at the same moment; 0: unknown. Writes the file at most once a minute of the server's time. If the disk
  /// refuses, the time since the last write is not counted after a restart.
  void note(std::int64_t server_unix_ns, std::int64_t steady_ns = 0);
  /// The time seen so far, in ns.
  [[nodiscard]] std::int64_t nowNs() const;
  /// The server's time when it was last noted; 0: never.
  [[nodiscard]] std::int64_t lastServerUnixNs() const;

 private:
  std::filesystem::path file_;
  mutable std::mutex mutex_;  // guards all that follows
  std::int64_t seen_ns_ = 0;
  std::int64_t server_unix_ns_ = 0;  // at the last note(); 0: never
  std::int64_t steady_ns_ = 0;       // at the same moment; 0: unknown, or from an earlier run
};

/// "this computer's clock is 1.5 h ahead of the server's"; empty for less than a minute.
std::string clockOffText(std::int64_t ahead_ns);

}  // namespace needlelab
