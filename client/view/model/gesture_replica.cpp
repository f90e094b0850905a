#include "client/view/model/gesture_replica.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/haptics/body/given_paths.h"
#include "common/haptics/effects/clamping.h"
#include "common/haptics/effects/line_layers.h"
#include "common/haptics/effects/resume.h"

namespace needlelab {
namespace {

// A live frame may begin with the tip on the skin: replica and recording may differ for this many ticks.
constexpr int kPatience_ticks = 5;
/// No one enters the tissue and leaves it again in a shorter time: a first sample this early is the session's
/// start, even if the loop missed some ticks.
constexpr double kBeginning_s = 0.1;

Vec3 vectorOf(const double (&v)[3]) {
  return {v[0], v[1], v[2]};
}

bool canBeStepped(const GestureSample& sample) {
  return (sample.flags & kFlagNotStepped) == 0 && isFinite(vectorOf(sample.p_WT_m)) &&
         isFinite(Quat{sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]});
}

// the direction in which the fixture pushes the tip in the last step
Vec3 clampingDirection(const SceneModel& model, SimState& engine) {
  Tick tick;
  project(engine, engine.p_prev_W_m, tick);
  const LateralStiffness of = lateralStiffness(engine.along, tick.insertion_m);
  const double held_N = std::min(of.k_N_per_m * tick.lateral_m, model.fixture.max_force_N);
  const FixturePull pull =
      fixturePull(model, tick, held_N / tick.lateral_m, of.slope_N_per_m2, held_N / of.k_N_per_m);
  return normalized(tick.lateral_W_m * -pull.line_N_per_m - tick.arm_W_m * pull.entry_N_per_m);
}

}  // namespace

void copySample(const GestureSample& sample, double loop_rate_hz, Moment& now) {
  now.tick = sample.tick;
  now.time_s = static_cast<double>(sample.tick) / loop_rate_hz;
  const Vec3 p_W_m = vectorOf(sample.p_WT_m);
  const Quat q_W{sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]};
  // keep the last good pose instead of an invalid one
  if (isFinite(p_W_m)) now.p_WT_m = p_W_m;
  if (isFinite(q_W) && dot(q_W, q_W) > 0.25) now.q_WT = q_W;
  now.force_W_N = vectorOf(sample.force_W_N);
  now.torque_W_Nm = vectorOf(sample.torque_W_Nm);
  now.wall_W_m = vectorOf(sample.wall_W_m);
  now.phase = sample.phase <= static_cast<std::uint8_t>(Phase::kWithdrawing)
                  ? static_cast<Phase>(sample.phase)
                  : Phase::kFree;
  now.layer = sample.layer;
  now.insertion_m = sample.insertion_m;
  now.speed_mps = sample.speed_mps;
  now.lateral_error_m = sample.lateral_error_m;
  now.plunger = sample.plunger;
  now.flags = sample.flags;
  now.buttons = sample.buttons;
  now.fault = sample.fault;
}

struct GestureReplica::State {
  explicit State(std::shared_ptr<const SceneModel> scene) : model(std::move(scene)), engine(*model) {}

  std::shared_ptr<const SceneModel> model;
  bool reduced_rate = false;
  double loop_rate_hz = 1000;
  SceneEngine engine;
  std::uint64_t paths_used = 0;  // when now.path was in use
  StepReport report;
  Moment now;
  std::uint64_t fed = 0;
  bool differs = false;       // in this tick the engine's result differs from the sample
  bool lost = false;          // samples are missing since the tip was last outside
  int disagreements = 0;      // consecutive ticks in which replica and recording differ on being inside
  bool cuts_unknown = false;  // CUT_MEMORY: insertions before this one were not seen
  GivenPaths paths;           // only in a body
  bool guessed = false;       // entry and u were guessed from the pose, because the entry was not seen
  Vec3 guessed_entry_W_m, guessed_u_W;

  void forgetCuts();
  void stepAlong(const GestureSample& sample);
  void compareWith(const GestureSample& sample);
  void updateMoment();
};

