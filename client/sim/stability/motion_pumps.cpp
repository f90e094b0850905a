/// Prescribed motion aside and in tilt: cycles that a fixture or a tilt limit without memory pays for, and
/// turns of the trajectory.
#include <algorithm>
#include <array>
#include <cstdio>

#include "client/sim/stability/motion_cases.h"
#include "client/sim/stability/motion_run.h"

namespace needlelab {
namespace {

// the case's motion in its scene
struct Prescribed {
  SceneSpec scene;
  PassivityGesture motion;
  double limit = 0;
};

Result<Prescribed> prescribed(const CaseSettings& settings, std::string_view name, AxialModel model) {
  CaseEntry entry(settings.file, name, settings.long_form);
  Prescribed out;
  out.scene = entry.scene(model);
  out.limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  auto motion = motionOf(settings, name);
  if (!motion.ok()) return motion.error();
  out.motion = *std::move(motion);
  return out;
}

std::string millijoules(double energy_J) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g mJ", energy_J * 1e3);
  return text.data();
}

}  // namespace

Result<CaseOutcome> clampPump(const CaseSettings& settings, AxialModel model,
                              const ForceSourceFactory& source) {
  auto given = prescribed(settings, "clamp_pump", model);
  if (!given.ok()) return given.error();
  const auto samples = samplesOf(given->motion);
  CaseOutcome outcome;
  std::array<double, 2> net_J{};  // of the scene's own mode, and of the other
  for (const ClampingMode mode : {ClampingMode::kProportional, ClampingMode::kPassive}) {
    const bool own = mode == given->scene.virtual_fixture.mode;
    SceneSpec scene = given->scene;
    scene.virtual_fixture.mode = mode;
    const auto run = runMotion(source, scene, samples, given->motion.rate_hz);
    if (!run.ok()) return run.error();
    const PassivityRecord record = observed(*run);
    net_J[own ? 0 : 1] = record.net_J;
    outcome.traces.push_back(forceTrace(*run, mode == ClampingMode::kPassive ? "PASSIVE" : "PROPORTIONAL"));
    if (own) outcome.row = rowOf(record);
  }
  outcome.row.energy_J = net_J[0];
  judgeMotion(outcome.row, "net energy given in a cycle aside, in, back, out [J]", net_J[0], given->limit);
  if (given->scene.virtual_fixture.mode == ClampingMode::kPassive)
    outcome.row.note = "PROPORTIONAL gives " + millijoules(net_J[1]);
  return outcome;
}

Result<CaseOutcome> tiltPump(const CaseSettings& settings, AxialModel model,
                             const ForceSourceFactory& source) {
  auto given = prescribed(settings, "tilt_pump", model);
  if (!given.ok()) return given.error();
  const auto run = runMotion(source, given->scene, samplesOf(given->motion), given->motion.rate_hz);
  if (!run.ok()) return run.error();
  const PassivityRecord record = observed(*run);
  CaseOutcome outcome{rowOf(record), {}};
  outcome.row.energy_J = record.net_J;
  judgeMotion(outcome.row, "net energy given in a cycle tilt, in, upright, out [J]", record.net_J,
              given->limit);
  return outcome;
}

Result<CaseOutcome> turnWide(const CaseSettings& settings, AxialModel model,
                             const ForceSourceFactory& source) {
  auto given = prescribed(settings, "turn_wide", model);
  if (!given.ok()) return given.error();
  CaseOutcome outcome;
  PassivityRecord worst;
  for (const ClampingMode mode : {ClampingMode::kProportional, ClampingMode::kPassive}) {
    given->scene.virtual_fixture.mode = mode;
    const auto run = runMotion(source, given->scene, samplesOf(given->motion), given->motion.rate_hz);
    if (!run.ok()) return run.error();
    const PassivityRecord record = observed(*run, false);
    worst.finite = worst.finite && record.finite && (record.flags & kFlagTurn);
    worst.max_force_N = std::max(worst.max_force_N, record.max_force_N);
    worst.worst_step_N = std::max(worst.worst_step_N, record.worst_step_N);
    worst.worst_running_J = std::max(worst.worst_running_J, record.worst_running_J);
    outcome.traces.push_back(forceTrace(*run, mode == ClampingMode::kPassive ? "PASSIVE" : "PROPORTIONAL"));
  }
  outcome.row = rowOf(worst);
  judgeMotion(outcome.row, "greatest force step beyond ΣK·|Δp| [N]", worst.worst_step_N, given->limit);
  return outcome;
}

Result<CaseOutcome> grazing85(const CaseSettings& settings, AxialModel model,
                              const ForceSourceFactory& source) {
  auto given = prescribed(settings, "grazing_85deg", model);
  if (!given.ok()) return given.error();
  const auto run = runMotion(source, given->scene, samplesOf(given->motion), given->motion.rate_hz);
  if (!run.ok()) return run.error();
  const PassivityRecord record = observed(*run);
  // entries and exits are what this is about
  double step = 0;
  for (std::size_t k = 1; k < run->ticks.size(); ++k)
    step = std::max(
        step, norm(run->ticks[k].report.wrench_W.torque_Nm - run->ticks[k - 1].report.wrench_W.torque_Nm));
  CaseOutcome outcome{rowOf(record), {}};
  judgeMotion(outcome.row, "greatest torque step [N·m]", step, given->limit);
  outcome.row.note = std::to_string(record.insertions) + " entries";
  return outcome;
}

}  // namespace needlelab
