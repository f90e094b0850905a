/// Takes what the black box keeps and writes it to files, beside the loop.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "client/station/run/black_box.h"

namespace needlelab {

/// What a session's black box gave.
struct BlackBoxCounts {
  std::uint64_t triggers = 0;       ///< faults and storms of missed ticks
  std::uint64_t files = 0;          ///< written
  std::uint64_t not_written = 0;    ///< stretches that the disk refused
  std::uint64_t not_kept = 0;       ///< triggers beyond the most that is kept of a session
  std::uint64_t ticks_refused = 0;  ///< ticks that found the ring full
};

/// Files are FOLDER/SESSION-NN.csv; the folder is made when the first one is written.
/// Thread: made, `finish`ed and destroyed by one; `counts` by any; `say` runs on the writer's own thread.
class BlackBoxWriter {
 public:
  /// `box` must outlive the writer. `say` tells a person what was written and where, or that it was not.
  BlackBoxWriter(BlackBox& box, std::filesystem::path folder, std::string session,
                 std::function<void(const std::string&)> say);
  ~BlackBoxWriter() { finish(); }
  BlackBoxWriter(const BlackBoxWriter&) = delete;
  BlackBoxWriter& operator=(const BlackBoxWriter&) = delete;

  /// After the loop's end: writes what is left, says what was not kept, joins the thread. May be called
  /// again.
  void finish();
  [[nodiscard]] BlackBoxCounts counts() const noexcept;

 private:
  void run();
  void writeAll();

  BlackBox& box_;
  std::filesystem::path folder_;
  std::string session_;
  std::function<void(const std::string&)> say_;
  std::vector<BlackBoxTick> ticks_;  // the writing thread's own
  std::atomic<std::uint64_t> files_{0}, not_written_{0};
  std::atomic<bool> finish_{false};
  std::thread thread_;
};

/// Removes black boxes that are older than `age_s`; gives how many. What cannot be removed stays.
std::size_t removeOldBlackBoxes(const std::filesystem::path& folder, std::int64_t age_s);

}  // namespace needlelab
