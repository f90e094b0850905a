#include "station/station.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <future>
#include <iostream>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

#include "base/atomic_file.h"
#include "base/clock.h"
#include "base/exit_code.h"
#include "base/text_rules.h"
#include "device_factory/device_factory.h"
#include "net/drain.h"
#include "net/spool_guard.h"
#include "net/spool_lessons.h"
#include "net/uplink.h"
#include "profile/profile.h"
#include "station/black_box_writer.h"
#include "station/lesson.h"
#include "station/local_score.h"
#include "station/rt_machine.h"
#include "station/servo_loop.h"
#include "station/station_key.h"
#include "station/summary.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

constexpr double kHandDamping_Ns_per_m = 3;  // of an ordinary grip (DESIGN §10)
constexpr auto kPatience = 10s;              // for a lesson from the server

// one line at a time from several threads
void say(const std::string& text) {
  static std::mutex mutex;
  const std::scoped_lock lock(mutex);
  // words of the server, of a file or of an instructor may be among them: nothing that commands a terminal
  std::cerr << "station: " << printable(text) << std::endl;
}

// waits for a stop signal; false when the time passed
bool stopSignalWithin(const sigset_t& signals, std::chrono::milliseconds time) {
  const timespec timeout{time.count() / 1000, (time.count() % 1000) * 1'000'000};
  return ::sigtimedwait(&signals, nullptr, &timeout) > 0;
}

void putPose(google::protobuf::RepeatedField<double>& to, const Pose& pose) {
  for (const double value : {pose.p.x, pose.p.y, pose.p.z, pose.q.x, pose.q.y, pose.q.z, pose.q.w})
    to.Add(value);
}

/// Everything of one lesson, in the order in which it comes to be.
class Lesson {
 public:
  Lesson(const StationOptions& options, const sigset_t& stop_signals)
      : options_(options), signals_(stop_signals) {}

  int run() {
    for (const auto step : {&Lesson::openSpool, &Lesson::connect, &Lesson::getLesson, &Lesson::calibrate,
                            &Lesson::openDevice, &Lesson::openSession})
      if (const Status status = (this->*step)(); !status.ok()) {
        say(status.error().message);
        return exitCodeOf(status.error());
      }
    const Status stored = practise();
    drain();
    return conclude(stored);
  }

 private:
  Status openSpool();
  Status connect();
  Status getLesson();
  Status openDevice();
  Status calibrate();
  Status openSession();
  Status practise();
  void drain();
  int conclude(const Status& stored);
  StationSummary summarise();

  const StationOptions& options_;
  const sigset_t& signals_;
  std::string station_ = options_.station;
  std::unique_ptr<Spool> spool_;
  std::unique_ptr<SpoolGuard> spool_guard_;
  SampleRing ring_;
  std::unique_ptr<Uplink> uplink_;
  StationLesson lesson_;
  std::optional<EffectCosts> effect_costs_;
  std::unique_ptr<Device> device_;
  std::shared_ptr<SpoolSession> session_;
  std::unique_ptr<ServoLoop> loop_;
  std::unique_ptr<SpoolWriter> writer_;
  std::vector<RtStep> realtime_;
  BlackBoxCounts black_box_;
  std::uint64_t max_ticks_ = 0;
};

Status Lesson::openSpool() {
  auto spool = Spool::open(options_.spool);
  if (!spool.ok()) return spool.error();
  spool_ = std::move(*spool);
  for (const std::string& note : spool_->notes()) say(note);
  for (const std::string& note : spool_->cleanUp(options_.keep, wallNowNs())) say(note);
  spool_guard_ = std::make_unique<SpoolGuard>(*spool_, options_.keep, options_.rate_hz, say);
  spool_guard_->report();
  return {};
}

