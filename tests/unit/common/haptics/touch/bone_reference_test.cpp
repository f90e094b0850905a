// BONE's contact, proxy, force and its restraint of the tissue, compared with the literal transcription
// (tests/support/reference/reference_bone.h) at every tick; every fault planted in the transcription is
// found. The reference is given what the tissue remembers: its walls and its line have their own tests.
#include <algorithm>
#include <array>
#include <memory>
#include <sstream>

#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/support/reference/reference_bone.h"
#include "tests/unit/common/haptics/runs.h"

namespace needlelab::test {
namespace {

constexpr std::size_t kBoneReported = stageOf(Effect::kBone);
/// On a round bone without friction the proxy slides below the tip, until rounding hides whether a move
/// shortens |q − p|: |q − p| is exact there, but q only to the root of the rounding.
constexpr double kPlaceTolerance_m = 1e-8;
/// Up to eight slips per tick amplify rounding near a capsule's axis.
constexpr double kForceTolerance_N = 1e-8;

struct BoneSession {
  SceneSpec scene;
  double rate_hz = 1000;
  Motion motion;
};

double boneTop_m(const SceneSpec& scene) {
  double top_m = 0;
  for (const LayerSpec& layer : scene.layers) {
    if (layer.is_bone) break;
    top_m += layer.thickness_m;
  }
  return top_m;
}

BoneSession boneSession(std::uint64_t seed, LimbKind limb) {
  static constexpr std::array<double, 4> kRates_hz = {1000, 1000, 250, 333};
  Random random(seed);
  BoneSession made;
  SceneSpec& scene = made.scene = withClamping(withLimb(allEffects(), limb), ClampingMode::kConservative);
  scene.effects = static_cast<EffectMask>(random.below(kPlacedEffects + 1)) | bitOf(Effect::kBone);
  scene.layers[2 + random.below(4)].is_bone = true;
  scene.layers.back().is_bone = true;
  scene.max_force_N = 50;
  scene.stage_numbers[kBoneReported][kBoneStiffness_N_per_m] = random.in(200, 2000);
  scene.stage_numbers[kBoneReported][1] = random.chance(0.2) ? 0.0 : random.in(0, 1);
  Site site = siteOf(limb);
  GestureRange range;
  range.aside_m = 0.02;
  range.least_leg_s = 0.02;
  range.most_leg_s = 0.4;
  range.legs = 20;
  range.most_hold_s = 0.2;
  // a third stays near an edge: where the bone meets the skin, or the centre of a round bone
  const bool near_edge = seed % 3 == 0;
  if (std::holds_alternative<PlaneLimb>(scene.limb) && (near_edge || random.chance(0.5))) {
    const double a = random.in(-1, 1), b = random.in(0.1, 1);
    const double tangent = random.in(near_edge ? 0.5 : 0.0, 1.2);
    const Vec3 aside = normalized(site.across_1 * a + site.across_2 * b);
    scene.bone_normal = tilted(-site.inward, tangent, aside);
    // the bone rises against the sideways part of its normal
    if (near_edge) site.p_surface_m = site.p_surface_m - aside * (boneTop_m(scene) / tangent);
  }
  if (near_edge) {
    range.above_m = 0.002;
    range.below_m = std::holds_alternative<PlaneLimb>(scene.limb) ? 0.006 : 0.1;
    range.aside_m = 0.006;
    range.legs = 40;
    range.tremor_m = 0.0003;
  }
  made.rate_hz = kRates_hz[random.below(kRates_hz.size())];
  made.motion = randomGesture(random.bits(), made.rate_hz, site, range);
  return made;
}

struct BoneAgreement {
  std::string difference;  // at the first tick that differs
  int touching = 0, begins = 0, slips = 0, held = 0;
  int skin = 0, back = 0, cut = 0, stayed = 0, lowered = 0, lowered_friction = 0;  // what the reference did
};

// The tissue's values after a tick, in a state that felt the tip at p − u·h, before BONE lowers them.
BonePushes pushesOf(const SceneModel& model, const SimState& felt, Vec3 p_felt_W_m, double shift_before_m) {
  BonePushes pushes;
  pushes.x_m = dot(felt.u_W, p_felt_W_m - felt.p_entry_W_m);
  pushes.turned_m = felt.x_shift_m - shift_before_m;
  pushes.wall_m = felt.wall_m;
  pushes.wall_N_per_m = model.layers[felt.layer].wall_stiffness_N_per_m;
  pushes.friction_wall_m = felt.friction_wall_m;
  pushes.friction_N_per_m = model.friction_stiffness_N_per_m;
  for (std::uint32_t i = 0; i < felt.membranes_met; ++i)
    if ((felt.membranes_ruptured >> i & 1u) == 0)
      pushes.membranes.push_back(
          {felt.membrane_place_m[i], model.membranes[i].k1_N_per_m, model.membranes[i].k2_N_per_m2});
  return pushes;
}

// Engine and reference over one session, tick by tick.
class BoneComparison {
 public:
  BoneComparison(const BoneSession& one, BoneDefect planted)
      : one_(one),
        engine_(one.scene, one.rate_hz),
        reference_(one.scene, one.rate_hz, planted),
        felt_(std::make_unique<SimState>()) {}

