/// The log's lines that others cause: stations, people and strangers, as often as they like.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <string>
#include <unordered_map>

#include "server/base/log.h"

namespace needlelab {

/// Event and level of each kind stand in kRows (peer_lines.cpp), in this order. An event of several kinds has
/// lines of each: harmless ones must not hide the others.
enum class PeerLine {
  kConnectionOpened,
  kConnectionClosed,
  kConnectionGivesWay,
  kVersionRefused,
  kLoginRefused,      ///< a wrong name, password, key or token
  kLoginRateLimited,  ///< it was not looked at, after too many failures
  kLogin,
  kLateLogin,
  kStationReplaced,
  kStationDeposed,
  kSessionOpened,
  kSessionConfirmed,
  kSessionClosed,
  kMessageRefused,
  kMessageRefusedForRole,
  kRefusedByPeer,
  kRefusedByPeerOften,
  kChunkRefused,
  kChunkQuarantined,
  kNoRoom,
  kSlowPeer,
  kWebLogin,
  kWebLogout,
  kWebFile,
  kWebRequestOfStranger,
  kWebRequestDone,
  kWebRequestForbidden,  ///< 403
  kWebRequestRefused,    ///< the other 4xx
  kWebRequestFailed,     ///< 5xx
  kWebRequestThrew,
  kWebStreamFailed,
  kLiveViewerDropped,
};

/// So many lines of each kind for each account, and for all strangers together, whose connections come back
/// as often as they like; what is left out is said as a number, `lines_left_out`. In memory: those who had a
/// line lately. Times: steady clock (ns), from the caller. Thread: one.
class PeerLines {
 public:
  struct Settings {
    /// Far above what a fault or an attack needs to be seen. Who uses up all kinds without end writes some 9
    /// MB an hour, and at most 50 where each text has its 500 bytes (logEvent).
    std::uint64_t a_minute = 60;
    /// Of requests that the web port answered: a page of the console asks some ten times.
    std::uint64_t answered_a_minute = 300;
    /// For want of room: a station asks again until there is some, and the log is on the same disk.
    std::uint64_t no_room_an_hour = 1;
  };
  /// All who have not logged in.
  static constexpr const char* kStrangers = "strangers";

  PeerLines() : PeerLines(Settings{}) {}
  explicit PeerLines(const Settings& settings) : settings_(settings) {}

  /// Writes the line, or counts it. `owner`: turnNameOf (request_effects.h) or kStrangers.
  void write(const std::string& owner, PeerLine kind, std::int64_t now_ns,
             std::initializer_list<LogField> fields);
  /// A line `lines_left_out` for each owner and kind whose minute or hour is over and had more. Call it by
  /// the clock, and at the end (INT64_MAX).
  void sayLeftOut(std::int64_t now_ns);
  /// Owners who had a line in a minute or hour that was not over at the last sayLeftOut().
  [[nodiscard]] std::size_t known() const { return owners_.size(); }

 private:
  [[nodiscard]] LogBound boundOf(PeerLine kind) const;

  const Settings settings_;
  std::unordered_map<std::string, std::map<PeerLine, LogBound>> owners_;
};

}  // namespace needlelab
