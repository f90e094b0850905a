// The phases of a lesson: prepare (lesson, device, session), practise (the loop on its own thread, watched by
// this one), drain (sends the rest to the server), outcome and report.
#include "client/station/run/station_run.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <future>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/device/device.h"
#include "client/device/factory/device_factory.h"
#include "client/net/uplink/uplink.h"
#include "client/station/run/checks/measure_delay.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/lesson/curriculum.h"
#include "client/station/run/lesson/demonstration.h"
#include "client/station/run/lesson/hand_buttons.h"
#include "client/station/run/lesson/lesson.h"
#include "client/station/run/lesson/local_score.h"
#include "client/station/run/lesson/memory_follower.h"
#include "client/station/run/loop/real_time.h"
#include "client/station/run/loop/signals.h"
#include "client/station/run/loop_watch.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/time/clock.h"
#include "common/profile/profile.h"
#include "common/scoring/alarms/lesson_watch.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

void putPose(google::protobuf::RepeatedField<double>& to, const Pose& pose) {
  for (const double value : {pose.p.x, pose.p.y, pose.p.z, pose.q.x, pose.q.y, pose.q.z, pose.q.w})
    to.Add(value);
}

std::vector<pb::AlarmCount> alarmCountsOf(const GestureAlarms& alarms) {
  std::vector<pb::AlarmCount> counts;
  for (const AlarmCount& count : alarms.counts()) {
    pb::AlarmCount& told = counts.emplace_back();
    told.set_alarm(std::string(kindOf(count.alarm).name));
    told.set_begun(count.begun);
    told.set_now(count.now);
    told.set_detail(count.detail);
  }
  return counts;
}

}  // namespace

Status StationRun::prepare() {
  home_.requests().clear();
  const std::pair<const char*, Status (StationRun::*)()> steps[] = {
      {"fetching the exercise", &StationRun::getLesson},
      {"waiting for the exam to begin", &StationRun::waitForExam},
      {"choosing the device", &StationRun::chooseDevice},
      {"opening the device", &StationRun::openDevice},
      {"beginning the recording", &StationRun::openSession},
  };
  for (const auto& [name, step] : steps) {
    // a person at the window may cancel; the waiting code handles signals
    if (home_.requests().takeStop()) return Error{ErrorCode::kFailed, "it was cancelled"};
    home_.observer().preparing(name);
    RETURN_IF_ERROR((this->*step)());
  }
  announce();
  return {};
}

// a signal ends the program, a person's request only this lesson
bool StationRun::isStopped() {
  if (signalWithin(signals_, 0ms) != 0) interrupted_ = true;
  if (auto stop = home_.requests().takeStop()) stopped_ = std::move(stop);
  return interrupted_ || stopped_;
}

Status StationRun::getLesson() {
  ASSIGN_OR_RETURN(auto fetched, fetchLesson(home_, options_, code_, [this] { return isStopped(); }));
  lesson_ = std::move(fetched.lesson);
  code_checked_ = fetched.code_checked;
  code_unchecked_ = fetched.code_unchecked;
  person_ = fetched.person;
  // --seconds counts from the first tick, an exercise's time limit from the needle's first contact
  limit_from_start_ = options_.seconds > 0;
  time_limit_s_ = limit_from_start_  ? options_.seconds
                  : lesson_.exercise ? lesson_.exercise->time_limit_s()
                                     : 0;
  return {};
}

// an attempt counts as soon as its session begins
Status StationRun::waitForExam() {
  if (!options_.opensWindow() || !lesson_.exam) return {};
  home_.observer().examWaits(examTerms(lesson_, time_limit_s_));
  while (!isStopped() && !home_.requests().takeExamBegin())
    home_.time().sleepUntilNs(home_.time().nowNs() + std::chrono::nanoseconds(50ms).count());
  home_.observer().examWaits({});
  return interrupted_ || stopped_ ? Status(Error{ErrorCode::kFailed, "it was cancelled"}) : Status();
}

