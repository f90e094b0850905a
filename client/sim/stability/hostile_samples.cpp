#include "client/sim/stability/hostile_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "client/device/hand_tremor.h"
#include "client/sim/stability/passivity_generator.h"
#include "client/sim/stability/passivity_search.h"
#include "common/haptics/force_gate.h"
#include "common/haptics/models/like_for_like.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

constexpr std::uint64_t kTicksAScene = 2000;

// about the point of the limb that touches W's origin, inward along −z
class HostileTip {
 public:
  explicit HostileTip(std::uint64_t seed) : random_(seed) {}

  TipSample next() {
    switch (random_.next() % 12) {
      case 0:
        p_ = anywhere(0.1);
        break;
      case 1:
        p_ = anywhere(1e-3);
        break;
      case 2:
        p_ = {0, 0, in(-1e-9, 1e-9)};
        break;
      case 3:
        p_ = {0, 0, in(-0.2, 0)};
        break;
      case 4:
        p_ += anywhere(1e-15);
        break;
      case 5:
        p_ += anywhere(1e-3);
        break;
      case 6:
        p_ = {0, 0, 0.01};
        break;
      default:
        p_.z += in(-1.5e-3, 1e-3);
        p_ += anywhere(2e-4);
        break;
    }
    if (chance(0.001)) p_ = anywhere(1e3);
    if (chance(0.3)) q_ = anyRotation();
    TipSample sample{p_, q_};
    if (chance(0.002)) sample.p_WT_m.x = noNumber();
    if (chance(0.002)) sample.q_WT.w = noNumber();
    return sample;
  }
  bool chance(double share) { return random_.uniform() < share; }

 private:
  double in(double low, double high) { return low + (high - low) * random_.uniform(); }
  Vec3 anywhere(double most) {
    const double x = in(-most, most), y = in(-most, most), z = in(-most, most);
    return {x, y, z};
  }
  Quat anyRotation() {
    if (chance(0.1)) return chance(0.5) ? Quat{0, 0, 0, 1} : Quat{1, 0, 0, 0};
    const double x = in(-1, 1), y = in(-1, 1), z = in(-1, 1), w = in(-1, 1);
    return normalized(Quat{x, y, z, w + 1e-3});
  }
  double noNumber() {
    return chance(0.5) ? std::numeric_limits<double>::quiet_NaN() : -std::numeric_limits<double>::infinity();
  }
  HandRandom random_;
  Vec3 p_;
  Quat q_;
};

// the source behind the gate, as in the haptic loop
class GatedSource {
 public:
  GatedSource(std::unique_ptr<ForceSource> source, const Limb& limb)
      : source_(std::move(source)), limb_(limb), gate_(DeviceLimits{}, 1000) {}
  Wrench next(const TipSample& sample, bool acknowledge) {
    Wrench wanted;
    if (gate_.admit(sample, true, 0.0)) {
      source_->step(sample, report_);
      wanted = report_.wrench_W;
    }
    gate_.noteOutside(signedDepth(limb_, sample.p_WT_m) <= 0);
    if (acknowledge) gate_.acknowledge();
    return gate_.guard(wanted).wrench();
  }

 private:
  std::unique_ptr<ForceSource> source_;
  Limb limb_;
  ForceGate gate_;
  StepReport report_;
};

}  // namespace

Result<FuzzFindings> fuzzSource(const ForceSourceFactory& make_source, AxialModel model, std::uint64_t ticks,
                                bool with_gate) {
  FuzzFindings findings;
  const double peak_N = DeviceLimits{}.peak_force_N;
  for (std::uint64_t seed = 1; findings.ticks < ticks; ++seed) {
    GestureRange range;
    range.clamping = seed % 2 == 0 ? ClampingMode::kPassive : ClampingMode::kProportional;
    const PassivityGesture gesture = randomGesture(seed, shapeOf(seed), range);
    auto scene = sceneSpecOf(gesture.profile);
    if (!scene.ok()) return scene.error();
    scene->max_force_N = seed % 3 == 0 ? 1.0 : 10.0;
    const SceneSpec rendered = likeForLike(*scene, model);
    auto source = make_source(rendered, 1000), behind = make_source(rendered, 1000);
    if (!source.ok()) return source.error();
    if (!behind.ok()) return behind.error();
    GatedSource gated(std::move(*behind), scene->limb);

    HostileTip tip(seed * 0x9E37u);
    StepReport report;
    for (std::uint64_t k = 0; k < kTicksAScene && findings.ticks < ticks; ++k, ++findings.ticks) {
      const TipSample sample = tip.next();
      (*source)->step(sample, report);
      const double force = norm(report.wrench_W.force_N);
      findings.finite = findings.finite && std::isfinite(force) && isFinite(report.wrench_W.torque_Nm);
      findings.max_force_N = std::max(findings.max_force_N, force);
      findings.excess_force_N = std::max(findings.excess_force_N, force - scene->max_force_N * (1 + 1e-12));
      if (const Vec3 u = (*source)->trajectory(); normSquared(u) > 0) {
        ++findings.inside;
        findings.direction_error = std::max(findings.direction_error, std::abs(norm(u) - 1));
      }
      if (!with_gate) continue;
      const Wrench out = gated.next(sample, tip.chance(0.05));
      findings.finite = findings.finite && isFinite(out.force_N) && isFinite(out.torque_Nm);
      findings.excess_rendered_N =
          std::max(findings.excess_rendered_N, norm(out.force_N) - peak_N * (1 + 1e-12));
    }
  }
  return findings;
}

}  // namespace needlelab
