/// The whole lab at a glance: a tile for each station, ordered by who needs help. Pure; no clock of its own.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "client/view/model/palette.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Why somebody should look at a station, most urgent first.
enum class Need : std::uint8_t {
  kFault,           ///< the force was taken away
  kExcessiveForce,  ///< now, or within the last kNeedLasts_s
  kHazard,          ///< touched in this lesson
  kTrouble,         ///< the station reports trouble: disk, device, loop
  kLost,            ///< went offline in mid-lesson
  kWaiting,         ///< online, nobody practises
  kDone,            ///< a lesson ended a moment ago
  kPractising,      ///< all is well
  kOffline,
};
inline constexpr std::size_t kNeedCount = 9;
std::string_view nameOf(Need need);
Condition conditionOf(Need need);
/// For a filter: "help" is kFault … kLost.
inline bool needsHelp(Need need) {
  return need <= Need::kLost;
}

/// Excessive force is remembered for so long, so that a peak is not missed between two looks.
inline constexpr double kNeedLasts_s = 10;
/// A lesson counts as just ended for so long.
inline constexpr double kDoneLasts_s = 120;
/// Where the exercise sets no limit on the force.
inline constexpr double kExcessiveForce_N = 8;
/// Status lines come at 10 Hz or, with many stations, less often; without any for so long a station is stale.
inline constexpr double kStale_s = 3;

/// What a tile shows.
struct StationTile {
  std::string station, trainee, exercise;
  std::string session_id;  ///< 16 bytes; empty: idle
  bool online = false, stale = false, revoked = false;
  std::uint32_t phase = 0;
  int layer = -1;
  std::string tissue;
  double insertion_m = 0, force_N = 0, peak_force_N = 0, force_limit_N = kExcessiveForce_N;
  double lesson_s = 0;  ///< since the first status line of this session that we saw, or its start where known
  std::uint32_t fault = 0;
  std::vector<std::string> hazards;
  std::string trouble;
  std::uint64_t missed_ticks = 0, samples = 0, spool_left = 0;
  std::uint32_t wakeup_p99_us = 0;
  Need need = Need::kOffline;
  std::string why;             ///< the need, for people: "force 9.1 N, allowed 6 N"
  std::deque<float> forces_N;  ///< of the last status lines, oldest first: a sparkline
};

enum class TileOrder : std::uint8_t { kNeed, kName, kTrainee, kPeakForce };
struct TileFilter {
  bool only_help = false, only_online = false;
  std::string text = {};  ///< part of station, trainee or exercise, upper or lower case
};

/// Thread: one.
class LabOverview {
 public:
  static constexpr std::size_t kForcesKept = 100;

  /// All stations that the server knows, with the statuses in it; those that are not in it are forgotten.
  void setStations(const pb::Stations& stations, double now_s);
  /// A status line. `now_s`: the view's own clock, ascending.
  void onStatus(const pb::StationStatus& status, double now_s);
  /// Ages the tiles. Call it once a frame.
  void tick(double now_s);
  /// The connection is lost: everything is stale until news come.
  void connectionLost();

  [[nodiscard]] const StationTile* find(const std::string& station) const;
  /// Chosen and ordered. With kNeed: urgent first, then by name; the order of two tiles of the same need
  /// never changes by itself, so that nothing jumps under the pointer.
  [[nodiscard]] std::vector<const StationTile*> tiles(TileOrder order, const TileFilter& filter = {}) const;
  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  /// How many tiles have which need.
  [[nodiscard]] std::array<std::size_t, kNeedCount> counts() const;

 private:
  struct Entry {
    StationTile tile;
    double news_s = -1e9;    // of the last status line
    double began_s = 0;      // when this session was seen first
    double excess_s = -1e9;  // force above its limit
    double excess_N = 0;
    double ended_s = -1e9;  // a lesson ended
    bool lost_in_lesson = false;
  };
  void judge(Entry& entry, double now_s) const;
  std::map<std::string, Entry> entries_;
};

}  // namespace needlelab