Status StationRun::chooseDevice() {
  if (options_.opensWindow() && options_.device == "simulated" && options_.hand.plan == kPointerPlan)
    steering_ = std::make_shared<HandSteering>();
  way_ = insertionOf(lesson_, options_.X_WL);
  DeviceOptions device_options{lesson_.scene, targetsOf(lesson_.profile, options_.X_WL),
                               options_.X_HT, options_.hand,
                               steering_,     way_};
  device_options.hand.capped = !options_.uncapped && lesson_.model.isLive(Effect::kPalpation);
  ASSIGN_OR_RETURN(device_, makeDevice(options_.device, device_options));
  if (options_.rehearse_fault_s) {
    device_ = std::make_unique<RehearsedFault>(std::move(device_), *options_.rehearse_fault_s);
    device_notes_.push_back(fmt::format("a fault is rehearsed after {:.3g} s", *options_.rehearse_fault_s));
  }
  ASSIGN_OR_RETURN(delay_, loopDelayOf(options_, device_->info()));
  RETURN_IF_ERROR(fitLesson(lesson_, device_->info(), delay_, options_, device_notes_));
  for (const std::string& note : device_notes_) logMessage(note);
  return {};
}

Status StationRun::openDevice() {
  RETURN_IF_ERROR(checkStiffness(lesson_.model, device_->info()));
  RETURN_IF_ERROR(device_->open(options_.rate_hz));
  return {};
}

Status StationRun::openSession() {
  pb::SessionDescription d;
  const Uuid id = makeUuidV7();
  d.set_session_id(id.data(), id.size());
  d.set_station(home_.station());
  d.set_trainee(person_.empty() ? options_.trainee : person_);
  d.set_exercise_id(options_.exercise);
  d.set_code_checked(code_checked_);
  d.set_profile_id(lesson_.profile.id());
  d.set_profile_revision(lesson_.profile_revision);
  d.set_profile_json(profileJson(lesson_.profile));
  d.set_engine_version(programVersion());
  d.set_capped_on_pieces(lesson_.model.isLive(Effect::kPalpation));
  d.set_rate_hz(options_.rate_hz);
  setResolution(d, Resolution::standard());
  d.set_started_steady_ns(home_.time().nowNs());
  dateBegin(d);
  d.set_device(device_->info().name);
  d.set_axial_model(std::string(axialModelName(lesson_.model.axial_model)));
  for (const std::string& effect : liveEffects(lesson_.model)) d.add_live_effects(effect);
  for (const std::string& note : device_notes_) d.add_device_notes(note);
  if (lesson_.shares.lever < 1) d.set_stiffness_share(lesson_.shares.lever);
  if (lesson_.shares.delay < 1) d.set_delay_stiffness_share(lesson_.shares.delay);
  if (!(options_.X_WL == Pose{})) putPose(*d.mutable_placement(), options_.X_WL);
  if (!(options_.X_HT == Pose{})) putPose(*d.mutable_tool(), options_.X_HT);
  ASSIGN_OR_RETURN(session_, home_.spool().create(d));
  if (Uplink* uplink = home_.uplink()) uplink->add(session_, true);
  // for times without the server, which may begin now
  if (const Status kept =
          CurriculumCache(options_.spool, options_.key_file).keepBegun(options_.trainee, options_.exercise);
      !kept.ok())
    logMessage("this station could not save that an attempt was begun: " + kept.error().message);
  return {};
}

// uses the server's clock if it was reachable since this program began and the computer did not sleep since:
// this computer's may be wrong
void StationRun::dateBegin(pb::SessionDescription& d) const {
  constexpr std::int64_t kBehind_ns = 300'000'000'000;
  const Uplink* const uplink = home_.uplink();
  const std::int64_t wall_ns = wallNowNs();
  if (const auto server_ns =
          uplink != nullptr ? uplink->state().serverUnixNs(d.started_steady_ns(), wall_ns) : std::nullopt) {
    d.set_started_unix_ns(*server_ns);
    d.set_begin_clock(pb::SessionDescription::SERVER_CLOCK);
    return;
  }
  d.set_started_unix_ns(wall_ns);
  const std::int64_t known_ns = home_.spool().clock().lastServerUnixNs();
  d.set_begin_clock(known_ns == 0                                 ? pb::SessionDescription::OWN_CLOCK_ALONE
                    : d.started_unix_ns() < known_ns - kBehind_ns ? pb::SessionDescription::OWN_CLOCK_BEHIND
                                                                  : pb::SessionDescription::OWN_CLOCK);
  if (d.begin_clock() == pb::SessionDescription::OWN_CLOCK_BEHIND)
    logMessage(
        "this computer's clock is behind: the server was asked at a later time; set it (timedatectl), or a "
        "manager has to say when this session began");
}