GestureReplica::GestureReplica(std::shared_ptr<const SceneModel> model, bool reduced_rate,
                               double loop_rate_hz)
    : state_(std::make_unique<State>(std::move(model))) {
  state_->reduced_rate = reduced_rate;
  state_->loop_rate_hz = loop_rate_hz > 0 ? loop_rate_hz : state_->model->rate_hz;
  restart();
}

GestureReplica::GestureReplica(GestureReplica&&) noexcept = default;
GestureReplica& GestureReplica::operator=(GestureReplica&&) noexcept = default;
GestureReplica::~GestureReplica() = default;

void GestureReplica::restart() {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  state_->engine.restart();
  state_->paths_used = 0;
  state_->report = {};
  state_->report.p_wall_W_m = {nan, nan, nan};
  state_->now = {};
  state_->now.wall_W_m = {nan, nan, nan};
  state_->now.alpha_rad = orientationLimitAngle(state_->model->needle_length_m, 0);
  state_->fed = 0;
  state_->differs = state_->lost = state_->guessed = state_->cuts_unknown = false;
  state_->paths = {};
  state_->disagreements = 0;
}

void GestureReplica::noteGap() {
  state_->lost = true;
  state_->forgetCuts();
}

void GestureReplica::takeCuts(const CutSnapshot& snapshot) {
  State& state = *state_;
  // during an insertion the wall already follows from the memory at its entry
  const bool outside = state.fed > 0 && !state.now.inside && state.now.layer < 0;
  if (!outside || snapshot.tick != state.now.tick || !state.model->isLive(Effect::kCutMemory)) return;
  state.engine.state().cuts = snapshot.cuts;
  state.engine.state().insertions = snapshot.insertions;
  state.cuts_unknown = false;
}

void GestureReplica::takePath(const PathSnapshot& snapshot) {
  if (state_->model->body_spec) state_->paths.take(snapshot);
}

void GestureReplica::takePaths(ByteView list) {
  if (state_->model->body_spec) state_->paths.take(list);
}

const Moment& GestureReplica::feed(const GestureSample& sample) {
  State& state = *state_;
  if (state.fed > 0 && sample.tick <= state.now.tick) {
    GivenPaths paths = std::move(state.paths);  // of this sample
    restart();
    state.paths = std::move(paths);
    state.paths.restart();
  }
  if (state.fed == 0 && static_cast<double>(sample.tick) > kBeginning_s * state.loop_rate_hz)
    state.forgetCuts();
  ++state.fed;
  copySample(sample, state.loop_rate_hz, state.now);
  state.differs = false;
  if (canBeStepped(sample)) {
    state.stepAlong(sample);
    state.compareWith(sample);
  }
  state.updateMoment();
  return state.now;
}

const Moment& GestureReplica::feed(std::span<const GestureSample> samples) {
  for (const GestureSample& sample : samples) feed(sample);
  return state_->now;
}

void GestureReplica::State::forgetCuts() {
  cuts_unknown = model->isLive(Effect::kCutMemory);
}

void GestureReplica::State::stepAlong(const GestureSample& sample) {
  const StoredTick stored = storedTickOf(sample);
  if (model->body_spec) paths.giveFor(sample.tick, stored, engine);
  differs = engine.stepAsStored({now.p_WT_m, now.q_WT}, stored, report).isReal();
}

// The recording decides whether the needle is inserted; the replica follows.
void GestureReplica::State::compareWith(const GestureSample& sample) {
  const bool recorded_inside = sample.layer >= 0;
  if (!recorded_inside && report.depth_m <= 0) lost = guessed = false;
  if (recorded_inside == engine.state().inside) {
    disagreements = 0;
    guessed = false;
    return;
  }
  if (++disagreements <= kPatience_ticks) return;
  lost = true;
  forgetCuts();
  if (!recorded_inside) {
    // The engine started in a different state, e.g. inside the tissue: no force until the tip was outside.
    engine.restart();
  } else if (!guessed) {
    guessed = true;
    guessed_u_W = normalized(zAxis(now.q_WT));
    guessed_entry_W_m = now.p_WT_m - guessed_u_W * now.insertion_m;
  }
}

