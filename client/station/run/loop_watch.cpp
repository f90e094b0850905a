#include "client/station/run/loop_watch.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <utility>

#include "client/station/run/summary.h"
#include "common/profile/layer_names.h"

namespace needlelab {
namespace {

constexpr std::int64_t kLook_ns = 50'000'000;

std::string howToAcknowledge(const WatchedLesson& watched, const EnterKey& enter) {
  if (enter.isTerminal() || watched.options.opensWindow()) return "press Enter";
  return fmt::format("send SIGUSR1 (kill -USR1 {})", ::getpid());
}

}  // namespace

LoopWatch::LoopWatch(const WatchedLesson& watched, const sigset_t& stop_signals, EnterKey& enter)
    : watched_(watched),
      signals_(stop_signals),
      enter_(enter),
      faults_(watched.on_fault == FaultPolicy::kWait, howToAcknowledge(watched, enter)),
      viewer_(watched.loop, watched.options.rate_hz, layerNames(watched.lesson.profile)),
      aids_(aidsOf(watched.lesson)),
      alarms_shown_(hasAid(allowedAids(watched.lesson), pb::Exercise::ALARMS)) {
  sigaddset(&signals_, SIGUSR1);
}

void LoopWatch::run() {
  while (const auto due_ns = turn()) rest(*due_ns);
}

std::optional<std::int64_t> LoopWatch::turn() noexcept {
  if (std::exchange(begun_, true)) look();
  if (!watched_.loop.ended()) return watched_.home.time().nowNs() + kLook_ns;
  liveLine().end();
  return std::nullopt;
}

void LoopWatch::rest(std::int64_t until_ns) noexcept {
  signal_ = watched_.home.time().waitForSignalUntilNs(signals_, until_ns);
}

void LoopWatch::look() {
  if (signal_ != 0 && signal_ != SIGUSR1) {
    logMessage("stopping");
    interrupted_ = true;
    watched_.loop.stop();
  }
  handleRequests();
  const ServoLoop& loop = watched_.loop;
  WatchedState state;
  state.now_s = static_cast<double>(watched_.home.time().nowNs()) * 1e-9;
  state.faults = loop.faults();
  state.fault = loop.fault();
  state.cause_lasts = loop.causeLasts();
  state.acknowledged = loop.isAcknowledged();
  state.condition = loop.condition();
  state.device_status = watched_.maintenance.status();
  handleFaults(state);
  watched_.home.guard().check();
  showStatus(state);
  if (watched_.home.uplink() != nullptr) reportToServer();
}

// from the window and from instructors
void LoopWatch::handleRequests() {
  LessonRequests& requests = watched_.home.requests();
  if (auto stop = requests.takeStop(); stop && !stopped_) {
    stopped_ = std::move(stop);
    logMessage(stopText(stopped_));
    watched_.loop.stop();
  }
  const auto chosen = requests.takeAids();
  if (chosen && watched_.lesson.exam) {
    logMessage("this is an exam: the aids that " + chosen->by + " chose are not shown");
  } else if (chosen) {
    aids_ = chosen->reset ? aidsOf(watched_.lesson) : aidsOf(chosen->aids);
    alarms_shown_ = hasAid(chosen->reset ? allowedAids(watched_.lesson) : chosen->aids, pb::Exercise::ALARMS);
    logMessage(chosen->by + " changed what is shown");
    watched_.home.observer().aids(*chosen);
  }
}

void LoopWatch::handleFaults(WatchedState& state) {
  const bool at_window = watched_.home.requests().takeAcknowledgement();
  state.acknowledge_pressed = enter_.pressed() || signal_ == SIGUSR1 || at_window;
  if (faults_.isAcknowledgement(state)) watched_.loop.acknowledge();
  for (const std::string& line : faults_.update(state)) logMessage(line);
  if (watched_.home.requests().takeCapSwitch()) watched_.loop.switchCap();
}

void LoopWatch::showStatus(const WatchedState& state) {
  const Uplink* const uplink = watched_.home.uplink();
  const UplinkState server = uplink != nullptr ? uplink->state() : UplinkState{};
  LiveView view =
      viewer_.look(spoolText(watched_.writer.counts()), uplink != nullptr ? serverText(server) : "");
  view.aids = aids_;
  LessonStatus status;
  status.time_s = view.time_s;
  const auto contact =
      watched_.limit_from_start ? std::optional<std::uint64_t>(0) : watched_.loop.firstContact();
  status.limit_runs = contact.has_value();
  if (watched_.limit_s > 0)
    status.left_s = std::max(
        0.0, watched_.limit_s -
                 (contact ? status.time_s - static_cast<double>(*contact) / watched_.options.rate_hz : 0));
  status.fault = state.fault;
  status.cause_lasts = state.cause_lasts;
  status.acknowledged = state.acknowledged;
  status.waits = watched_.on_fault == FaultPolicy::kWait;
  status.condition = state.condition;
  status.device_status = state.device_status;
  status.hold = view.hold;
  status.wakeup = view.wakeup;
  status.missed_ticks = view.missed_ticks;
  status.spool = view.spool;
  status.server = view.server;
  const std::string& room = watched_.home.guard().trouble();
  const bool both = !room.empty() && !server.server_full.empty();
  status.room = room + (both ? "; " : "") + server.server_full;
  status.alarms = watched_.alarms.update({status.fault, status.hold, status.left_s, alarms_shown_});
  watched_.home.observer().status(status);
  const std::int64_t now_ns = watched_.home.time().nowNs();
  if (liveLine().due(now_ns)) liveLine().show(view, now_ns);
}

// reports what instructors see of the station
void LoopWatch::reportToServer() {
  Uplink& uplink = *watched_.home.uplink();
  const ServoLoop& loop = watched_.loop;
  uplink.noteMissedTicks(loop.missedTicks());
  uplink.noteWakeup(static_cast<std::uint32_t>(loop.stats().wakeup.quantile_ns(0.99) / 1000));
  uplink.noteHand(watched_.home.requests().handRaised());
  uplink.noteTrouble("disk", watched_.writer.trouble());
  uplink.noteTrouble("spool", watched_.home.guard().trouble());
  uplink.noteTrouble("device", faults_.trouble());
}

}  // namespace needlelab
