#include "client/sim/stability/loop/plant.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "client/sim/stability/loop/stiffness_theory.h"
#include "common/base/range.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/geometry.h"

namespace needlelab {
namespace {

class EngineSource final : public ForceSource {
 public:
  explicit EngineSource(SceneModel model) : model_(std::move(model)) {}
  void step(const TipSample& tip, StepReport& report) noexcept override { engine_.step(tip, report); }
  [[nodiscard]] double axialStiffness_N_per_m() const noexcept override {
    return model_.axialStiffness_N_per_m();
  }
  [[nodiscard]] double held_J(const StepReport& report) const noexcept override {
    return heldEnergy_J(engine_.model(), engine_.state(), report);
  }
  [[nodiscard]] double slant() const noexcept override {
    return engine_.state().inside ? engine_.state().slant : 1;
  }
  [[nodiscard]] Vec3 trajectory() const noexcept override {
    return engine_.state().inside ? engine_.state().u_W : Vec3{};
  }

 private:
  SceneModel model_;
  SceneEngine engine_{model_};
};

// A mesh takes a second, so scenes with the same mesh inputs share their compliance.
class MeshCache {
 public:
  Status complete(SceneSpec& scene) {
    if (scene.axial_model != AxialModel::kFem || scene.fem.compliance) return {};
    std::vector<double> key = {scene.needle_length_m, static_cast<double>(scene.fem.nodes)};
    for (const LayerSpec& layer : scene.layers) key.push_back(layer.thickness_m);
    for (const FemLayerSpec& layer : scene.fem.layers) {
      key.push_back(layer.young_Pa);
      key.push_back(layer.poisson);
    }
    auto& known = known_[key];
    if (!known) {
      RETURN_IF_ERROR(addCompliance(scene));
      known = scene.fem.compliance;
    }
    scene.fem.compliance = known;
    return {};
  }

 private:
  std::map<std::vector<double>, std::shared_ptr<const NeedleCompliance>> known_;
};

}  // namespace

ForceSourceFactory engineSource() {
  auto meshes = std::make_shared<MeshCache>();
  return [meshes](const SceneSpec& given, double rate_hz) -> Result<std::unique_ptr<ForceSource>> {
    SceneSpec scene = given;
    RETURN_IF_ERROR(meshes->complete(scene));
    ASSIGN_OR_RETURN(auto model, compile(scene, rate_hz));
    return std::unique_ptr<ForceSource>(std::make_unique<EngineSource>(std::move(model)));
  };
}

namespace {

// Runs the device on its own fine steps, so that ticks can be late and delays are handled outside the device.
class FinePlant {
 public:
  FinePlant(const PlantOptions& options, const HandPlan& plan)
      : rate_hz_(options.rate_hz),
        steps_per_tick_(std::max<std::int64_t>(
            1, static_cast<std::int64_t>(options.device.integration_hz / options.rate_hz + 0.5))),
        delay_steps_(static_cast<std::int64_t>(options.device.delay_ticks) * steps_per_tick_),
        device_(fine(options.device, fineHz()), plan) {}

  [[nodiscard]] double fineHz() const { return rate_hz_ * static_cast<double>(steps_per_tick_); }
  [[nodiscard]] std::int64_t stepsPerTick() const { return steps_per_tick_; }
  [[nodiscard]] std::int64_t now() const { return now_; }
  [[nodiscard]] double energy_J() const { return device_.forceWork_J(); }
  [[nodiscard]] double turnEnergy_J() const { return device_.torqueWork_J(); }
  [[nodiscard]] const SimulatedDevice& device() const { return device_; }

  Status open() { return device_.open(fineHz()); }

  // Advances to `step`, applying the wrenches that fall due on the way. Returns false when the plan is over.
  bool advanceTo(std::int64_t step, DeviceReading& reading) {
    if (step == now_) return device_.read(reading) == DeviceRead::kFresh;
    while (now_ < step) {
      while (!pending_.empty() && pending_.front().due <= now_) {
        acting_ = pending_.front().wrench;
        pending_.pop_front();
      }
      const std::int64_t until = pending_.empty() ? step : std::min(step, pending_.front().due);
      device_.write(acting_);
      device_.skip(static_cast<std::uint64_t>(until - now_ - 1));
      if (device_.read(reading) != DeviceRead::kFresh) return false;
      now_ = until;
    }
    return true;
  }

