// The lesson itself: the loop on its own thread, this one watches.
#include <unistd.h>

#include <cmath>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/station/run/acknowledgement.h"
#include "client/station/run/crash_guard.h"
#include "client/station/run/fault_watch.h"
#include "client/station/run/live_view.h"
#include "client/station/run/loop_core.h"
#include "client/station/run/rt_machine.h"
#include "client/station/run/say.h"
#include "client/station/run/signals.h"
#include "client/station/run/station_run.h"
#include "common/base/clock.h"
#include "common/scoring/lesson_watch.h"

namespace needlelab {

using namespace std::chrono_literals;

namespace {

// "skin", "muscle", …, for the live line
std::vector<std::string> layerNames(const pb::Profile& profile) {
  std::vector<std::string> names;
  for (const pb::Layer& layer : profile.layers()) {
    names.push_back(pb::Layer::Tissue_Name(layer.tissue()));
    for (char& c : names.back())
      if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return names;
}

LessonStanding standingOf(const WatchedState& state, const LiveView& view, bool waits,
                          const std::string& room) {
  LessonStanding standing;
  standing.time_s = view.time_s;
  standing.fault = state.fault;
  standing.cause_lasts = state.cause_lasts;
  standing.acknowledged = state.acknowledged;
  standing.waits = waits;
  standing.condition = state.condition;
  standing.device_words = state.device_words;
  standing.hold = view.hold;
  standing.wakeup = view.wakeup;
  standing.missed_ticks = view.missed_ticks;
  standing.spool = view.spool;
  standing.server = view.server;
  standing.room = room;
  return standing;
}

}  // namespace

Status StationRun::practise() {
  // what takes the ticks away from the loop
  SpoolWriter::Callbacks callbacks;
  callbacks.trouble = say;
  Uplink* const uplink = home_.uplink();
  // what an instructor's overview says of the lesson; on the writer's thread
  const auto lesson_watch = std::make_shared<LessonWatch>(lesson_.profile, options_.X_WL,
                                                          lesson_.exercise ? &*lesson_.exercise : nullptr);
  callbacks.piece = [this, uplink, lesson_watch](const SamplePiece& piece) {
    if (uplink != nullptr) {
      uplink->offer(piece);
      lesson_watch->add(*piece.samples);
      uplink->noteLesson({lesson_watch->peakForce_N(), lesson_watch->hazardsTouched(),
                          lesson_watch->forceLimit_N(), lesson_watch->tissue()});
    }
    home_.audience().piece(piece);
  };
  if (uplink != nullptr) callbacks.durable = [uplink] { uplink->wake(); };
  SpoolWriterOptions writer_options;
  writer_options.rate_hz = options_.rate_hz;
  const auto core = coreForLoop(options_.cpu);
  auto keep_off = std::make_optional<KeepOffCore>(core);
  writer_ = std::make_unique<SpoolWriter>(ring_, session_, writer_options, std::move(callbacks));
  BlackBox black_box(options_.rate_hz);
  const auto black_boxes = options_.spool / "black-box";
  removeOldBlackBoxes(black_boxes, options_.keep.age_s);
  BlackBoxWriter black_box_writer(black_box, black_boxes, session_->idText(), say);
  keep_off.reset();

  // the loop
  RtOptions rt_options;
  rt_options.cpu = core;
  rt_options.cpu_needs_fifo = !options_.cpu;
  rt_options.spin_ns = std::llround(options_.spin_us * 1e3);
  rt_options.rate_hz = options_.rate_hz;
  SteadyLoopClock clock(rt_options.spin_ns);
  const bool somebody_there = options_.opensWindow() || EnterKey(STDIN_FILENO).isTerminal();
  ServoSettings settings{options_.rate_hz, options_.X_HT, max_ticks_};
  settings.on_fault = options_.on_fault.value_or(somebody_there ? FaultPolicy::kWait : FaultPolicy::kEnd);
  settings.black_box = &black_box;
  settings.plunger = options_.plunger;
  loop_ = std::make_unique<ServoLoop>(lesson_.model, *device_, clock, ring_, settings);
  say("session " + session_->idText() + ": " + lesson_.profile.name() + ", " + device_->info().name);

  const ShallowSleep shallow_sleep;
  realtime_ = judgeMachine(rt_options);
  realtime_.push_back(shallow_sleep.step());
  realtime_.push_back(lockMemory());
  std::vector<RtStep> thread_steps;
  std::promise<void> prepared;
  const CrashGuard crash_guard(*loop_);
  std::thread haptic([&] {
    CrashGuard::thisIsTheHapticThread();
    thread_steps = makeThreadRealTime(rt_options);
    prepared.set_value();
    loop_->run();
  });
  prepared.get_future().wait();
  realtime_.insert(realtime_.end(), thread_steps.begin(), thread_steps.end());
  for (const std::string& line : rtStepLines(realtime_)) say("real time: " + line);
  {
    DeviceKeeper keeper(*device_);
    watch(keeper, settings.on_fault);
    haptic.join();
  }
  device_->close();
  black_box_writer.finish();
  black_box_ = black_box_writer.counts();
  home_.audience().concluding();
  stored_ = writer_->finish(5s);
  if (!stored_.ok()) say(stored_.error().message);
  return stored_;
}

// what a person at the window or an instructor asks for
void StationRun::hear(LiveAids& aids) {
  if (auto stop = home_.requests().takeStop(); stop && !stopped_) {
    stopped_ = std::move(stop);
    say(stopText(stopped_));
    loop_->stop();
  }
  if (const auto chosen = home_.requests().takeAids()) {
    aids = chosen->reset ? aidsOf(lesson_) : aidsOf(chosen->aids);
    say(chosen->by + " changed what is shown");
    home_.audience().aids(*chosen);
  }
}

// until the loop ends: signals, faults in words, acknowledgements
void StationRun::watch(DeviceKeeper& keeper, FaultPolicy on_fault) {
  sigset_t signals = signals_;
  ::sigaddset(&signals, SIGUSR1);
  EnterKey enter(STDIN_FILENO);
  const bool waits = on_fault == FaultPolicy::kWait;
  const bool enter_works = enter.isTerminal() || options_.opensWindow();
  FaultWatch fault_watch(
      waits, enter_works ? "press Enter" : "send SIGUSR1 (kill -USR1 " + std::to_string(::getpid()) + ")");
  LiveViewer viewer(*loop_, options_.rate_hz, layerNames(lesson_.profile));
  LiveAids aids = aidsOf(lesson_);
  Uplink* const uplink = home_.uplink();
  while (!loop_->ended()) {
    const int signal = signalWithin(signals, 50ms);
    if (signal != 0 && signal != SIGUSR1) {
      say("stopping");
      interrupted_ = true;
      loop_->stop();
    }
    hear(aids);
    WatchedState state;
    state.now_s = static_cast<double>(steadyNowNs()) * 1e-9;
    state.faults = loop_->faults();
    state.fault = loop_->fault();
    state.cause_lasts = loop_->causeLasts();
    state.acknowledged = loop_->acknowledgementStands();
    state.condition = loop_->condition();
    state.device_words = keeper.words();
    const bool at_window = home_.requests().takeAcknowledgement();
    state.acknowledge_pressed = enter.pressed() || signal == SIGUSR1 || at_window;
    if (fault_watch.counts(state)) loop_->acknowledge();
    for (const std::string& line : fault_watch.look(state)) {
      say(line);
      home_.audience().said(line);
    }
    home_.guard().check();
    LiveView view = viewer.look(spoolText(writer_->counts()), uplink ? serverText(uplink->state()) : "");
    view.aids = aids;
    home_.audience().stands(standingOf(state, view, waits, home_.guard().trouble()));
    if (const std::int64_t now_ns = steadyNowNs(); liveLine().due(now_ns)) liveLine().show(view, now_ns);
    if (uplink) reportToServer(fault_watch);
  }
  liveLine().end();
}

// what an instructor sees of this station beside its samples
void StationRun::reportToServer(const FaultWatch& faults) {
  Uplink& uplink = *home_.uplink();
  uplink.noteMissedTicks(loop_->missedTicks());
  uplink.noteWakeup(static_cast<std::uint32_t>(loop_->stats().wakeup.quantile_ns(0.99) / 1000));
  uplink.noteTrouble("disk", writer_->trouble());
  uplink.noteTrouble("spool", home_.guard().trouble());
  uplink.noteTrouble("device", faults.trouble());
}

}  // namespace needlelab