Status Lesson::connect() {
  Result<StationKey> key = StationKey{};
  if (!options_.key_file.empty()) {
    key = loadStationKey(options_.key_file);
    if (!key.ok()) return key.error();
    // without a server, too: what is recorded now is uploaded under this name later
    if (station_.empty()) station_ = key->station;
  }
  if (!options_.server) {
    if (const auto waiting = spool_->unfinished().size(); waiting > 0)
      say(std::to_string(waiting) +
          " session(s) of before wait in the spool for a server; without --server they go on waiting");
    return {};
  }
  UplinkConfig config;
  auto tls = makeClientTls(options_.ca_file);
  if (!tls.ok()) return tls.error();
  config.client.tls = std::move(*tls);
  config.client.server = *options_.server;
  config.client.program = programText("station");
  config.client.login = stationLogin(station_, key->key);
  UplinkEvents events;
  events.say = say;
  events.trainee_message = [](const pb::TraineeMessage& message) {
    say("message from " + message.from() + ": " + message.text());
  };
  events.next_exercise = [](const pb::NextExercise& next) {
    say("next exercise, says " + next.from() + ": " + next.exercise_id() + " (start it with --exercise " +
        next.exercise_id() + ")");
  };
  const auto waiting = spool_->unfinished();
  uplink_ = std::make_unique<Uplink>(std::move(config), std::move(events));
  for (const auto& session : waiting) uplink_->add(session, false);
  if (!waiting.empty())
    say(std::to_string(waiting.size()) +
        " sessions of earlier runs are in the spool; they are uploaded beside this one");
  return {};
}

Status Lesson::getLesson() {
  auto lesson = [&]() -> Result<StationLesson> {
    if (!options_.profile_file.empty()) return lessonOfFile(options_);
    const LessonCache cache(options_.spool);
    auto cached = cache.find(options_.exercise);
    if (!cached.ok() && cached.error().code == ErrorCode::kInvalidInput)
      return cached.error();  // no id at all
    if (uplink_) {
      auto fetched = uplink_->getLesson(options_.exercise, options_.trainee, kPatience, cached.ok());
      if (fetched.ok()) {
        if (auto kept = cache.keep(options_.exercise, *fetched); !kept.ok())
          say("the lesson is not cached: " + kept.error().message);
        return lessonOfMessage(options_, *fetched);
      }
      // a server that answers "no" is believed; one that is away is not waited for
      if (fetched.error().code != ErrorCode::kUnavailable) return fetched.error();
      if (!cached.ok())
        return Error{fetched.error().code, fetched.error().message + ", and " + cached.error().message};
      say("the server is away (" + fetched.error().message + "); exercise " + options_.exercise +
          " comes from the cache, the samples wait in the spool");
    }
    if (!cached.ok())
      return Error{ErrorCode::kInvalidInput, cached.error().message + "; give --server, or --profile FILE"};
    auto usable = lessonOfMessage(options_, *cached);
    if (!usable.ok())
      return Error{usable.error().code, "the cached lesson " + options_.exercise +
                                            " cannot be used: " + usable.error().message +
                                            "; connect to the server once, which gives it anew"};
    say("exercise " + options_.exercise + " from the cache: profile " + usable->profile.id() + ", revision " +
        std::to_string(usable->profile_revision));
    return usable;
  }();
  if (!lesson.ok()) return lesson.error();
  lesson_ = std::move(*lesson);
  for (const std::string& warning : lesson_.warnings) say("profile " + lesson_.profile.id() + ": " + warning);
  return {};
}

Status Lesson::openDevice() {
  DeviceOptions device_options{lesson_.scene, targetsOf(lesson_.profile, options_.X_WL), options_.X_HT,
                               options_.hand};
  auto device = makeDevice(options_.device, device_options);
  if (!device.ok()) return device.error();
  device_ = std::move(*device);
  if (auto status = checkStiffness(lesson_.model, device_->info()); !status.ok()) return status;
  const double hand = options_.device == "simulated" ? options_.hand.damping_Ns_per_m : kHandDamping_Ns_per_m;
  if (const auto warning = passivityWarning(lesson_.model, device_->info(), hand)) say(*warning);
  if (auto status = device_->open(options_.rate_hz); !status.ok()) return status;

  double seconds = options_.seconds;
  if (seconds == 0 && lesson_.exercise && lesson_.exercise->time_limit_s() > 0)
    seconds = lesson_.exercise->time_limit_s();
  max_ticks_ = static_cast<std::uint64_t>(std::llround(seconds * options_.rate_hz));
  return {};
}