  void command(const GuardedWrench& wrench, std::uint32_t more_ticks) {
    std::int64_t due = now_ + delay_steps_ + static_cast<std::int64_t>(more_ticks) * steps_per_tick_;
    if (!pending_.empty()) due = std::max(due, pending_.back().due);
    pending_.push_back({due, wrench});
  }

 private:
  static SimulatedDeviceOptions fine(SimulatedDeviceOptions options, double fine_hz) {
    options.delay_ticks = 0;
    options.integration_hz = fine_hz;
    return options;
  }
  struct Pending {
    std::int64_t due = 0;
    GuardedWrench wrench;
  };
  double rate_hz_;
  std::int64_t steps_per_tick_, delay_steps_;
  SimulatedDevice device_;
  std::int64_t now_ = 0;
  GuardedWrench acting_;
  std::deque<Pending> pending_;
};

Status checked(const PlantOptions& options) {
  struct Limit {
    const char* name;
    double value;
    NumberRange range;
  };
  for (const auto& [name, value, range] :
       {Limit{"rate in Hz", options.rate_hz, {kMinRateHz, kMaxRateHz}},
        Limit{"share of jitter", options.jitter_share, {0, 1, false, true}},
        Limit{"share of missing ticks", options.missing_share, {0, 1, false, true}},
        Limit{"delay in ticks",
              static_cast<double>(options.device.delay_ticks),
              {0, static_cast<double>(SimulatedDevice::kMaxDelayTicks)}}})
    if (!range.contains(value)) return outOfRange(name, value, range);
  return {};
}

// Fills in PlantTick::grip_J and its maximum.
void addGripEnergies(PlantRun& run, const SimulatedDeviceOptions& device) {
  double lost_J = 0;
  const PlantTick* before = nullptr;
  const auto lostPerSecond_W = [&](const PlantTick& tick) {
    return device.limits.damping_Ns_per_m * normSquared(tick.v_W_mps) +
           device.dry_friction_N * norm(tick.v_W_mps) +
           device.rotational_damping_Nms_per_rad * normSquared(tick.w_W_radps);
  };
  for (PlantTick& tick : run.ticks) {
    if (before != nullptr)
      lost_J += 0.5 * (lostPerSecond_W(*before) + lostPerSecond_W(tick)) * (tick.time_s - before->time_s);
    const double kinetic_J = 0.5 * device.limits.apparent_mass_kg * normSquared(tick.v_W_mps) +
                             0.5 * device.inertia_kgm2 * normSquared(tick.w_W_radps);
    tick.grip_J = tick.energy_J + tick.turn_energy_J - lost_J - kinetic_J;
    run.grip_energy_J = std::max(run.grip_energy_J, tick.grip_J);
    before = &tick;
  }
}

}  // namespace

Result<PlantRun> runPlant(ForceSource& source, const HandPlan& plan, const PlantOptions& options) {
  RETURN_IF_ERROR(checked(options));
  FinePlant plant(options, plan);
  RETURN_IF_ERROR(plant.open());

  HandRandom random(options.seed);
  ForceGate gate(options.device.limits, options.rate_hz);
  std::optional<PassivityControl> passivity;
  if (options.passivity) passivity.emplace(*options.passivity, options.rate_hz);
  const Pose& X_HT = options.device.X_HT;
  PlantRun run{options.rate_hz, source.axialStiffness_N_per_m(), {}, Fault::kNone, {}, 0};
  run.ticks.reserve(static_cast<std::size_t>(plan.duration_s() * options.rate_hz) + 2);
  StepReport report;
  DeviceReading reading;
  const auto steps = static_cast<double>(plant.stepsPerTick());
  for (std::int64_t k = 0;; ++k) {
    const double late = options.jitter_share > 0 && k > 0 ? random.uniform() * options.jitter_share : 0;
    const bool missing = options.missing_share > 0 && random.uniform() < options.missing_share;
    if (!plant.advanceTo(k * plant.stepsPerTick() + static_cast<std::int64_t>(late * steps), reading)) break;

    PlantTick& tick = run.ticks.emplace_back();
    tick.time_s = static_cast<double>(plant.now()) / plant.fineHz();
    const Pose X_WT = tipFromHandle(reading.X_WH, X_HT);
    tick.seen = {X_WT.p, normalized(X_WT.q)};
    Wrench wanted;
    tick.stepped = gate.admit(tick.seen, !missing, reading.speed_mps);
    if (tick.stepped) {
      source.step(tick.seen, report);
      wanted = wrenchAtHandle(report.wrench_W, tick.seen.p_WT_m, reading.X_WH.p);
    }
    gate.noteOutside(report.depth_m <= 0);
    if (passivity) wanted = passivity->limited(reading.X_WH, tick.stepped, wanted, source.held_J(report));
    const GuardedWrench guarded = gate.guard(wanted);
    if (passivity) passivity->rendered(guarded.wrench());
    plant.command(guarded, options.delay_spread_ticks > 0
                               ? static_cast<std::uint32_t>(random.next() % (options.delay_spread_ticks + 1))
                               : 0);

    const HandleState& handle = plant.device().handle();
    tick.p_W_m = tipFromHandle(handle.X_WH, X_HT).p;
    tick.v_W_mps = handle.v_W_mps;
    tick.w_W_radps = handle.w_W_radps;
    tick.report = report;
    tick.slant = source.slant();
    tick.rendered_force_N = guarded.wrench().force_N;
    tick.gate_flags = gate.flags();
    if (passivity) tick.passivity_share = passivity->state().share;
    tick.energy_J = plant.energy_J();
    tick.turn_energy_J = plant.turnEnergy_J();
    if (run.fault == Fault::kNone) run.fault = gate.fault();
  }
  run.margins = marginsOf(run, options);
  addGripEnergies(run, options.device);
  return run;
}

PassivitySettings passivityOf(const PlantOptions& options) {
  PassivitySettings settings;
  settings.delay_ticks = options.device.delay_ticks + options.delay_spread_ticks;
  settings.lag_s = options.device.lag_s;
  settings.damping_Ns_per_m = options.device.limits.damping_Ns_per_m;
  settings.rotational_damping_Nms_per_rad = options.device.rotational_damping_Nms_per_rad;
  return settings;
}

double greatestDistortion_N(const PlantRun& run) {
  double max_N = 0;
  for (const PlantTick& tick : run.ticks)
    max_N = std::max(max_N, (1 - tick.passivity_share) * norm(tick.report.wrench_W.force_N));
  return max_N;
}

LoopMargins marginsOf(const PlantRun& run, const PlantOptions& options) {
  const SimulatedDeviceOptions& device = options.device;
  double clamping_N_per_m = 0;
  for (const PlantTick& tick : run.ticks)
    clamping_N_per_m = std::max(clamping_N_per_m, tick.report.clamping_stiffness_N_per_m);
  const double delay =
      static_cast<double>(device.delay_ticks + options.delay_spread_ticks) + device.lag_s * options.rate_hz;
  const auto over = [&](double damping_Ns_per_m, double stiffness_N_per_m) {
    if (!(stiffness_N_per_m > 0)) return std::numeric_limits<double>::infinity();
    return passiveStiffnessLimit(damping_Ns_per_m, 1 / options.rate_hz, delay) / stiffness_N_per_m;
  };
  const auto margin = [&](double hand_Ns_per_m, double hand_Nms_per_rad) {
    const double along = device.limits.damping_Ns_per_m + hand_Ns_per_m;
    const double across =
        dampingAcross(along, device.rotational_damping_Nms_per_rad + hand_Nms_per_rad, norm(device.X_HT.p));
    return std::min(over(along, run.axial_stiffness_N_per_m), over(across, clamping_N_per_m));
  };
  const HandOptions& hand = device.hand;
  const bool lets_go = hand.release_s > 0 && !run.ticks.empty() && hand.release_s < run.ticks.back().time_s;
  LoopMargins margins;
  margins.passive = margin(0, 0);
  margins.coupled =
      lets_go ? margins.passive : margin(hand.damping_Ns_per_m, hand.rotational_damping_Nms_per_rad);
  return margins;
}

}  // namespace needlelab
