/// Log lines that stations, people and strangers can cause as often as they like.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>

#include "server/base/log.h"
#include "server/live/limits/limits.h"

namespace needlelab {

enum class LineBound { kUsual, kAnswered, kNoRoom };

/// An event of several kinds is limited per kind, so that harmless lines do not hide the others.
struct PeerLineKind {
  LogLevel level;
  std::string_view event;
  std::string_view part = {};  ///< for an event of several kinds: after a '/' in lines_left_out
  LineBound bound = LineBound::kUsual;
  friend auto operator<=>(const PeerLineKind&, const PeerLineKind&) = default;
};

struct PeerLine {
  static constexpr PeerLineKind kConnectionOpened{LogLevel::kInfo, "connection_opened"};
  static constexpr PeerLineKind kConnectionClosed{LogLevel::kInfo, "connection_closed"};
  static constexpr PeerLineKind kConnectionDisplaced{LogLevel::kInfo, "connection_gives_way"};
  static constexpr PeerLineKind kClockOfStation{LogLevel::kWarning, "clock_of_station"};
  static constexpr PeerLineKind kVersionRefused{LogLevel::kWarning, "version_refused"};
  /// A wrong name, password, key or token.
  static constexpr PeerLineKind kLoginRefused{LogLevel::kWarning, "login_refused"};
  /// Not checked, after too many failures.
  static constexpr PeerLineKind kLoginRateLimited{LogLevel::kWarning, "login_rate_limited"};
  static constexpr PeerLineKind kLogin{LogLevel::kInfo, "login_ok"};
  static constexpr PeerLineKind kLateLogin{LogLevel::kWarning, "late_login"};
  static constexpr PeerLineKind kStationReplaced{LogLevel::kWarning, "station_replaced"};
  static constexpr PeerLineKind kStationDeposed{LogLevel::kWarning, "station_deposed"};
  static constexpr PeerLineKind kSessionOpened{LogLevel::kInfo, "session_opened"};
  static constexpr PeerLineKind kSessionConfirmed{LogLevel::kDebug, "session_confirmed"};
  static constexpr PeerLineKind kSessionClosed{LogLevel::kInfo, "session_closed"};
  static constexpr PeerLineKind kMessageRefused{LogLevel::kWarning, "message_refused"};
  static constexpr PeerLineKind kMessageRefusedForRole{LogLevel::kWarning, "message_refused", "ROLE"};
  static constexpr PeerLineKind kRefusedByPeer{LogLevel::kWarning, "refused_by_peer"};
  static constexpr PeerLineKind kRefusedByPeerOften{LogLevel::kWarning, "refused_by_peer_often"};
  static constexpr PeerLineKind kChunkRefused{LogLevel::kWarning, "chunk_refused"};
  static constexpr PeerLineKind kChunkQuarantined{LogLevel::kWarning, "chunk_quarantined"};
  static constexpr PeerLineKind kNoRoom{LogLevel::kWarning, "no_room", {}, LineBound::kNoRoom};
  static constexpr PeerLineKind kSlowPeer{LogLevel::kWarning, "slow_peer"};
  static constexpr PeerLineKind kWebLogin{LogLevel::kInfo, "web_login"};
  static constexpr PeerLineKind kWebLogout{LogLevel::kInfo, "web_logout"};
  static constexpr PeerLineKind kWebFile{LogLevel::kDebug, "web_request", "file"};
  static constexpr PeerLineKind kWebRequestOfStranger{LogLevel::kInfo, "web_request"};
  static constexpr PeerLineKind kWebRequestDone{LogLevel::kInfo, "web_request", "done", LineBound::kAnswered};
  static constexpr PeerLineKind kWebRequestForbidden{LogLevel::kInfo, "web_request", "403"};
  static constexpr PeerLineKind kWebRequestRefused{LogLevel::kInfo, "web_request", "4xx"};
  static constexpr PeerLineKind kWebRequestFailed{LogLevel::kInfo, "web_request", "5xx"};
  static constexpr PeerLineKind kWebRequestThrew{LogLevel::kError, "web_request_failed"};
  static constexpr PeerLineKind kWebStreamFailed{LogLevel::kWarning, "web_stream_failed"};
  static constexpr PeerLineKind kLiveViewerDropped{LogLevel::kWarning, "live_viewer_dropped"};
};

/// Limits the lines of each kind per account, and for all strangers together, because their connections can
/// return at any rate. Omitted lines are reported as a number, `lines_left_out`. Memory: only owners with a
/// recent line. Times: steady clock (ns), from the caller. Thread: one.
class PeerLines {
 public:
  using Settings = LogLimits;
  /// All connections that have not logged in.
  static constexpr const char* kStrangers = "strangers";

  explicit PeerLines(const Settings& settings = {}) : settings_(settings) {}

  /// Writes the line, or counts it. `owner`: turnNameOf (turn_queue.h) or kStrangers.
  void write(const std::string& owner, const PeerLineKind& kind, std::int64_t now_ns,
             std::initializer_list<LogField> fields);
  /// Writes a line `lines_left_out` for each owner and kind whose minute or hour has ended with omitted
  /// lines. Call it periodically, and at the end (INT64_MAX).
  void reportOmitted(std::int64_t now_ns);
  /// Owners that had a line in a minute or hour still running at the last reportOmitted().
  [[nodiscard]] std::size_t known() const { return owners_.size(); }

 private:
  [[nodiscard]] LogBound boundOf(LineBound bound) const;

  const Settings settings_;
  std::unordered_map<std::string, std::map<PeerLineKind, LogBound>> owners_;
};

}  // namespace needlelab