// what the lesson's effects cost here and now: before the loop, not on its thread. A lesson goes on without
// it
Status Lesson::calibrate() {
  auto costs = calibrateEffects(lesson_.scene, options_.rate_hz);
  if (costs.ok()) {
    say("engine: " + effectCostsText(*costs));
    effect_costs_ = *costs;
  } else {
    say("the effects' cost is not known: " + costs.error().message);
  }
  return {};
}

Status Lesson::openSession() {
  pb::SessionDescription d;
  const Uuid id = makeUuidV7();
  d.set_session_id(id.data(), id.size());
  d.set_station(station_);
  d.set_trainee(options_.trainee);
  d.set_exercise_id(options_.exercise);
  d.set_profile_id(lesson_.profile.id());
  d.set_profile_revision(lesson_.profile_revision);
  d.set_profile_json(profileJson(lesson_.profile));
  d.set_engine_version(NEEDLELAB_VERSION);
  d.set_rate_hz(options_.rate_hz);
  setResolution(d, Resolution::standard());
  d.set_started_unix_ns(wallNowNs());
  d.set_started_steady_ns(steadyNowNs());
  d.set_device(device_->info().name);
  if (!(options_.X_WL == Pose{})) putPose(*d.mutable_placement(), options_.X_WL);
  if (!(options_.X_HT == Pose{})) putPose(*d.mutable_tool(), options_.X_HT);
  auto session = spool_->create(d);
  if (!session.ok()) return session.error();
  session_ = std::move(*session);
  if (uplink_) uplink_->add(session_, true);
  return {};
}

// the lesson itself: the loop on its own thread, this one waits
Status Lesson::practise() {
  SpoolWriter::Callbacks callbacks;
  callbacks.trouble = say;
  if (uplink_) {
    callbacks.piece = [this](const SamplePiece& piece) { uplink_->offer(piece); };
    callbacks.durable = [this] { uplink_->wake(); };
  }
  SpoolWriterOptions writer_options;
  writer_options.rate_hz = options_.rate_hz;
  writer_ = std::make_unique<SpoolWriter>(ring_, session_, writer_options, std::move(callbacks));
  RtOptions rt_options;
  rt_options.cpu = options_.cpu;
  rt_options.spin_ns = std::llround(options_.spin_us * 1e3);
  rt_options.rate_hz = options_.rate_hz;
  SteadyLoopClock clock(rt_options.spin_ns);
  BlackBox black_box(options_.rate_hz);
  const auto black_boxes = options_.spool / "black-box";
  removeOldBlackBoxes(black_boxes, options_.keep.age_s);
  BlackBoxWriter black_box_writer(black_box, black_boxes, session_->idText(), say);
  ServoSettings settings{options_.rate_hz, options_.X_HT, max_ticks_};
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
  std::atomic<bool> done{false};
  std::thread haptic([&] {
    thread_steps = makeThreadRealTime(rt_options);
    prepared.set_value();
    loop_->run();
    done.store(true, std::memory_order_release);
  });
  prepared.get_future().wait();
  realtime_.insert(realtime_.end(), thread_steps.begin(), thread_steps.end());
  for (const std::string& line : rtStepLines(realtime_)) say("real time: " + line);
  while (!done.load(std::memory_order_acquire)) {
    if (stopSignalWithin(signals_, 50ms)) {
      say("stopping");
      loop_->stop();
    }
    spool_guard_->look();
    if (!uplink_) continue;
    uplink_->noteMissedTicks(loop_->missedTicks());
    uplink_->noteWakeup(static_cast<std::uint32_t>(loop_->stats().wakeup.quantile_ns(0.99) / 1000));
    uplink_->noteTrouble("disk", writer_->trouble());
    uplink_->noteTrouble("spool", spool_guard_->trouble());
  }
  haptic.join();
  device_->close();
  black_box_writer.finish();
  black_box_ = black_box_writer.counts();
  const Status stored = writer_->finish(5s);
  if (!stored.ok()) say(stored.error().message);
  return stored;
}