  BoneAgreement run() {
    for (tick_ = 0; tick_ < one_.motion.size() && all_.difference.empty(); ++tick_) step(one_.motion[tick_]);
    return all_;
  }

 private:
  void step(const TipSample& sample) {
    const SimState& state = engine_.state();
    const BoneContact before = state.bone;
    const bool inside = state.inside;
    std::optional<BoneTissue> tissue;
    const double rubs_m = engine_.model().isLive(Effect::kShaftFriction) ? state.friction_wall_m : -HUGE_VAL;
    if (inside) tissue = BoneTissue{false, state.p_entry_W_m, state.u_W, state.wall_m, rubs_m};
    ReferenceBone::Stand stand;
    if (inside) stand = reference_.step(sample.p_WT_m, tissue);
    if (stand.held_m > 0) *felt_ = state;
    const StepReport report = engine_.step(sample);
    if ((report.flags & kFlagEntry) != 0) tissue = BoneTissue{true, state.p_entry_W_m, {}, 0, 0};
    if (!inside) stand = reference_.step(sample.p_WT_m, tissue);
    count(before, stand);
    if (before.touching && engine_.state().bone.touching) expectWithinRoom(before, sample);
    compare(report, stand);
    if (stand.held_m > 0) comparePushes(sample, report);
  }

  // "the stretch changes by no more than M in a tick", on a round surface by a tenth more
  void expectWithinRoom(const BoneContact& before, const TipSample& sample) const {
    const double friction = one_.scene.stage_numbers[stageOf(Effect::kBone)][kBoneFriction];
    const double way_m = norm(sample.p_WT_m - (before.p_proxy_W_m - before.stretch_W_m));
    const double room_m = std::sqrt(2 + friction * friction) * way_m + 0.02 / one_.rate_hz;
    EXPECT_LE(norm(engine_.state().bone.stretch_W_m - before.stretch_W_m), 1.1 * room_m + 1e-9) << tick_;
  }

  void count(const BoneContact& before, const ReferenceBone::Stand& stand) {
    all_.skin += stand.skin;
    all_.back += stand.back;
    all_.cut += stand.cut;
    all_.stayed += stand.stayed;
    const BoneContact& bone = engine_.state().bone;
    if (!bone.touching) return;
    ++all_.touching;
    if (!before.touching) ++all_.begins;
    if (before.touching && norm(before.p_proxy_W_m - bone.p_proxy_W_m) > 1e-6) ++all_.slips;
    if (bone.held_m > 1e-6) ++all_.held;
  }

  void compare(const StepReport& report, const ReferenceBone::Stand& stand) {
    const BoneContact& bone = engine_.state().bone;
    expect("touching", bone.touching, stand.touching, 0);
    expect("force", report.stage_N[kBoneReported], norm(stand.force_W_N), kForceTolerance_N);
    expect("depth that the tissue feels", report.depth_m, stand.felt_depth_m, kPlaceTolerance_m);
    const auto bones = static_cast<std::int32_t>(engine_.model().bone_layer);
    expect("layer of bone", report.layer >= bones, stand.touching, 0);
    if (!stand.touching) return;
    expect("distance of the proxies", norm(bone.p_proxy_W_m - stand.p_proxy_W_m), 0, kPlaceTolerance_m);
    expect("h", bone.held_m, stand.held_m, kPlaceTolerance_m);
  }

