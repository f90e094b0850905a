#include "server/live/peer_lines.h"

#include <array>
#include <iterator>
#include <string_view>

namespace needlelab {
namespace {

enum class Bound { kUsual, kAnswered, kNoRoom };

struct Row {
  PeerLine kind;
  LogLevel level;
  std::string_view event;
  std::string_view part = {};  // of an event with several kinds: after a '/' in lines_left_out
  Bound bound = Bound::kUsual;
};

constexpr auto kDebug = LogLevel::kDebug, kInfo = LogLevel::kInfo, kWarning = LogLevel::kWarning,
               kError = LogLevel::kError;

constexpr std::array kRows = {
    Row{PeerLine::kConnectionOpened, kInfo, "connection_opened"},
    Row{PeerLine::kConnectionClosed, kInfo, "connection_closed"},
    Row{PeerLine::kConnectionGivesWay, kInfo, "connection_gives_way"},
    Row{PeerLine::kVersionRefused, kWarning, "version_refused"},
    Row{PeerLine::kLoginRefused, kWarning, "login_refused"},
    Row{PeerLine::kLoginRateLimited, kWarning, "login_rate_limited"},
    Row{PeerLine::kLogin, kInfo, "login_ok"},
    Row{PeerLine::kLateLogin, kWarning, "late_login"},
    Row{PeerLine::kStationReplaced, kWarning, "station_replaced"},
    Row{PeerLine::kStationDeposed, kWarning, "station_deposed"},
    Row{PeerLine::kSessionOpened, kInfo, "session_opened"},
    Row{PeerLine::kSessionConfirmed, kDebug, "session_confirmed"},
    Row{PeerLine::kSessionClosed, kInfo, "session_closed"},
    Row{PeerLine::kMessageRefused, kWarning, "message_refused"},
    Row{PeerLine::kMessageRefusedForRole, kWarning, "message_refused", "ROLE"},
    Row{PeerLine::kRefusedByPeer, kWarning, "refused_by_peer"},
    Row{PeerLine::kRefusedByPeerOften, kWarning, "refused_by_peer_often"},
    Row{PeerLine::kChunkRefused, kWarning, "chunk_refused"},
    Row{PeerLine::kChunkQuarantined, kWarning, "chunk_quarantined"},
    Row{PeerLine::kNoRoom, kWarning, "no_room", {}, Bound::kNoRoom},
    Row{PeerLine::kSlowPeer, kWarning, "slow_peer"},
    Row{PeerLine::kWebLogin, kInfo, "web_login"},
    Row{PeerLine::kWebLogout, kInfo, "web_logout"},
    Row{PeerLine::kWebFile, kDebug, "web_request", "file"},
    Row{PeerLine::kWebRequestOfStranger, kInfo, "web_request"},
    Row{PeerLine::kWebRequestDone, kInfo, "web_request", "done", Bound::kAnswered},
    Row{PeerLine::kWebRequestForbidden, kInfo, "web_request", "403"},
    Row{PeerLine::kWebRequestRefused, kInfo, "web_request", "4xx"},
    Row{PeerLine::kWebRequestFailed, kInfo, "web_request", "5xx"},
    Row{PeerLine::kWebRequestThrew, kError, "web_request_failed"},
    Row{PeerLine::kWebStreamFailed, kWarning, "web_stream_failed"},
    Row{PeerLine::kLiveViewerDropped, kWarning, "live_viewer_dropped"},
};

constexpr bool inOrder() {
  for (std::size_t i = 0; i < kRows.size(); ++i)
    if (static_cast<std::size_t>(kRows[i].kind) != i) return false;
  return kRows.size() == static_cast<std::size_t>(PeerLine::kLiveViewerDropped) + 1;
}
static_assert(inOrder());

const Row& rowOf(PeerLine kind) {
  return kRows[static_cast<std::size_t>(kind)];
}

std::string nameOf(const Row& row) {
  return std::string(row.event) + (row.part.empty() ? "" : "/" + std::string(row.part));
}

}  // namespace

LogBound PeerLines::boundOf(PeerLine kind) const {
  switch (rowOf(kind).bound) {
    case Bound::kAnswered:
      return LogBound(settings_.answered_a_minute);
    case Bound::kNoRoom:
      return LogBound(settings_.no_room_an_hour, 60 * LogBound::kMinute_ns);
    case Bound::kUsual:
      break;
  }
  return LogBound(settings_.a_minute);
}

void PeerLines::write(const std::string& owner, PeerLine kind, std::int64_t now_ns,
                      std::initializer_list<LogField> fields) {
  LogBound& bound = owners_[owner].try_emplace(kind, boundOf(kind)).first->second;
  if (bound.take(now_ns)) logEvent(rowOf(kind).level, rowOf(kind).event, fields);
}

void PeerLines::sayLeftOut(std::int64_t now_ns) {
  for (auto owner = owners_.begin(); owner != owners_.end();) {
    auto& bounds = owner->second;
    for (auto entry = bounds.begin(); entry != bounds.end();) {
      if (const std::uint64_t count = entry->second.leftOut(now_ns); count > 0) {
        const Row& row = rowOf(entry->first);
        logEvent(row.level, "lines_left_out", {{"who", owner->first}, {"of", nameOf(row)}, {"count", count}});
      }
      entry = entry->second.over(now_ns) ? bounds.erase(entry) : std::next(entry);
    }
    owner = bounds.empty() ? owners_.erase(owner) : std::next(owner);
  }
}

}  // namespace needlelab
