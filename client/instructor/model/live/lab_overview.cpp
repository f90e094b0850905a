#include "client/instructor/model/live/lab_overview.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include "client/instructor/model/live/session_scene.h"
#include "common/base/text/text.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/phase_words.h"
#include "common/scoring/measures/measures.h"

namespace needlelab {
namespace {

constexpr std::array<Condition, kNeedCount> kConditions = {
    Condition::kTrouble,   Condition::kTrouble,   Condition::kAttention,
    Condition::kAttention, Condition::kAttention, Condition::kUnknown,
    Condition::kUnknown,   Condition::kGood,      Condition::kUnknown};

/// From this share of missed ticks on, a hand feels that the force stutters.
constexpr double kStutters = 0.01;
constexpr std::uint64_t kJudgedTicks = 2000;

bool holds(const StationTile& tile, const std::string& part) {
  return lowerCase(tile.station).find(part) != std::string::npos ||
         lowerCase(tile.trainee).find(part) != std::string::npos ||
         lowerCase(tile.exercise).find(part) != std::string::npos;
}

/// Replaces non-finite numbers from the network by 0.
double sane(double value) {
  return std::isfinite(value) ? value : 0;
}

const AlarmKind* kindNamed(std::string_view name) {
  const auto kinds = alarmKinds();
  const auto kind =
      std::find_if(kinds.begin(), kinds.end(), [&](const AlarmKind& k) { return k.name == name; });
  return kind == kinds.end() ? nullptr : &*kind;
}

}  // namespace

Condition conditionOf(const StationTile& tile) {
  if (tile.need == Need::kDone && tile.passed) return *tile.passed ? Condition::kGood : Condition::kAttention;
  return kConditions[static_cast<std::size_t>(tile.need)];
}

std::string lessonWords(const StationTile& tile, const std::string& exercise) {
  if (!tile.trainee.empty()) return tile.trainee + " · " + exercise;
  if (!tile.online) return {};
  return tile.session_id.empty() ? "no lesson" : "name not known yet · " + exercise;
}

std::string depthWords(const StationTile& tile) {
  if (!tile.online || tile.session_id.empty()) return {};
  const std::string phase(phaseWord(tile.phase));
  if (tile.layer < 0) return phase;
  const std::string where =
      tile.layer_name.empty() ? fmt::format("layer {}", std::int64_t{tile.layer} + 1) : tile.layer_name;
  return phase + ", " + fixedText(1e3 * tile.insertion_m, 1) + " mm, tip in " + where;
}

std::string forceWords(const StationTile& tile) {
  return fixedText(tile.force_N, 1) + " N, peak " + fixedText(tile.peak_force_N, 1) + " N";
}

std::string healthWords(const StationTile& tile) {
  if (!tile.online) return "offline";
  if (tile.stale) return "no news";
  std::string words;
  const auto add = [&](const std::string& part) { words += (words.empty() ? "" : ", ") + part; };
  const auto counted = [](std::uint64_t n, const char* one, const char* many) {
    return fmt::format("{} {}", n, n == 1 ? one : many);
  };
  if (tile.wakeup_p99_us > 0) add(fmt::format("loop: 99 % within {} µs", tile.wakeup_p99_us));
  if (tile.missed_ticks > 0) add(counted(tile.missed_ticks, "tick missed", "ticks missed"));
  if (tile.spool_left > 0) add(counted(tile.spool_left, "chunk waits", "chunks wait"));
  if (!tile.server.empty()) add("server " + tile.server);
  return words;
}

void LabOverview::setStations(const pb::Stations& stations, double now_s) {
  std::set<std::string> known;
  for (const pb::StationInfo& info : stations.stations()) {
    if (info.revoked() && !info.online()) continue;  // a revoked station cannot come back
    known.insert(info.name());
    Entry& entry = entries_[info.name()];
    entry.tile.station = printable(info.name());
    entry.tile.revoked = info.revoked();
    pb::StationStatus status = info.status();
    status.set_station(info.name());
    status.set_online(info.online());
    onStatus(status, now_s);
  }
  for (const auto& [name, entry] : entries_)
    if (!known.contains(name)) calls_.note(entry.tile.station, {}, Need::kOffline, {}, now_s);
  std::erase_if(entries_, [&](const auto& each) { return !known.contains(each.first); });
}

void LabOverview::onStatus(const pb::StationStatus& status, double now_s) {
  Entry& entry = entries_[status.station()];
  StationTile& tile = entry.tile;
  tile.station = printable(status.station());
  const bool had_lesson = !tile.session_id.empty();
  const bool was_online = tile.online;
  entry.news_s = now_s;
  tile.online = status.online();
  tile.stale = false;
  if (!tile.online) {
    // its last values stay visible
    if (was_online) entry.lost_in_lesson = had_lesson;
    judge(entry, now_s);
    return;
  }
  entry.lost_in_lesson = false;
  if (status.session_id() != tile.session_id) {
    if (had_lesson && status.session_id().empty()) {
      entry.ended_s = now_s;
      entry.waits_for = tile.session_id;
      tile.verdict = verdictName({}) + std::string(" yet");
    }
    if (!status.session_id().empty()) beginLesson(entry, now_s);
    tile.session_id = status.session_id();
  }
  if (!status.trainee().empty()) tile.trainee = printable(traineeName(status));
  if (!status.exercise_id().empty()) tile.exercise = printable(status.exercise_id());
  tile.phase = status.phase();
  tile.layer = status.layer();
  tile.insertion_m = sane(status.insertion_m());
  tile.force_N = sane(status.force_n());
  tile.fault = status.fault();
  tile.hand_raised = status.hand_raised();
  tile.trouble = printable(status.trouble());
  tile.server = printable(status.server());
  tile.missed_ticks = status.missed_ticks();
  tile.samples = status.samples();
  tile.spool_left = status.spool_left();
  tile.wakeup_p99_us = status.wakeup_p99_us();
  tile.layer_name = printable(status.tissue());
  tile.force_limit_N = sane(status.force_limit_n()) > 0 ? status.force_limit_n() : kUsualForceLimit_N;
  if (!tile.session_id.empty()) {
    tile.peak_force_N = std::max({tile.peak_force_N, tile.force_N, sane(status.peak_force_n())});
    entry.alarms.assign(status.alarms().begin(), status.alarms().end());
    tile.forces_N.push_back(static_cast<float>(tile.force_N));
    if (tile.forces_N.size() > kForcesKept) tile.forces_N.pop_front();
  }
  judge(entry, now_s);
}

void LabOverview::beginLesson(Entry& entry, double now_s) {
  StationTile& tile = entry.tile;
  // alarms that nobody has seen stay, with the name of their trainee
  std::erase_if(tile.alarms, [](const TileAlarm& alarm) { return alarm.seen; });
  for (TileAlarm& alarm : tile.alarms) {
    alarm.now = false;
    if (!std::exchange(alarm.earlier, true))
      alarm.words.insert(0, (tile.trainee.empty() ? "" : tile.trainee + ", ") + "earlier: ");
  }
  entry.earlier = tile.alarms;
  entry.began_s = now_s;
  entry.ended_s = -1e9;
  entry.asked_s = -1e9;
  entry.waits_for.clear();
  entry.alarms.clear();
  entry.seen.clear();
  tile.trainee.clear();  // another trainee may be next
  tile.exercise.clear();
  tile.verdict.clear();
  tile.passed.reset();
  tile.peak_force_N = 0;
  tile.forces_N.clear();
}

void LabOverview::judge(Entry& entry, double now_s) {
  now_s_ = now_s;
  StationTile& tile = entry.tile;
  const bool lesson = !tile.session_id.empty();
  tile.lesson_s = lesson ? std::max(0.0, now_s - entry.began_s) : 0;
  tile.why.clear();
  tile.alarms.clear();
  for (const pb::AlarmCount& count : entry.alarms) {
    const AlarmKind* const kind = kindNamed(count.alarm());
    if (kind == nullptr) continue;
    const auto seen = entry.seen.find(count.alarm());
    const bool acknowledged = seen != entry.seen.end() && seen->second >= count.begun();
    const bool now = count.now() && lesson && tile.online;
    if (acknowledged && !now) continue;
    tile.alarms.push_back({std::string(kind->name), std::string(kind->word) + " " + printable(count.detail()),
                           now, acknowledged, kind->danger});
  }
  tile.alarms.insert(tile.alarms.end(), entry.earlier.begin(), entry.earlier.end());
  const auto isNew = [](const TileAlarm& each) { return !each.seen; };
  const auto unseen = std::count_if(tile.alarms.begin(), tile.alarms.end(), isNew);
  if (lesson && tile.online && tile.fault != 0) {
    tile.need = Need::kFault;
    tile.why = faultText(static_cast<Fault>(tile.fault));
  } else if (unseen > 0) {
    tile.need = Need::kAlarm;
    tile.why = std::find_if(tile.alarms.begin(), tile.alarms.end(), isNew)->words;
    if (unseen > 1) tile.why += fmt::format("; {} more", unseen - 1);
  } else if (tile.hand_raised && tile.online) {
    tile.need = Need::kHand;
    tile.why = "asks for help";
  } else if (!tile.online) {
    tile.need = entry.lost_in_lesson ? Need::kLost : Need::kOffline;
    if (entry.lost_in_lesson) tile.why = "the lesson continues at the station and is stored there";
  } else if (!tile.trouble.empty()) {
    tile.need = Need::kTrouble;
    tile.why = tile.trouble;
  } else if (lesson && tile.samples >= kJudgedTicks &&
             static_cast<double>(tile.missed_ticks) > kStutters * static_cast<double>(tile.samples)) {
    tile.need = Need::kTrouble;
    tile.why = "the force stutters: the station is too busy";
  } else if (lesson) {
    tile.need = Need::kPractising;
  } else {
    tile.need = now_s - entry.ended_s <= kDoneLasts_s ? Need::kDone : Need::kWaiting;
  }
  calls_.note(tile.station, tile.trainee, tile.need, tile.why, now_s);
  tile.calls = calls_.calls(tile.station, now_s);
}

void LabOverview::acknowledge(const std::string& station) {
  const auto found = entries_.find(station);
  if (found == entries_.end()) return;
  Entry& entry = found->second;
  for (const pb::AlarmCount& count : entry.alarms) entry.seen[count.alarm()] = count.begun();
  for (TileAlarm& alarm : entry.tile.alarms) alarm.seen = true;
  entry.earlier.clear();
  calls_.acknowledge(entry.tile.station);
  judge(entry, now_s_);  // an alarm that was seen is over: the next one calls again
}

void LabOverview::snooze(const std::string& station) {
  const auto found = entries_.find(station);
  if (found == entries_.end()) return;
  calls_.snooze(found->second.tile.station, now_s_ + kSnooze_s);
  found->second.tile.calls = false;
}

std::vector<std::string> LabOverview::verdictsToRequest(double now_s) {
  constexpr double kAgain_s = 2;
  std::vector<std::string> sessions;
  for (auto& [name, entry] : entries_) {
    if (entry.waits_for.empty() || now_s - entry.asked_s < kAgain_s) continue;
    entry.asked_s = now_s;
    sessions.push_back(entry.waits_for);
  }
  return sessions;
}

void LabOverview::takeVerdict(const pb::SessionInfo& session) {
  for (auto& [name, entry] : entries_) {
    if (session.score_json().empty() || entry.waits_for != session.description().session_id()) continue;
    entry.waits_for.clear();
    if (session.has_passed()) entry.tile.passed = session.passed();
    entry.tile.verdict = session.has_passed() ? verdictName(session.passed()) : "no requirements";
  }
}

void LabOverview::tick(double now_s) {
  for (auto& [name, entry] : entries_) {
    entry.tile.stale = entry.tile.online && now_s - entry.news_s > kStale_s;
    judge(entry, now_s);
  }
}

void LabOverview::connectionLost() {
  for (auto& [name, entry] : entries_) {
    entry.tile.stale = true;
    entry.news_s = -1e9;
  }
}

const StationTile* LabOverview::find(const std::string& station) const {
  const auto found = entries_.find(station);
  return found == entries_.end() ? nullptr : &found->second.tile;
}

std::vector<const StationTile*> LabOverview::tiles(const TileFilter& filter) const {
  std::vector<const StationTile*> chosen;
  const std::string part = lowerCase(filter.text);
  for (const auto& [name, entry] : entries_) {
    const StationTile& tile = entry.tile;
    if (filter.only_online && !tile.online) continue;
    if (!part.empty() && !holds(tile, part)) continue;
    chosen.push_back(&tile);
  }
  return chosen;
}

std::array<std::size_t, kNeedCount> LabOverview::counts() const {
  std::array<std::size_t, kNeedCount> counts{};
  for (const auto& [name, entry] : entries_) ++counts[static_cast<std::size_t>(entry.tile.need)];
  return counts;
}

}  // namespace needlelab