  // The same tick without BONE, at the place that the engine's tissue felt: q is known only to the root of
  // the rounding, and forces are steep.
  void comparePushes(const TipSample& sample, const StepReport& report) {
    const SimState& state = engine_.state();
    const double shift_before_m = felt_->x_shift_m;
    TipSample at = sample;
    at.p_WT_m = sample.p_WT_m - felt_->u_W * state.bone.held_m;
    felt_->bone.held_m = state.bone.held_m;  // a turn knows it
    StepReport placed;
    engine_.model().placed_step(engine_.model(), at, *felt_, placed);
    BonePushes free = pushesOf(engine_.model(), *felt_, at.p_WT_m, shift_before_m);
    free.ruptured = (placed.flags & kFlagRupture) != 0;
    const BonePushes pushes = reference_.onlyFall(free);
    if (pushes.wall_m > free.wall_m + 1e-6) ++all_.lowered;
    if (pushes.friction_wall_m > free.friction_wall_m + 1e-6) ++all_.lowered_friction;
    expect("membranes", -report.puncture_N, pushes.puncture_N, kForceTolerance_N);
    expect("cutting", -report.cutting_N, pushes.cutting_N, kForceTolerance_N);
    expect("friction", std::max(0.0, -report.friction_N), pushes.friction_N, kForceTolerance_N);
    expect("w", state.wall_m, pushes.wall_m, kPlaceTolerance_m);
    expect("w_f", state.friction_wall_m, pushes.friction_wall_m, kPlaceTolerance_m);
  }

  void expect(const char* what, double engine_has, double reference_has, double tolerance) {
    if (std::abs(engine_has - reference_has) <= tolerance || !all_.difference.empty()) return;
    std::ostringstream text;
    text << "tick " << tick_ << ", " << what << ": engine " << engine_has << ", off by "
         << engine_has - reference_has;
    all_.difference = text.str();
  }

  const BoneSession& one_;
  EngineRun engine_;
  ReferenceBone reference_;
  std::unique_ptr<SimState> felt_;
  std::size_t tick_ = 0;
  BoneAgreement all_;
};

BoneAgreement compareBone(const BoneSession& one, BoneDefect planted = BoneDefect::kNone) {
  return BoneComparison(one, planted).run();
}

struct BonePerLimb : ::testing::TestWithParam<LimbKind> {};

TEST_P(BonePerLimb, matchesTheReferenceOverRandomGestures) {
  const std::uint64_t sessions = longForm() ? 1000 : 60;
  int touching = 0, begins = 0, slips = 0, held = 0, failures = 0;
  int skin = 0, back = 0, cut = 0, stayed = 0, lowered = 0, lowered_friction = 0;
  for (std::uint64_t i = 0; i < sessions && failures < 3; ++i) {
    const BoneAgreement all = compareBone(boneSession(i + 50, GetParam()));
    EXPECT_EQ(all.difference, "") << "session " << i;
    if (!all.difference.empty()) ++failures;
    touching += all.touching;
    begins += all.begins;
    slips += all.slips;
    held += all.held;
    skin += all.skin;
    back += all.back;
    cut += all.cut;
    stayed += all.stayed;
    lowered += all.lowered;
    lowered_friction += all.lowered_friction;
  }
  EXPECT_GT(touching, 20'000);
  EXPECT_GT(begins, 100);
  EXPECT_GT(slips, 10'000);
  EXPECT_GT(held, 10'000);
  EXPECT_GT(skin, 1'000);
  EXPECT_GT(cut, 800);
  EXPECT_GT(stayed, 100);
  if (GetParam() == LimbKind::kCapsule) {
    EXPECT_GT(back, 50);
  }
  EXPECT_GT(lowered, 5'000);
  EXPECT_GT(lowered_friction, 5'000);
}

INSTANTIATE_TEST_SUITE_P(Limbs, BonePerLimb, ::testing::ValuesIn(kLimbKinds), [](const auto& chosen) {
  std::string name(limbName(chosen.param));
  std::erase(name, ' ');
  return name;
});

// control
TEST(BoneReference, everyPlantedFaultIsFound) {
  for (const BoneDefect planted :
       {BoneDefect::kSticks, BoneDefect::kSlipsToFoot, BoneDefect::kBeginsAtTip, BoneDefect::kOneSlip,
        BoneDefect::kTipInBone, BoneDefect::kNoRoom, BoneDefect::kNarrowRoom, BoneDefect::kSkinForgotten,
        BoneDefect::kSkinAtBegin, BoneDefect::kStaysOut, BoneDefect::kEndsAtOnce, BoneDefect::kNotHeldToSkin,
        BoneDefect::kMembranesGrow, BoneDefect::kCuttingGrows, BoneDefect::kFrictionGrows}) {
    int found = 0;
    for (std::uint64_t i = 0; i < 40 && found < 2; ++i)
      if (!compareBone(boneSession(i + 50, kLimbKinds[i % kLimbKinds.size()]), planted).difference.empty())
        ++found;
    EXPECT_EQ(found, 2) << "planted fault " << static_cast<int>(planted);
  }
}

}  // namespace
}  // namespace needlelab::test
