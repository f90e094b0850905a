/// Overview of the lab: a tile for each station, and who calls for help. Pure; has no clock.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "client/instructor/model/live/help_calls.h"
#include "client/view/model/palette.h"
#include "common/base/text/text.h"
#include "common/scoring/alarms/alarms.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// How long a tile keeps the need kDone.
inline constexpr double kDoneLasts_s = 120;
/// A station without a status line for this long is stale. Lines come at 10 Hz, or slower with many stations.
inline constexpr double kStale_s = 3;

/// An alarm that is active, or that the instructor has not acknowledged.
struct TileAlarm {
  std::string name, words;  ///< "hazard"; "HAZARD axillary nerve", "anna, earlier: HAZARD axillary nerve"
  bool now = false, seen = false, danger = false;
  bool earlier = false;  ///< of a lesson before the tile's
};

/// The contents of a tile.
struct StationTile {
  std::string station, trainee, exercise;  ///< the last two stay until the next lesson
  std::string session_id;                  ///< 16 bytes; empty: idle
  std::string verdict;                     ///< on the lesson that ended: "not passed", "no verdict yet"
  std::optional<bool> passed;              ///< likewise; none: no verdict yet, or nothing is required
  bool online = false, stale = false, revoked = false;
  std::uint32_t phase = 0;
  int layer = -1;
  std::string layer_name;
  double insertion_m = 0, force_N = 0, peak_force_N = 0, force_limit_N = kUsualForceLimit_N;
  double lesson_s = 0;  ///< since the session's start if known, otherwise since its first status line
  std::uint32_t fault = 0;
  bool hand_raised = false;
  /// Most urgent first, then those of earlier lessons; without those that are over and acknowledged.
  std::vector<TileAlarm> alarms;
  std::string trouble;
  std::string server;  ///< of this station; empty if the lab has only one server
  std::uint64_t missed_ticks = 0, samples = 0, spool_left = 0;
  std::uint32_t wakeup_p99_us = 0;
  Need need = Need::kOffline;
  bool calls = false;          ///< it needs help, and the call was neither seen nor put off
  std::string why;             ///< reason for the need, for people: "force 9.1 N, allowed 6 N"
  std::deque<float> forces_N;  ///< from the last status lines, oldest first, for a sparkline
};

/// A lesson that is done is as good as its verdict.
Condition conditionOf(const StationTile& tile);
/// Trainee and exercise, also after the lesson: "anna · Knee: suprapatellar recess". Before the first one:
/// "no lesson". Until the server reports the trainee: "name not known yet · …". `exercise`: its name.
std::string lessonWords(const StationTile& tile, const std::string& exercise);
/// Needle position: "inserting, 12.3 mm, tip in fat"; empty without a lesson.
std::string depthWords(const StationTile& tile);
/// "2.3 N, peak 3.1 N"
std::string forceWords(const StationTile& tile);
/// For a technician: "loop: 99 % within 12 µs, 3 ticks missed, 2 chunks wait". Omits values that the station
/// does not send.
std::string healthWords(const StationTile& tile);

struct TileFilter {
  bool only_online = false;
  std::string text = {};  ///< part of station, trainee or exercise; ignores case
};

/// Thread: one.
class LabOverview {
 public:
  static constexpr std::size_t kForcesKept = 100;
  static constexpr double kSnooze_s = 300;

  /// Takes the server's list of stations with their statuses. Removes stations that are not in it.
  void setStations(const pb::Stations& stations, double now_s);
  /// Takes a status line. `now_s`: the view's clock, ascending.
  void onStatus(const pb::StationStatus& status, double now_s);
  /// An instructor has seen the station's call, and its alarms so far, also those of earlier lessons.
  void acknowledge(const std::string& station);
  /// Puts the station's call off for kSnooze_s.
  void snooze(const std::string& station);
  [[nodiscard]] const HelpCalls& calls() const { return calls_; }
  /// Returns the ended sessions whose verdict to request from the server now (GetSession). Each call counts
  /// as a request; an id comes again 2 s later.
  [[nodiscard]] std::vector<std::string> verdictsToRequest(double now_s);
  /// Takes a session from the server; does nothing before it is scored.
  void takeVerdict(const pb::SessionInfo& session);
  /// Ages the tiles. Call it once a frame.
  void tick(double now_s);
  /// Marks all stations as stale until they send again.
  void connectionLost();

  [[nodiscard]] const StationTile* find(const std::string& station) const;
  /// Returns the filtered tiles by station, "station-2" before "station-10". A tile keeps its place.
  [[nodiscard]] std::vector<const StationTile*> tiles(const TileFilter& filter = {}) const;
  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  /// Returns the number of tiles for each need.
  [[nodiscard]] std::array<std::size_t, kNeedCount> counts() const;

 private:
  struct Entry {
    StationTile tile;
    double news_s = -1e9;                       // time of the last status line
    double began_s = 0;                         // time of the session's first status line
    std::vector<pb::AlarmCount> alarms;         // of the last status line
    std::map<std::string, std::uint32_t> seen;  // how many of each alarm the instructor acknowledged
    std::vector<TileAlarm> earlier;             // of earlier lessons, not acknowledged
    double ended_s = -1e9;                      // end of the last lesson
    std::string waits_for;                      // the session whose verdict is not known yet
    double asked_s = -1e9;                      // when it was requested
    bool lost_in_lesson = false;
  };
  static void beginLesson(Entry& entry, double now_s);
  void judge(Entry& entry, double now_s);
  std::map<std::string, Entry, BeforeNaturally> entries_;
  HelpCalls calls_;
  double now_s_ = 0;
};

}  // namespace needlelab
