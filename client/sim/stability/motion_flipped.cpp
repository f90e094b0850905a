/// A needle that points out of the tissue, and samples of any kind.
#include <algorithm>
#include <vector>

#include "client/sim/stability/closed_loop_case.h"
#include "client/sim/stability/device_script.h"
#include "client/sim/stability/hostile_samples.h"
#include "client/sim/stability/motion_cases.h"
#include "client/sim/stability/motion_run.h"
#include "client/sim/stability/round_number.h"
#include "common/base/range.h"

namespace needlelab {
namespace {

constexpr double kFlippedSpeed_mps = 0.02;
constexpr double kTorqueSlew_Nm = 0.1;     // a tick of 1 ms, §3.7
constexpr double kDirectionError = 1e-12;  // §10

Quat reversed(Quat q) {
  return Quat{1, 0, 0, 0} * q;
}
Quat nearlyReversed(Quat q) {
  return normalized(Quat{1, 0, 0, 0.1}) * q;
}
// the same rotation
Quat negative(Quat q) {
  return {-q.x, -q.y, -q.z, -q.w};
}
using Turn = Quat (*)(Quat);

// an insertion; the needle is turned for a while in the tissue, or all the time
std::vector<DeviceSample> insertion(Turn turn, bool always) {
  const auto change = [turn](DeviceSample& sample, std::size_t) { sample.tip.q_WT = turn(sample.tip.q_WT); };
  DeviceScript script;
  script.rest(0.3).goTo(0.015, kFlippedSpeed_mps).rest(0.1);
  always ? script.rest(0.05) : script.with(0.05, change);
  auto samples = script.rest(0.3).goTo(0.02, kFlippedSpeed_mps).goTo(-0.005, kFlippedSpeed_mps).samples();
  for (std::size_t k = 0; always && k < samples.size(); ++k) change(samples[k], k);
  return samples;
}

// The trajectory is fixed at entry, along the normal for a needle that points out: how the needle stands
// changes no force. Torque comes slowly.
double departure(const std::vector<GatedTick>& turned, const std::vector<GatedTick>& upright) {
  double worst = 0;
  for (std::size_t k = 1; k < turned.size(); ++k) {
    worst = std::max(worst, norm(turned[k].out_W.force_N - upright[k].out_W.force_N));
    const double step = norm(turned[k].out_W.torque_Nm - turned[k - 1].out_W.torque_Nm);
    worst = std::max(worst, step - kTorqueSlew_Nm);
  }
  return worst;
}

}  // namespace

Result<CaseOutcome> flippedAxis(const CaseSettings& settings, AxialModel model,
                                const ForceSourceFactory& source, Gate gate) {
  CaseEntry entry(settings.file, "flipped_axis", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const double limit = entry.number("limit", 0);
  // with FEM each random scene is a mesh of its own
  const std::uint64_t fuzzed =
      entry.whole(model == AxialModel::kFem ? "fuzzed_ticks_fem" : "fuzzed_ticks", 1000);
  if (!entry.status().ok()) return entry.status().error();

  CaseOutcome outcome;
  CaseRow& row = outcome.row;
  row.finite = true;
  const bool with_gate = gate == Gate::kPresent;
  const auto run = [&](const std::vector<DeviceSample>& samples) {
    return runGated(source, scene, samples, DeviceScript::kRate_hz, with_gate);
  };
  double worst = 0;
  const auto upright = run(insertion([](Quat q) { return q; }, true));
  if (!upright.ok()) return upright.error();
  for (const Turn turn : {&reversed, &nearlyReversed, &negative})
    for (const bool always : {false, true}) {
      const auto turned = run(insertion(turn, always));
      if (!turned.ok()) return turned.error();
      worsen(row, rowOf(*turned));
      worst = std::max(worst, departure(*turned, *upright));
    }

  const auto fuzz = fuzzSource(source, model, fuzzed, with_gate);
  if (!fuzz.ok()) return fuzz.error();
  row.finite = row.finite && fuzz->finite;
  row.max_force_N = std::max(*row.max_force_N, fuzz->max_force_N);
  worst = std::max({worst, fuzz->excess_force_N, fuzz->excess_rendered_N});
  judgeMotion(row, "greatest departure from what is allowed [N, N·m]", worst, limit);
  if (row.passed && fuzz->direction_error > kDirectionError) {
    row.passed = false;
    row.verdict = Verdict::kChatters;
  }
  row.note = std::to_string(fuzz->ticks) + " fuzzed ticks, |u| within " +
             numberText(roundedTo(fuzz->direction_error, 2)) + " of 1";
  return outcome;
}

}  // namespace needlelab