// informs the observer
void StationRun::announce() {
  auto beginning = std::make_shared<LessonBeginning>();
  beginning->session_id = session_->idText();
  beginning->trainee = options_.trainee;
  beginning->code_unchecked = code_unchecked_;
  beginning->lesson = lesson_;
  beginning->X_WL = options_.X_WL;
  beginning->rate_hz = options_.rate_hz;
  beginning->device = device_->info();
  beginning->device_notes = device_notes_;
  beginning->steering = steering_;
  beginning->way = way_;
  home_.observer().began(std::move(beginning));
}

Status StationRun::practise() {
  // the spool writer takes the ticks from the loop
  SpoolWriter::Callbacks callbacks;
  callbacks.trouble = logMessage;
  Uplink* const uplink = home_.uplink();
  // computes the figures for the instructor's overview, on the writer's thread
  const auto lesson_watch = std::make_shared<LessonWatch>(lesson_.profile, options_.X_WL,
                                                          lesson_.exercise ? &*lesson_.exercise : nullptr);
  const auto hand_buttons = std::make_shared<HandButtons>(options_.rate_hz);
  const auto memory_follower = std::make_shared<MemoryFollower>(lesson_.model);
  callbacks.cut_memory = [memory_follower](const GestureSample& sample, bool wanted) {
    memory_follower->follow(sample);
    return wanted ? memory_follower->cuts() : Bytes();
  };
  callbacks.paths = [memory_follower](bool first) { return memory_follower->path(first); };
  callbacks.piece = [this, uplink, lesson_watch, hand_buttons, memory_follower](const SamplePiece& samples) {
    SamplePiece piece = samples;
    piece.cut_memory = memory_follower->cutsDue();  // its last sample is the last one followed
    piece.paths = memory_follower->pathsDue();
    lesson_watch->add(*piece.samples);
    alarms_.take(lesson_watch->alarms());
    if (hand_buttons->press(*piece.samples)) home_.requests().switchHand();
    if (uplink != nullptr) {
      uplink->offer(piece);
      uplink->noteLesson({lesson_watch->peakForce_N(), lesson_watch->warnings(), lesson_watch->forceLimit_N(),
                          lesson_watch->layerName(), alarmCountsOf(lesson_watch->alarms())});
    }
    home_.observer().piece(piece);
  };
  if (uplink != nullptr) callbacks.durable = [uplink] { uplink->wake(); };
  SpoolWriterOptions writer_options;
  writer_options.rate_hz = options_.rate_hz;
  writer_options.time = &home_.time();
  const auto core = coreForLoop(options_.cpu);
  auto keep_off = std::make_optional<KeepOffCore>(core);
  writer_ = std::make_unique<SpoolWriter>(ring_, session_, writer_options, std::move(callbacks));
  BlackBox black_box(options_.rate_hz);
  const auto black_boxes = options_.spool / "black-box";
  removeOldBlackBoxes(black_boxes, options_.keep.age_s);
  BlackBoxWriter black_box_writer(black_box, black_boxes, session_->idText(), logMessage, home_.time());
  keep_off.reset();

  // the loop
  RtOptions rt_options;
  rt_options.cpu = core;
  rt_options.cpu_needs_fifo = !options_.cpu;
  rt_options.spin_ns = std::llround(options_.spin_us * 1e3);
  rt_options.rate_hz = options_.rate_hz;
  LoopTime clock(rt_options.spin_ns);
  EnterKey enter(STDIN_FILENO);
  const bool is_attended = options_.opensWindow() || enter.isTerminal();
  ServoSettings settings{options_.rate_hz, options_.X_HT};
  (limit_from_start_ ? settings.max_ticks : settings.needle_ticks) =
      static_cast<std::uint64_t>(std::llround(time_limit_s_ * options_.rate_hz));
  settings.on_fault = options_.on_fault.value_or(is_attended ? FaultPolicy::kWait : FaultPolicy::kEnd);
  settings.black_box = &black_box;
  settings.plunger = options_.plunger;
  // a recording that is played has no button for the cap
  settings.starts_capped = !options_.uncapped && device_->info().renders_force;
  settings.passivity = lesson_.passivity;
  if (lesson_.model.body_spec)
    // below the loop's 80; without permission it keeps its normal priority, which matters only on a busy
    // machine
    paths_ = std::make_unique<PathWorker>(lesson_.model, [] { static_cast<void>(makeThreadRealTime(20)); });
  loop_ = std::make_unique<ServoLoop>(lesson_.model, *device_, clock, ring_, settings, paths_.get());
  logMessage("session " + session_->idText() + ": " + lesson_.profile.name() + ", " + device_->info().name);

  const ShallowSleep shallow_sleep;
  realtime_ = judgeMachine(rt_options);
  realtime_.push_back(shallow_sleep.step());
  realtime_.push_back(lockMemory());
  std::vector<RtStep> thread_steps;
  std::promise<void> prepared;
  const CrashGuard crash_guard(*loop_);
  std::thread haptic([&] {
    CrashGuard::setHapticThread();
    thread_steps = makeThreadRealTime(rt_options);
    prepared.set_value();
    loop_->run();
  });
  prepared.get_future().wait();
  realtime_.insert(realtime_.end(), thread_steps.begin(), thread_steps.end());
  for (const std::string& line : rtStepLines(realtime_)) logMessage("real time: " + line);
  {
    const DeviceMaintenance maintenance(*device_, home_.time());
    LoopWatch watch({home_, options_, lesson_, *loop_, *writer_, maintenance, settings.on_fault, alarms_,
                     time_limit_s_, limit_from_start_},
                    signals_, enter);
    watch.run();
    interrupted_ = interrupted_ || watch.interrupted();
    if (watch.stopped()) stopped_ = watch.stopped();
    haptic.join();
  }
  device_->close();
  black_box_writer.finish();
  black_box_ = black_box_writer.counts();
  home_.observer().concluding();
  stored_ = writer_->finish(5s);
  if (!stored_.ok()) logMessage(stored_.error().message);
  return stored_;
}

