// BONE's contact, proxy, force and the way it holds the tissue back, against the literal transcription
// (tests/support/reference_bone.h) at every tick; and each fault planted into the transcription is found. The
// reference is told what the tissue remembers: its walls and its line have their own tests.
#include <algorithm>
#include <array>
#include <iostream>
#include <sstream>

#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/support/reference_bone.h"
#include "tests/unit/common/haptics/runs.h"

namespace needlelab::test {
namespace {

constexpr std::size_t kBoneReported = stageOf(Effect::kBone);
/// On a round bone without friction the proxy goes below the tip, to where rounding no longer tells whether a
/// move shortens |q − p|: |q − p| is exact there, and q to the root of its rounding.
constexpr double kPlaceTolerance_m = 1e-8;
/// Up to eight slips a tick follow each other and enlarge rounding near a capsule's axis.
constexpr double kForceTolerance_N = 1e-8;

struct BoneSession {
  SceneSpec scene;
  double rate_hz = 1000;
  Motion motion;
};

BoneSession boneSession(std::uint64_t seed, LimbKind limb) {
  static constexpr std::array<double, 4> kRates_hz = {1000, 1000, 250, 333};
  Random random(seed);
  BoneSession made;
  SceneSpec& scene = made.scene = withClamping(withLimb(allEffects(), limb), ClampingMode::kPassive);
  scene.effects = static_cast<EffectMask>(random.below(kPlacedEffects + 1)) | bitOf(Effect::kBone);
  scene.layers[2 + random.below(4)].is_bone = true;
  scene.layers.back().is_bone = true;
  scene.max_force_N = 50;
  scene.stage_numbers[kBoneReported][kBoneStiffness_N_per_m] = random.in(200, 2000);
  scene.stage_numbers[kBoneReported][1] = random.chance(0.2) ? 0.0 : random.in(0, 1);
  const Site site = siteOf(limb);
  if (std::holds_alternative<PlaneLimb>(scene.limb) && random.chance(0.5)) {
    const double a = random.in(-1, 1), b = random.in(0.1, 1), tangent = random.in(0, 1.2);
    scene.bone_normal = tilted(-site.inward, tangent, normalized(site.across_1 * a + site.across_2 * b));
  }
  made.rate_hz = kRates_hz[random.below(kRates_hz.size())];
  GestureRange range;
  range.aside_m = 0.02;
  range.least_leg_s = 0.02;
  range.most_leg_s = 0.4;
  range.legs = 20;
  range.most_hold_s = 0.2;
  made.motion = randomGesture(random.bits(), made.rate_hz, site, range);
  return made;
}

struct BoneAgreement {
  std::string difference;  // of the first tick that differs
  int touching = 0, begins = 0, slips = 0, held = 0;
  int skin = 0, back = 0, cut = 0, stayed = 0;  // what the reference did
};

BoneAgreement compareBone(const BoneSession& one, BoneDefect planted = BoneDefect::kNone) {
  EngineRun engine(one.scene, one.rate_hz);
  ReferenceBone reference(one.scene, one.rate_hz, planted);
  BoneAgreement all;
  for (std::size_t k = 0; k < one.motion.size(); ++k) {
    std::optional<BoneTissue> tissue;
    const SimState& state = engine.state();
    if (state.inside)
      tissue = BoneTissue{false, state.p_entry_W_m, state.u_W, state.wall_m, state.friction_wall_m};
    const BoneContact before = state.bone;
    const StepReport a = engine.step(one.motion[k]);
    if ((a.flags & kFlagEntry) != 0) tissue = BoneTissue{true, state.p_entry_W_m, {}, 0, 0};
    const ReferenceBone::Stand b = reference.step(one.motion[k].p_WT_m, tissue);
    const BoneContact& bone = state.bone;
    all.skin += b.skin;
    all.back += b.back;
    all.cut += b.cut;
    all.stayed += b.stayed;
    if (bone.touching) {
      ++all.touching;
      if (!before.touching) ++all.begins;
      if (before.touching && norm(before.p_proxy_W_m - bone.p_proxy_W_m) > 1e-6) ++all.slips;
      if (bone.held_m > 1e-6) ++all.held;
    }
    const auto differ = [&](const char* what, double engine_has, double reference_has) {
      std::ostringstream text;
      text << "tick " << k << ", " << what << ": engine " << engine_has << ", off by "
           << engine_has - reference_has;
      all.difference = text.str();
      return all;
    };
    if (bone.touching != b.touching) return differ("touching", bone.touching, b.touching);
    if (std::abs(a.stage_N[kBoneReported] - norm(b.force_W_N)) > kForceTolerance_N)
      return differ("force", a.stage_N[kBoneReported], norm(b.force_W_N));
    if (std::abs(a.depth_m - b.felt_depth_m) > kPlaceTolerance_m)
      return differ("depth that the tissue feels", a.depth_m, b.felt_depth_m);
    if (!b.touching) continue;
    if (norm(bone.p_proxy_W_m - b.p_proxy_W_m) > kPlaceTolerance_m)
      return differ("distance of the proxies", norm(bone.p_proxy_W_m - b.p_proxy_W_m), 0);
    if (std::abs(bone.held_m - b.held_m) > kPlaceTolerance_m) return differ("h", bone.held_m, b.held_m);
  }
  return all;
}

struct BonePerLimb : ::testing::TestWithParam<LimbKind> {};

TEST_P(BonePerLimb, standsAsTheReferenceOverRandomGestures) {
  const std::uint64_t sessions = longForm() ? 1000 : 60;
  int touching = 0, begins = 0, slips = 0, held = 0, failures = 0;
  int skin = 0, back = 0, cut = 0, stayed = 0;
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
  }
  EXPECT_GT(touching, 20'000);
  EXPECT_GT(begins, 100);
  EXPECT_GT(slips, 10'000);
  EXPECT_GT(held, 10'000);
  std::cerr << touching << " " << begins << " " << slips << " " << held << " skin " << skin << " back "
            << back << " cut " << cut << " stayed " << stayed << "\n";
}

INSTANTIATE_TEST_SUITE_P(Limbs, BonePerLimb, ::testing::ValuesIn(kLimbKinds), [](const auto& chosen) {
  std::string name(limbName(chosen.param));
  std::erase(name, ' ');
  return name;
});

// the control
TEST(BoneReference, everyPlantedFaultIsFound) {
  for (const BoneDefect planted :
       {BoneDefect::kSticks, BoneDefect::kSlipsToFoot, BoneDefect::kBeginsAtTip, BoneDefect::kOneSlip,
        BoneDefect::kTipInBone, BoneDefect::kNoRoom, BoneDefect::kNarrowRoom, BoneDefect::kSkinForgotten,
        BoneDefect::kSkinAtBegin, BoneDefect::kStaysOut, BoneDefect::kEndsAtOnce,
        BoneDefect::kNotHeldToSkin}) {
    int found = 0;
    for (std::uint64_t i = 0; i < 40 && found < 2; ++i)
      if (!compareBone(boneSession(i + 50, kLimbKinds[i % kLimbKinds.size()]), planted).difference.empty())
        ++found;
    EXPECT_EQ(found, 2) << "planted fault " << static_cast<int>(planted);
  }
}

}  // namespace
}  // namespace needlelab::test
