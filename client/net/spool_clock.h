/// How old the closed sessions of a spool are, whatever the station's clock says.
#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>

namespace needlelab {

/// The time that the spool saw passing: the server's clock from one log-in to the next, in steps of at most a
/// day and never back. So no jump of a clock, here or at the server, ages a session by more than a day; a
/// station that is seldom connected keeps its sessions longer, within the quota. Kept in a file: it goes on
/// after a restart, and begins at 0 again when the file is damaged, which keeps sessions longer as well.
/// Thread: any.
class SpoolClock {
 public:
  static constexpr std::int64_t kMostStep_ns = std::int64_t{86'400} * 1'000'000'000;

  /// Goes on from what the file says.
  explicit SpoolClock(std::filesystem::path file);

  /// Notes the server's time (Welcome.server_unix_ns) at a log-in. Writes the file at most once a minute of
  /// the server's time. A disk that refuses costs only time that is not counted after a restart.
  void note(std::int64_t server_unix_ns);
  /// The time seen so far, in ns.
  [[nodiscard]] std::int64_t nowNs() const;

 private:
  std::filesystem::path file_;
  mutable std::mutex mutex_;  // guards all that follows
  std::int64_t seen_ns_ = 0;
  std::int64_t server_unix_ns_ = 0;  // when it was last noted; 0: never
};

}  // namespace needlelab