void StationRun::drain() {
  Uplink* const uplink = home_.uplink();
  if (uplink == nullptr) return;
  DrainPatience patience;
  patience.whole = std::chrono::duration<double>(options_.drain_s);
  // if the disk stays full, the next start ends the session
  if (!session_->contents().ended)
    patience.whole = std::min(patience.whole, std::chrono::duration<double>(2));
  home_.requests().clear();
  // a second signal or request ends the wait for the server
  const DrainEnd end = needlelab::drain(*uplink, patience, [&] {
    return signalWithin(signals_, 0ms) != 0 || home_.requests().takeStop().has_value();
  });
  if (const std::string text = drainText(end, uplink->state()); !text.empty()) logMessage(text);
}

// for an exam; uses only the server's clock, because this computer's may be wrong
std::int64_t StationRun::resultsWithheldUntil() const {
  const Uplink* const uplink = home_.uplink();
  const auto server_ns =
      uplink != nullptr ? uplink->state().serverUnixNs(home_.time().nowNs(), wallNowNs()) : std::nullopt;
  const std::int64_t from_ns = lesson_.results_from_unix_ns;
  return from_ns != 0 && (!server_ns || *server_ns < from_ns) ? from_ns : 0;
}

// only once, because it reads the whole recording
void StationRun::scoreHere() {
  if (local_ || resultsWithheldUntil() != 0) return;
  local_ = localScore(*session_, lesson_, options_.X_WL);
  if (!local_->ok()) logMessage("no score by this station: " + local_->error().message);
}

