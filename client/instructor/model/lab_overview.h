/// Overview of the lab: a tile for each station, ordered by need for help. Pure; has no clock.
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

/// Reasons to look at a station, most urgent first.
enum class Need : std::uint8_t {
  kFault,           ///< the gate removed the force
  kExcessiveForce,  ///< now, or within the last kNeedLasts_s
  kHazard,          ///< a hazard, bone or the skin under the hub was touched in this lesson
  kTrouble,         ///< the station reports trouble: disk, device, loop
  kLost,            ///< went offline in mid-lesson
  kWaiting,         ///< online, without a lesson
  kDone,            ///< a lesson ended within kDoneLasts_s
  kPractising,      ///< a lesson without trouble
  kOffline,
};
inline constexpr std::size_t kNeedCount = 9;
std::string_view nameOf(Need need);
Condition conditionOf(Need need);
/// For a filter: "help" is kFault … kLost.
inline bool needsHelp(Need need) {
  return need <= Need::kLost;
}

/// A tile keeps the need kExcessiveForce this long, so that an instructor does not miss a peak.
inline constexpr double kNeedLasts_s = 10;
/// A tile keeps the need kDone this long.
inline constexpr double kDoneLasts_s = 120;
/// Force limit if the exercise sets none.
inline constexpr double kExcessiveForce_N = 8;
/// A station without status lines for this long is stale. They come at 10 Hz, or less often with many
/// stations.
inline constexpr double kStale_s = 3;

/// The contents of a tile.
struct StationTile {
  std::string station, trainee, exercise;
  std::string session_id;  ///< 16 bytes; empty: idle
  bool online = false, stale = false, revoked = false;
  std::uint32_t phase = 0;
  int layer = -1;
  std::string layer_name;
  double insertion_m = 0, force_N = 0, peak_force_N = 0, force_limit_N = kExcessiveForce_N;
  double lesson_s = 0;  ///< since the session's start if known, otherwise its first received status line
  std::uint32_t fault = 0;
  std::vector<std::string> hazards;  ///< touched in this lesson; also "bone contact" and "hub on the skin"
  std::string trouble;
  std::string server;  ///< that has the station; empty: the lab has one server
  std::uint64_t missed_ticks = 0, samples = 0, spool_left = 0;
  std::uint32_t wakeup_p99_us = 0;
  Need need = Need::kOffline;
  std::string why;             ///< the need, for people: "force 9.1 N, allowed 6 N"
  std::deque<float> forces_N;  ///< from the last status lines, oldest first, for a sparkline
};

enum class TileOrder : std::uint8_t { kNeed, kName, kTrainee, kPeakForce };
struct TileFilter {
  bool only_help = false, only_online = false;
  std::string text = {};  ///< part of station, trainee or exercise; ignores case
};

/// Thread: one.
class LabOverview {
 public:
  static constexpr std::size_t kForcesKept = 100;

  /// Takes the server's list of stations with their statuses. Removes stations that are not in it.
  void setStations(const pb::Stations& stations, double now_s);
  /// Takes a status line. `now_s`: the view's clock, ascending.
  void onStatus(const pb::StationStatus& status, double now_s);
  /// Ages the tiles. Call it once a frame.
  void tick(double now_s);
  /// Marks all stations as stale until news arrive.
  void connectionLost();

  [[nodiscard]] const StationTile* find(const std::string& station) const;
  /// Returns the filtered tiles in order. With kNeed: urgent first, then by name; tiles of the same need keep
  /// their order, so that nothing jumps under the pointer.
  [[nodiscard]] std::vector<const StationTile*> tiles(TileOrder order, const TileFilter& filter = {}) const;
  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  /// Returns the number of tiles for each need.
  [[nodiscard]] std::array<std::size_t, kNeedCount> counts() const;

 private:
  struct Entry {
    StationTile tile;
    double news_s = -1e9;    // time of the last status line
    double began_s = 0;      // time of the session's first status line
    double excess_s = -1e9;  // last time with force above its limit
    double excess_N = 0;
    double ended_s = -1e9;  // time of a lesson's end
    bool lost_in_lesson = false;
  };
  void judge(Entry& entry, double now_s) const;
  std::map<std::string, Entry> entries_;
};

}  // namespace needlelab
