// Which device, what of the lesson it can render, and the session that keeps all of that.
#include <cmath>
#include <memory>
#include <utility>

#include "client/device/factory/device_factory.h"
#include "client/station/run/device_scene.h"
#include "client/station/run/say.h"
#include "client/station/run/station_run.h"
#include "common/base/clock.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

constexpr double kHandDamping_Ns_per_m = 3;  // of an ordinary grip (DESIGN §10)

void putPose(google::protobuf::RepeatedField<double>& to, const Pose& pose) {
  for (const double value : {pose.p.x, pose.p.y, pose.p.z, pose.q.x, pose.q.y, pose.q.z, pose.q.w})
    to.Add(value);
}

}  // namespace

Status StationRun::chooseDevice() {
  if (options_.opensWindow() && options_.device == "simulated" && options_.hand.plan == kPointerPlan)
    steering_ = std::make_shared<HandSteering>();
  DeviceOptions device_options{lesson_.scene, targetsOf(lesson_.profile, options_.X_WL), options_.X_HT,
                               options_.hand, steering_};
  auto device = makeDevice(options_.device, device_options);
  if (!device.ok()) return device.error();
  device_ = std::move(*device);
  if (auto status = fitLesson(lesson_, device_->info(), options_, device_notes_); !status.ok()) return status;
  for (const std::string& note : device_notes_) say(note);
  return {};
}

// what the lesson's effects cost here and now: before the loop, not on its thread. A lesson goes on without
// it
Status StationRun::measureEffects() {
  auto costs = calibrateEffects(lesson_.scene, options_.rate_hz);
  if (costs.ok()) {
    say("engine: " + effectCostsText(*costs));
    effect_costs_ = *costs;
  } else {
    say("the effects' cost is not known: " + costs.error().message);
  }
  return {};
}

Status StationRun::openDevice() {
  if (auto status = checkStiffness(lesson_.model, device_->info()); !status.ok()) return status;
  const double hand = options_.device == "simulated" ? options_.hand.damping_Ns_per_m : kHandDamping_Ns_per_m;
  if (const auto warning = passivityWarning(lesson_.model, device_->info(), hand)) say(*warning);
  if (auto status = device_->open(options_.rate_hz); !status.ok()) return status;

  time_limit_s_ = options_.seconds;
  if (time_limit_s_ == 0 && lesson_.exercise && lesson_.exercise->time_limit_s() > 0)
    time_limit_s_ = lesson_.exercise->time_limit_s();
  max_ticks_ = static_cast<std::uint64_t>(std::llround(time_limit_s_ * options_.rate_hz));
  return {};
}

Status StationRun::openSession() {
  pb::SessionDescription d;
  const Uuid id = makeUuidV7();
  d.set_session_id(id.data(), id.size());
  d.set_station(home_.station());
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
  d.set_axial_model(std::string(axialModelName(lesson_.model.axial_model)));
  for (const std::string& effect : liveEffects(lesson_.model)) d.add_live_effects(effect);
  for (const std::string& note : device_notes_) d.add_device_notes(note);
  if (!(options_.X_WL == Pose{})) putPose(*d.mutable_placement(), options_.X_WL);
  if (!(options_.X_HT == Pose{})) putPose(*d.mutable_tool(), options_.X_HT);
  auto session = home_.spool().create(d);
  if (!session.ok()) return session.error();
  session_ = std::move(*session);
  if (Uplink* uplink = home_.uplink()) uplink->add(session_, true);
  return {};
}

// to who looks on
void StationRun::announce() {
  auto beginning = std::make_shared<LessonBeginning>();
  beginning->session_id = session_->idText();
  beginning->trainee = options_.trainee;
  beginning->lesson = lesson_;
  beginning->X_WL = options_.X_WL;
  beginning->rate_hz = options_.rate_hz;
  beginning->time_limit_s = time_limit_s_;
  beginning->device = device_->info();
  beginning->device_notes = device_notes_;
  beginning->steering = steering_;
  if (steering_)
    beginning->hand_start = steeredStart(lesson_.scene, targetsOf(lesson_.profile, options_.X_WL)).start();
  home_.audience().began(std::move(beginning));
}

}  // namespace needlelab
