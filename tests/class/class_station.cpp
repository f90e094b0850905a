#include "tests/class/class_station.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "client/device/hand/hand_options.h"
#include "client/device/hand/simulated_device.h"
#include "client/net/link/connect.h"
#include "client/sim/tools/closed_loop.h"
#include "client/station/run/io/station_key.h"
#include "client/station/run/lesson/lesson.h"
#include "common/base/program.h"
#include "common/fem/needle_mesh.h"
#include "common/gesture/chunk.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/scoring/anatomy/anatomy.h"

namespace needlelab {
namespace {

constexpr double kLongest_s = 600;

using namespace std::chrono_literals;

constexpr auto kPatience = 120s;
constexpr std::size_t kChunkSamples = 1000;

/// Empty: there were no requirements.
std::optional<bool> passedOf(const std::string& score_json) {
  const auto rows = nlohmann::json::parse(score_json, nullptr, false);
  std::optional<bool> passed;
  if (!rows.is_array()) return passed;
  for (const auto& row : rows) {
    if (!row.is_object() || !row.contains("passed") || !row["passed"].is_boolean()) continue;
    passed = passed.value_or(true) && row["passed"].get<bool>();
  }
  return passed;
}

}  // namespace

Result<ClassLesson> classLessonOf(const pb::Lesson& message) {
  ClassLesson lesson;
  ASSIGN_OR_RETURN(auto exercise, parseExercise(message.exercise_json(), "the lesson's exercise"));
  lesson.exercise = std::move(exercise);
  const std::string source = "profile of exercise " + lesson.exercise.id();
  auto profile = parseProfile(message.profile_json(), source);
  if (!profile.ok()) return profile.error();
  if (profile->targets().empty())
    return Error{ErrorCode::kInvalidInput, source + " has no target: nothing to aim at"};
  auto scene = sceneSpecOf(*profile, Pose{});
  if (!scene.ok()) return scene.error();
  RETURN_IF_ERROR(addCompliance(*scene));
  ASSIGN_OR_RETURN(auto model, compile(*scene, kClassRate_hz));
  const Anatomy anatomy = anatomyOf(*profile, {});
  lesson.entry_m = markedEntry(scene->limb, {});
  lesson.tip_target_m = tipForTarget(anatomy, anatomy.targets.at(0),
                                     openingBehindTip_m(needleOf(profile->needle())), lesson.entry_m);
  lesson.profile = *std::move(profile);
  lesson.profile_revision = message.profile_revision();
  lesson.scene = *std::move(scene);
  lesson.model = model;
  return lesson;
}

Result<std::vector<GestureSample>> practiseOnce(const ClassLesson& lesson, double skill, std::uint64_t seed) {
  HandRandom random(seed);
  const HandSkill hand = skillOf(skill);
  SimulatedDeviceOptions options;
  options.hand = handOf(hand, random.next());
  SimulatedDevice device(options,
                         attemptPlan(hand, lesson.scene.limb, lesson.tip_target_m, random, lesson.entry_m));
  const double seconds = lesson.exercise.has_time_limit_s() ? lesson.exercise.time_limit_s() : kLongest_s;
  const auto ticks = runClosedLoop(lesson.model, device, {},
                                   static_cast<std::uint64_t>(std::llround(seconds * kClassRate_hz)));
  if (!ticks.ok()) return ticks.error();
  std::vector<GestureSample> samples;
  samples.reserve(ticks->size());
  for (const ChainTick& tick : *ticks)
    samples.push_back(sampleOf(
        tick, kClassClock_ns + std::llround(static_cast<double>(tick.tick) * 1e9 / kClassRate_hz), 0, 0));
  return samples;
}

ClassStation::ClassStation(ClassPlace place, const std::vector<ClassTrainee>& trainees,
                           const std::vector<std::string>& exercises, std::function<void()> done)
    : place_(std::move(place)), trainees_(trainees), exercises_(exercises), done_(std::move(done)) {}

ClassStation::~ClassStation() = default;

Status ClassStation::connect() {
  auto key = loadStationKey(place_.key_file);
  if (!key.ok()) return key.error();
  station_ = key->station;
  ASSIGN_OR_RETURN(auto spool, Spool::open(place_.spool));
  spool_ = std::move(spool);
  UplinkConfig config;
  ASSIGN_OR_RETURN(auto tls, makeClientTls(place_.ca_file));
  config.client.tls = std::move(tls);
  config.client.server = place_.server;
  config.client.program = programText("class");
  config.client.login = stationLogin(station_, key->key);
  UplinkEvents events;
  events.closed = [this](const pb::SessionClosed& closed) {
    const std::scoped_lock lock(mutex_);
    verdicts_[closed.session_id()] = closed;
  };
  uplink_ = std::make_unique<Uplink>(std::move(config), std::move(events));
  return {};
}

Status ClassStation::practise(std::vector<ClassSession>& attempts, const std::function<bool()>& stopped) {
  std::size_t first = 0;
  for (std::size_t i = 0; i < attempts.size(); ++i) {
    if (stopped()) return Error{ErrorCode::kFailed, "stopped"};
    // passed exercises unlock others: wait for the server's verdict before the next exercise
    if (i > first && (attempts[i].plan.exercise != attempts[first].plan.exercise ||
                      attempts[i].plan.trainee != attempts[first].plan.trainee)) {
      RETURN_IF_ERROR(settle(attempts, first, i));
      first = i;
    }
    RETURN_IF_ERROR(one(attempts[i]));
    done_();
  }
  return settle(attempts, first, attempts.size());
}

Status ClassStation::one(ClassSession& attempt) {
  const std::string& name = trainees_[attempt.plan.trainee].name;
  const std::string& exercise = exercises_[attempt.plan.exercise];
  const auto message = uplink_->getLesson(exercise, name, kPatience, false);
  if (!message.ok()) {
    if (message.error().code != ErrorCode::kDenied || uplink_->state().denied) return message.error();
    attempt.locked = true;
    attempt.trouble = message.error().message;
    return {};
  }
  ASSIGN_OR_RETURN(const ClassLesson* const known, lessonOf(exercise, *message));
  const ClassLesson& lesson = *known;
  const auto samples = practiseOnce(lesson, attempt.plan.skill, attempt.plan.seed);
  if (!samples.ok())
    return Error{samples.error().code, name + " at " + exercise + ": " + samples.error().message};
  ASSIGN_OR_RETURN(const auto session, record(attempt, lesson, *samples));
  attempt.session_id = session->idText();
  attempt.samples = samples->size();
  uplink_->add(session, false);
  uplink_->wake();
  return {};
}

Result<const ClassLesson*> ClassStation::lessonOf(const std::string& exercise, const pb::Lesson& message) {
  const auto known = lessons_.find(exercise);
  if (known != lessons_.end() && known->second.profile_revision == message.profile_revision())
    return &known->second;
  ASSIGN_OR_RETURN(auto lesson, classLessonOf(message));
  return &lessons_.insert_or_assign(exercise, std::move(lesson)).first->second;
}

Result<std::shared_ptr<SpoolSession>> ClassStation::record(const ClassSession& attempt,
                                                           const ClassLesson& lesson,
                                                           const std::vector<GestureSample>& samples) {
  pb::SessionDescription d;
  const Uuid id = makeUuidV7();
  d.set_session_id(id.data(), id.size());
  d.set_station(station_);
  d.set_trainee(trainees_[attempt.plan.trainee].name);
  d.set_exercise_id(exercises_[attempt.plan.exercise]);
  d.set_profile_id(lesson.profile.id());
  d.set_profile_revision(lesson.profile_revision);
  d.set_profile_json(profileJson(lesson.profile));
  d.set_engine_version(programVersion());
  d.set_rate_hz(kClassRate_hz);
  const Resolution resolution = Resolution::standard();
  setResolution(d, resolution);
  d.set_started_unix_ns(attempt.plan.started_unix_ns);
  d.set_started_steady_ns(kClassClock_ns);
  char device[96];
  std::snprintf(device, sizeof device, "simulated hand of skill %.2f, faster than real time",
                attempt.plan.skill);
  d.set_device(device);
  d.set_axial_model(std::string(axialModelName(lesson.model.axial_model)));
  for (const std::string& effect : liveEffects(lesson.model)) d.add_live_effects(effect);
  auto session = spool_->create(d);
  if (!session.ok()) return session;
  const std::span<const GestureSample> all(samples);
  for (std::size_t at = 0; at < all.size(); at += kChunkSamples) {
    const auto some = all.subspan(at, std::min(kChunkSamples, all.size() - at));
    if (const Status status = (*session)->appendChunk(encodeChunk(resolution, some), some.size());
        !status.ok())
      return status.error();
  }
  RETURN_IF_ERROR((*session)->sync());
  RETURN_IF_ERROR((*session)->end(false));
  return session;
}

Status ClassStation::settle(std::vector<ClassSession>& attempts, std::size_t first, std::size_t end) {
  const bool all = uplink_->waitUntilDone(kPatience);
  const std::scoped_lock lock(mutex_);
  for (std::size_t i = first; i < end; ++i) {
    ClassSession& attempt = attempts[i];
    if (attempt.session_id.empty()) continue;
    const auto id = parseUuid(attempt.session_id);
    if (!id) continue;
    const auto verdict = verdicts_.find(std::string(id->begin(), id->end()));
    if (verdict == verdicts_.end()) {
      attempt.trouble = "the server has not closed it";
      if (!all)
        return Error{ErrorCode::kUnavailable, "session " + attempt.session_id +
                                                  ": the server has not closed it in time (" +
                                                  uplink_->state().error + ")"};
      continue;
    }
    attempt.closed = verdict->second.state() == pb::SESSION_COMPLETE;
    if (!attempt.closed)
      attempt.trouble = "closed as " + pb::SessionState_Name(verdict->second.state()) + ", not complete";
    attempt.passed = passedOf(verdict->second.score_json());
    verdicts_.erase(verdict);
  }
  return {};
}

}  // namespace needlelab