void Lesson::drain() {
  if (!uplink_) return;
  DrainPatience patience;
  patience.whole = std::chrono::duration<double>(options_.drain_s);
  // a disk that stayed full: the session ends at the next start only
  if (!session_->contents().ended)
    patience.whole = std::min(patience.whole, std::chrono::duration<double>(2));
  const DrainEnd end = needlelab::drain(*uplink_, patience, [&] { return stopSignalWithin(signals_, 0ms); });
  if (const std::string words = drainText(end, uplink_->state()); !words.empty()) say(words);
}

StationSummary Lesson::summarise() {
  StationSummary s;
  s.session_id = session_->idText();
  s.station = station_;
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
  s.effect_costs = effect_costs_;
  s.realtime = realtime_;
  s.black_box = black_box_;
  s.spool = options_.spool.string();
  s.state = "OPEN";
  s.has_server = uplink_ != nullptr;
  if (uplink_) {
    s.uplink = uplink_->state();
    s.spool_left = s.uplink.chunks_left;
    s.samples_acked = session_->samplesIn(s.uplink.current_committed);
    if (s.uplink.current_verdict) {
      const auto& verdict = *s.uplink.current_verdict;
      s.state = verdict.state() == pb::SESSION_COMPLETE      ? "COMPLETE"
                : verdict.state() == pb::SESSION_INTERRUPTED ? "INTERRUPTED"
                                                             : "OPEN";
      s.score_json = verdict.score_json();
      s.score_source = "server";
    }
  } else {
    for (const auto& session : spool_->unfinished())
      s.spool_left +=
          session->contents().chunks - std::min(session->contents().chunks, session->receipt().committed);
  }
  if (s.score_json.empty()) {
    auto score = localScore(*session_, lesson_, options_.X_WL);
    if (score.ok()) {
      s.score_json = *score;
      s.score_source = "station";
    } else {
      say("no score: " + score.error().message);
    }
  }
  return s;
}

int Lesson::conclude(const Status& stored) {
  const StationSummary summary = summarise();
  if (uplink_) uplink_->stop();
  spool_guard_->report();
  const bool json_on_stdout = options_.json && options_.json_file.empty();
  (json_on_stdout ? std::cerr : std::cout) << summaryText(summary) << std::flush;
  if (json_on_stdout) std::cout << summaryJson(summary) << std::flush;
  if (options_.json && !json_on_stdout)
    if (auto status = writeFileAtomically(options_.json_file, viewOf(summaryJson(summary))); !status.ok()) {
      say(status.error().message);
      return kExitFailed;
    }
  if (summary.servo.fault != Fault::kNone) {
    say(std::string("FAULT: ") + faultText(summary.servo.fault) +
        ". The force was taken away and the session ended; it is stored");
    return kExitFailed;
  }
  if (!std::cout) {
    say("cannot write the closing summary to standard output");
    return kExitFailed;
  }
  // the samples are safe in the spool, but nobody will ever see them there: that is no success
  if (!summary.uplink.current_trouble.empty() && !summary.uplink.current_verdict) {
    say("the server did not take the session: " + summary.uplink.current_trouble);
    return kExitFailed;
  }
  return stored.ok() ? kExitDone : kExitFailed;
}

}  // namespace

sigset_t blockStopSignals() {
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGINT);
  ::sigaddset(&signals, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

int runStation(const StationOptions& options, const sigset_t& stop_signals) {
  if (!options.headless) say("there is no window yet; going on as with --headless");
  return Lesson(options, stop_signals).run();
}

}  // namespace needlelab
