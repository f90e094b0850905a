/// VIBRATION, a stage: when a membrane gives way, what was stretched rings for a moment along the needle:
///   f = A·e^(−t/τ)·sin(2πf·t) along u, t the time since the rupture; further ruptures add.
/// As a rotation that shrinks: z ← z·ρ with ρ = e^(−T/τ)·e^(i·2πf·T), the force is the imaginary part of z.
#include <array>

#include "common/haptics/det_math.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

constexpr std::size_t kOwn = stageOf(Effect::kVibration);
// the author's numbers; `compileStage` puts ρ into the last two
constexpr std::size_t kForce_N = 0, kFrequency_hz = 1, kDecay_s = 2, kRotation = 1, kRotationAcross = 2;
// what is remembered: z
constexpr std::size_t kReal = 0, kImaginary = 1;
constexpr double kStill_N = 1e-6;

template <std::size_t kIndex>
double& numberOf(SceneSpec& spec) {
  return spec.stage_numbers[kOwn][kIndex];
}

constexpr std::array<EffectField, 3> kFields = {
    {{"force_n", "Force at the rupture", {0, 5}, 0.3, numberOf<kForce_N>},
     {"frequency_hz", "Frequency", {0, 500, true}, 120, numberOf<kFrequency_hz>},
     {"decay_s", "Decays in", {0, 1, true}, 0.03, numberOf<kDecay_s>}}};

Vec3 vibrate(const SceneModel& model, const TipSample&, SimState& state, StepReport& report) noexcept {
  const StageNumbers& own = model.stage_numbers[kOwn];
  double& real = state.stage[kOwn][kReal];
  double& imaginary = state.stage[kOwn][kImaginary];
  if ((report.flags & kFlagRupture) != 0) real += own[kForce_N];
  const double force_N = imaginary;
  report.stage_N[kOwn] = force_N;
  const double rotated = real * own[kRotation] - imaginary * own[kRotationAcross];
  imaginary = real * own[kRotationAcross] + imaginary * own[kRotation];
  real = rotated;
  if (real * real + imaginary * imaginary < kStill_N * kStill_N) real = imaginary = 0.0;
  return state.u_W * force_N;
}

void compileRotation(SceneModel& model) {
  StageNumbers& own = model.stage_numbers[kOwn];
  const double angle_rad = 2 * kPi * own[kFrequency_hz] * model.period_s;
  const double shrinks = detExp(-model.period_s / own[kDecay_s]);
  own[kRotation] = shrinks * detCos(angle_rad);
  own[kRotationAcross] = shrinks * detSin(angle_rad);
}

}  // namespace

extern const EffectEntry kVibrationEntry;
constinit const EffectEntry kVibrationEntry = {
    .effect = Effect::kVibration,
    .name = "VIBRATION",
    .label = "Vibration: what rings when a membrane gives way",
    .short_name = "vibr",
    .term = "vibration",
    .colour = 0x7A86FF,
    .place = 6,
    .value = [](const StepReport& report) { return report.stage_N[kOwn]; },
    .section = "vibration",
    .fields = kFields,
    .hasNumbers = [](const SceneSpec& spec) { return spec.stage_numbers[kOwn][kForce_N] > 0; },
    .stage = vibrate,
    .compileStage = compileRotation};

}  // namespace needlelab
