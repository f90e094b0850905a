/// Four more effects, stages as CONTRIBUTING.md describes them: dummy i pushes the needle out with k_i N for
/// each metre inserted.
#include <array>
#include <span>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

static_assert(kDummyEffectCount == 4);

template <std::size_t kDummy>
struct DummyStage {
  static constexpr Effect kEffect = static_cast<Effect>(kEffectCount - kDummyEffectCount + kDummy);
  static constexpr std::size_t kOwn = stageOf(kEffect);

  static double& stiffness_N_per_m(SceneSpec& spec) { return spec.stage_numbers[kOwn][0]; }
  static constexpr std::array<EffectField, 1> kFields = {
      {{"stiffness_n_per_m", "Stiffness", kStiffness, 10.0 * (kDummy + 1), stiffness_N_per_m}}};

  static Vec3 push(const SceneModel& model, const TipSample&, SimState& state, StepReport& report) noexcept {
    const double force_N = -model.stage_numbers[kOwn][0] * report.insertion_m;
    report.stage_N[kOwn] = force_N;
    return state.u_W * force_N;
  }

  static constexpr EffectEntry entry(std::string_view name, std::string_view label, std::string_view term,
                                     std::uint32_t colour) {
    return {.effect = kEffect,
            .name = name,
            .label = label,
            .short_name = term,
            .term = term,
            .colour = colour,
            .place = 100 + static_cast<int>(kDummy),
            .value = [](const StepReport& report) { return report.stage_N[kOwn]; },
            .section = term,
            .fields = kFields,
            .hasNumbers = [](const SceneSpec& spec) { return spec.stage_numbers[kOwn][0] > 0; },
            .stiffness_N_per_m = [](const SceneModel& model) { return model.stage_numbers[kOwn][0]; },
            .stage = push};
  }
};

}  // namespace

extern const std::array<EffectEntry, kDummyEffectCount> kDummyEntries;
constinit const std::array<EffectEntry, kDummyEffectCount> kDummyEntries = {
    DummyStage<0>::entry("DUMMY_A", "Dummy A", "dummy_a", 0x111111),
    DummyStage<1>::entry("DUMMY_B", "Dummy B", "dummy_b", 0x222222),
    DummyStage<2>::entry("DUMMY_C", "Dummy C", "dummy_c", 0x333333),
    DummyStage<3>::entry("DUMMY_D", "Dummy D", "dummy_d", 0x444444)};

// no other axial model than the wall is compiled with the dummies, because each takes seconds
extern const AxialEntry kTrackingWallEntry;
std::span<const AxialEntry* const, kAxialModelCount> axialEntries() {
  static const auto kWalls = [] {
    std::array<const AxialEntry*, kAxialModelCount> walls{};
    walls.fill(&kTrackingWallEntry);
    return walls;
  }();
  return kWalls;
}
const AxialEntry& axialEntry(AxialModel /*model*/) {
  return kTrackingWallEntry;
}

}  // namespace needlelab