StationSummary StationRun::summarise() {
  StationSummary s;
  s.session_id = session_->idText();
  s.station = home_.station();
  s.trainee = options_.trainee;
  s.exercise = options_.exercise;
  s.profile = lesson_.profile.id();
  s.profile_revision = lesson_.profile_revision;
  s.device = device_->info().name;
  s.rate_hz = options_.rate_hz;
  s.servo = loop_->stats();
  s.writer = writer_->counts();
  s.ring_dropped = ring_.dropped();
  if (const SpoolLoss loss = session_->contents().loss; loss.samples > 0) s.lost_from_tick = loss.from_tick;
  s.axial_model = axialModelName(lesson_.model.axial_model);
  s.live_effects = liveEffects(lesson_.model);
  s.realtime = realtime_;
  s.black_box = black_box_;
  s.device_notes = device_notes_;
  s.alarms = alarms_.counts();
  s.shares = lesson_.shares;
  s.left_out = lesson_.left_out;
  s.spool = options_.spool.string();
  if (stopped_) s.stopped = *stopped_;
  s.state = "OPEN";
  s.results_from_unix_ns = resultsWithheldUntil();
  Uplink* const uplink = home_.uplink();
  s.has_server = uplink != nullptr;
  if (uplink != nullptr) {
    s.uplink = uplink->state();
    s.spool_left = s.uplink.chunks_left;
    s.samples_acked = session_->samplesIn(s.uplink.current_committed);
    if (s.uplink.current_verdict) {
      const auto& verdict = *s.uplink.current_verdict;
      s.state = verdict.state() == pb::SESSION_COMPLETE      ? "COMPLETE"
                : verdict.state() == pb::SESSION_INTERRUPTED ? "INTERRUPTED"
                                                             : "OPEN";
      if (s.results_from_unix_ns == 0) {
        s.score_json = verdict.score_json();
        s.score_source = "server";
      }
    }
  } else {
    for (const auto& session : home_.spool().unfinished())
      s.spool_left +=
          session->contents().chunks - std::min(session->contents().chunks, session->receipt().committed);
  }
  const bool scored_here = local_ && local_->ok() && s.results_from_unix_ns == 0;
  if (scored_here) {
    s.syringe_json = (*local_)->events_json;
    s.miss = (*local_)->miss;
  }
  if (s.score_json.empty() && scored_here) {
    s.score_json = (*local_)->score_json;
    s.score_source = "station";
  }
  return s;
}

LessonOutcome StationRun::outcome() {
  scoreHere();
  LessonOutcome outcome;
  outcome.summary = summarise();
  outcome.stored = stored_;
  outcome.code_unchecked = code_unchecked_;
  if (local_ && local_->ok() && outcome.summary.results_from_unix_ns == 0) {
    outcome.curve = (*local_)->curve;
    outcome.deepest = (*local_)->deepest;
  }
  return outcome;
}

int StationRun::report(const LessonOutcome& outcome, const std::vector<StationSummary>& earlier) {
  const StationSummary& summary = outcome.summary;
  const bool json_on_stdout = options_.json && options_.json_file.empty();
  (json_on_stdout ? std::cerr : std::cout) << summaryText(summary) << std::flush;
  if (json_on_stdout) std::cout << summaryJson(summary, earlier) << std::flush;
  if (options_.json && !json_on_stdout)
    if (auto status = writeFileAtomically(options_.json_file, viewOf(summaryJson(summary, earlier)));
        !status.ok()) {
      logMessage(status.error().message);
      return kExitFailed;
    }
  if (summary.servo.fault != Fault::kNone) {
    logMessage(std::string("the lesson ended in FAULT: ") + faultText(summary.servo.fault) +
               ". The force was taken away; the session is stored");
    return kExitFailed;
  }
  if (!std::cout) {
    logMessage("cannot write the closing summary to standard output");
    return kExitFailed;
  }
  // the samples are safe in the spool but do not reach the server: not a success
  if (!summary.uplink.current_trouble.empty() && !summary.uplink.current_verdict) {
    logMessage("the server did not take the session: " + summary.uplink.current_trouble);
    return kExitFailed;
  }
  return outcome.stored.ok() ? kExitDone : kExitFailed;
}

}  // namespace needlelab