void GestureReplica::State::updateMoment() {
  now.depth_m = report.depth_m;
  const SimState& sim = engine.state();
  const PathLayers* const path = engine.path();
  const bool held = sim.inside && isHeldBack(dot(sim.u_W, now.p_WT_m - sim.p_entry_W_m), report.insertion_m);
  if (engine.pathsUsed() != paths_used && !held)
    now.path = path != nullptr ? std::make_shared<const PathLayers>(engine.pathInUse()) : nullptr;
  paths_used = held ? 0 : engine.pathsUsed();
  now.inside = sim.inside || guessed;
  const bool path_unknown = model->body_spec && paths.unknown();
  now.approximate = differs || (now.inside && (lost || reduced_rate || cuts_unknown || path_unknown));
  now.alpha_rad = orientationLimitAngle(model->needle_length_m, now.inside ? now.insertion_m : 0);
  now.tilt_rad = 0;
  now.clamping_W = {};
  // during a FAULT the engine does not step, and the force is zero
  const bool forces = (sim.inside || engine.isCapped()) && now.fault == 0 && !now.approximate;
  now.terms = forces ? termsOf(report) : std::array<double, kEffectCount>{};
  if (!now.inside) return;
  now.p_entry_W_m = sim.inside ? sim.p_entry_W_m : guessed_entry_W_m;
  now.u_W = sim.inside ? sim.u_W : guessed_u_W;
  const Vec3 axis_W = zAxis(now.q_WT);
  now.tilt_rad = std::atan2(norm(cross(axis_W, now.u_W)), dot(axis_W, now.u_W));
  if (now.term(Effect::kClamping) > 0) now.clamping_W = clampingDirection(engine.model(), engine.state());
}

const Moment& GestureReplica::now() const {
  return state_->now;
}
const StepReport& GestureReplica::report() const {
  return state_->report;
}
std::uint64_t GestureReplica::fed() const {
  return state_->fed;
}
const SceneModel& GestureReplica::model() const {
  return *state_->model;
}

std::optional<NeedleLine> lineOf(const Moment& moment) {
  constexpr double kRightAtTip_m = 1e-3;  // below it the tip says nothing of the slant
  if (isCapped(moment) || (!moment.inside && !moment.path)) return std::nullopt;
  NeedleLine line{moment.p_entry_W_m, moment.u_W, 1, moment.path};
  if (!moment.inside) line = {moment.path->point_W_m, normalized(zAxis(moment.q_WT)), 1, moment.path};
  if (line.path) line.slant = slantOf(line.path->normal_W, line.u_W);
  if (line.path && moment.inside && moment.insertion_m > kRightAtTip_m)
    line.slant = std::max(kMinSlant, moment.depth_m / moment.insertion_m);
  return line;
}

std::vector<Moment> momentsOf(std::shared_ptr<const SceneModel> model, std::span<const GestureSample> samples,
                              std::size_t keep_every) {
  GestureReplica replica(std::move(model));
  std::vector<Moment> moments;
  keep_every = keep_every == 0 ? 1 : keep_every;
  moments.reserve(samples.size() / keep_every + 1);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Moment& now = replica.feed(samples[i]);
    if (i % keep_every == 0 || i + 1 == samples.size()) moments.push_back(now);
  }
  return moments;
}

double forceOf(const Moment& moment) {
  return norm(moment.force_W_N);
}

std::array<double, kEffectCount> termsOf(const StepReport& report) {
  std::array<double, kEffectCount> terms{};
  for (const EffectEntry* effect : effectsAsShown())
    terms[static_cast<std::size_t>(effect->effect)] = effect->value(report);
  return terms;
}

double termOf(const EffectEntry& effect, const Moment& moment) {
  return effect.unit == "N" ? moment.term(effect.effect) : norm(moment.torque_W_Nm);
}

Moment momentOfSample(const GestureSample& sample, double loop_rate_hz) {
  Moment moment;
  copySample(sample, loop_rate_hz, moment);
  moment.depth_m = sample.insertion_m;
  moment.approximate = true;
  return moment;
}

}  // namespace needlelab
