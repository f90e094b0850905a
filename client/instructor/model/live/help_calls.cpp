#include "client/instructor/model/live/help_calls.h"

#include <algorithm>
#include <array>
#include <tuple>

#include <fmt/core.h>

namespace needlelab {
namespace {

constexpr std::array<std::string_view, kNeedCount> kNames = {
    "FAULT", "alarm", "hand up", "trouble", "lost mid-lesson", "waiting", "done", "practising", "offline"};

bool callsNow(const HelpCall& call, double now_s) {
  return !call.seen && now_s >= call.quiet_until_s;
}

}  // namespace

std::string_view nameOf(Need need) {
  return kNames[static_cast<std::size_t>(need)];
}

void HelpCalls::note(const std::string& station, const std::string& trainee, Need need,
                     const std::string& words, double now_s) {
  const auto found = open_.find(station);
  if (found != open_.end() && found->second.need != need) {
    over_.push_front(std::move(found->second));
    over_.front().over_s = now_s;
    if (over_.size() > kMostOver) over_.pop_back();
    open_.erase(found);
  }
  if (!needsHelp(need)) return;
  HelpCall& call = open_.try_emplace(station, HelpCall{station, trainee, words, need, now_s}).first->second;
  if (!trainee.empty()) call.trainee = trainee;
  call.words = words;
}

void HelpCalls::acknowledge(const std::string& station) {
  if (const auto found = open_.find(station); found != open_.end()) found->second.seen = true;
}

void HelpCalls::snooze(const std::string& station, double until_s) {
  if (const auto found = open_.find(station); found != open_.end()) found->second.quiet_until_s = until_s;
}

bool HelpCalls::calls(const std::string& station, double now_s) const {
  const auto found = open_.find(station);
  return found != open_.end() && callsNow(found->second, now_s);
}

std::vector<const HelpCall*> HelpCalls::open(double now_s) const {
  std::vector<const HelpCall*> all;
  for (const auto& [station, call] : open_) all.push_back(&call);
  const auto key = [&](const HelpCall* call) {
    return std::tuple(!callsNow(*call, now_s), call->need, call->since_s);
  };
  std::stable_sort(all.begin(), all.end(), [&](const auto* a, const auto* b) { return key(a) < key(b); });
  return all;
}

std::string agoWords(double seconds) {
  if (seconds < 60) return fmt::format("{:.0f} s", std::max(0.0, seconds));
  return seconds < 3600 ? fmt::format("{:.0f} min", seconds / 60) : fmt::format("{:.0f} h", seconds / 3600);
}

}  // namespace needlelab
