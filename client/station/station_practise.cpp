// The lesson itself: the loop on its own thread, this one watches.
#include <unistd.h>

#include <cmath>
#include <future>
#include <thread>

#include "base/clock.h"
#include "station/acknowledgement.h"
#include "station/crash_guard.h"
#include "station/fault_watch.h"
#include "station/live_view.h"
#include "station/loop_core.h"
#include "station/rt_machine.h"
#include "station/say.h"
#include "station/signals.h"
#include "station/station_run.h"

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

}  // namespace

Status StationRun::practise() {
  // what takes the ticks away from the loop
  SpoolWriter::Callbacks callbacks;
  callbacks.trouble = say;
  if (uplink_) {
    callbacks.piece = [this](const SamplePiece& piece) { uplink_->offer(piece); };
    callbacks.durable = [this] { uplink_->wake(); };
  }
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
  const bool somebody_there = EnterKey(STDIN_FILENO).isTerminal();
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
  const Status stored = writer_->finish(5s);
  if (!stored.ok()) say(stored.error().message);
  return stored;
}

// until the loop ends: signals, faults in words, acknowledgements
void StationRun::watch(DeviceKeeper& keeper, FaultPolicy on_fault) {
  sigset_t signals = signals_;
  ::sigaddset(&signals, SIGUSR1);
  EnterKey enter(STDIN_FILENO);
  FaultWatch fault_watch(
      on_fault == FaultPolicy::kWait,
      enter.isTerminal() ? "press Enter" : "send SIGUSR1 (kill -USR1 " + std::to_string(::getpid()) + ")");
  LiveViewer viewer(*loop_, options_.rate_hz, layerNames(lesson_.profile));
  while (!loop_->ended()) {
    const int signal = signalWithin(signals, 50ms);
    if (signal != 0 && signal != SIGUSR1) {
      say("stopping");
      loop_->stop();
    }
    WatchedState state;
    state.now_s = static_cast<double>(steadyNowNs()) * 1e-9;
    state.faults = loop_->faults();
    state.fault = loop_->fault();
    state.cause_lasts = loop_->causeLasts();
    state.acknowledged = loop_->acknowledgementStands();
    state.condition = loop_->condition();
    state.device_words = keeper.words();
    state.acknowledge_pressed = enter.pressed() || signal == SIGUSR1;
    if (fault_watch.counts(state)) loop_->acknowledge();
    for (const std::string& line : fault_watch.look(state)) say(line);
    spool_guard_->look();
    if (const std::int64_t now_ns = steadyNowNs(); liveLine().due(now_ns)) {
      LiveView view = viewer.look(spoolText(writer_->counts()), uplink_ ? serverText(uplink_->state()) : "");
      view.aids = aidsOf(lesson_);
      liveLine().show(view, now_ns);
    }
    if (uplink_) reportToServer(fault_watch);
  }
  liveLine().end();
}

// what an instructor sees of this station beside its samples
void StationRun::reportToServer(const FaultWatch& faults) {
  uplink_->noteMissedTicks(loop_->missedTicks());
  uplink_->noteWakeup(static_cast<std::uint32_t>(loop_->stats().wakeup.quantile_ns(0.99) / 1000));
  uplink_->noteTrouble("disk", writer_->trouble());
  uplink_->noteTrouble("spool", spool_guard_->trouble());
  uplink_->noteTrouble("device", faults.trouble());
}

}  // namespace needlelab
