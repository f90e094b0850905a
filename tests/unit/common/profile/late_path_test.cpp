// A path that comes late: a quick dive, after a turn in the air or alone, feels the layers of its own line.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/support/anatomy/late_paths.h"
#include "tests/unit/common/profile/patients_in_body.h"

namespace needlelab::patients_in_body::late_path {
namespace {

// the planned line, to 1 mm before bone, the far skin or the needle's end
struct Plan {
  Line line;
  Stretches layers;
  double end_m = 0;
};
Plan planOf(const Patient& patient) {
  Plan plan{.line = {{}, patient.planned}, .layers = {}, .end_m = 0.98 * patient.scene.needle_length_m};
  plan.layers = withoutSlivers(sampled(patient, plan.line, 1e-6, plan.end_m), patient.sliver_m);
  for (const Stretch& one : plan.layers)
    if (one.structure == kOutside || patient.isBone(one.structure)) {
      plan.end_m = one.from_m - 1e-3;
      break;
    }
  return plan;
}

// in tissue, whether the engine says so or not
void dive(const Plan& plan, Needle& needle, double speed_mps, Share& share) {
  needle.to(plan.line.at(plan.end_m), speed_mps, [&](const StepReport& report) {
    const double s_m = dot(needle.tip(), plan.line.axis);
    if (s_m > kBoundaryError_m) share.count(isRight(plan.layers, s_m, report.layer));
  });
}

TEST(LatePath, aDiveFeelsTheLayersOfItsOwnLine) {
  for (const Patient& patient : patients()) {
    const Plan plan = planOf(patient);
    const Vec3 aside{-0.03, 0, 0.012};
    EXPECT_GT(patient.field().skinDistance(aside), 2e-3) << patient.name << ": it begins in the air";
    double worst[2] = {100, 100};
    test::Random random(641);
    long runs = 0, right = 0;
    for (const double speed_mps : {0.05, 0.1, 0.2})
      for (int turns = 0; turns < 2; ++turns)
        for (int start = 0; start < (test::longForm() ? 20 : 3); ++start) {
          // where the tick falls decides
          const double above_m = start == 0 ? 0.006 : start == 1 ? 0.0063 : random.in(0.0055, 0.0075);
          const Vec3 over = plan.line.at(-above_m);
          Needle needle(patient);
          if (turns == 1) {
            needle.rest(aside, plan.line.axis, 60 + start % 20);
            needle.to(over, 0.5);
          } else {
            needle.rest(over, plan.line.axis, 60 + start % 20);
          }
          Share share;
          dive(plan, needle, speed_mps, share);
          ++runs;
          right += share.percent() >= 98;
          worst[turns] = std::min(worst[turns], share.percent());
          EXPECT_GE(share.percent(), 98)
              << patient.name << (turns == 1 ? ", after a turn, " : ", alone, ") << 1e3 * speed_mps
              << " mm/s from " << 1e3 * above_m << " mm, start " << start << ": the layer is not the field's";
        }
    std::printf("late path: %-16s %ld of %ld dives right; worst alone %.1f %%, after a turn %.1f %%\n",
                patient.name.c_str(), right, runs, worst[0], worst[1]);
  }
}

// At 500 mm/s, after a turn, and where a path comes 20 ms late: a layer that was passed unfelt is flagged, as
// are the ticks that kept a path. Control: in time, at 50 mm/s alone, no tick has a flag.
TEST(LatePath, whatAQuickDivePassesUnfeltIsFlagged) {
  int missing = 0, flagged = 0;
  for (const Patient& patient : patients()) {
    const Plan plan = planOf(patient);
    for (const int late : {0, 4}) {
      test::LatePaths paths(*patient.model, [late](int ask, const PathAsk&) { return ask == 0 ? 0 : late; });
      Needle needle(*patient.model, &paths);
      std::uint32_t flags = 0;
      std::set<int> felt_layers;
      const auto each = [&](const StepReport& report) {
        flags |= report.flags;
        felt_layers.insert(report.layer);
      };
      if (late > 0) {
        needle.rest({-0.03, 0, 0.012}, plan.line.axis);
        needle.to(plan.line.at(-0.006), 0.5);
      } else {
        needle.rest(plan.line.at(-0.006), plan.line.axis);
      }
      needle.to(plan.line.at(plan.end_m), late > 0 ? 0.5 : 0.05, each);
      const bool misses = std::any_of(plan.layers.begin(), plan.layers.end(), [&](const Stretch& one) {
        // a tick is 0.5 mm
        return one.to_m < plan.end_m && one.length_m() > 1e-3 && !felt_layers.contains(one.structure);
      });
      const bool is_flagged = (flags & kFlagSkipped) != 0;
      EXPECT_EQ((flags & kFlagKeptPath) != 0, late > 0) << patient.name;
      if (late == 0) EXPECT_FALSE(misses || is_flagged) << patient.name;
      if (misses) EXPECT_TRUE(is_flagged) << patient.name << ": a layer was passed, and no tick says so";
      missing += misses;
      flagged += is_flagged;
    }
  }
  std::printf("late paths at 500 mm/s: %d of %zu dives miss a layer, %d are flagged\n", missing,
              patients().size(), flagged);
  EXPECT_GT(missing, 2);
}

// the first path comes when the tip is in
TEST(LatePath, aFirstPathThatComesInTissueBringsItsForces) {
  constexpr double kSpeed_mps = 0.2, kAbove_m = 0.2e-3;
  for (const Patient& patient : patients()) {
    const Plan plan = planOf(patient);
    for (const int rest : {1, 2, 3}) {
      Needle needle(patient);
      needle.rest(plan.line.at(-kAbove_m), plan.line.axis, rest);
      double path_m = -1, force_m = -1;
      Share share;
      needle.to(plan.line.at(plan.end_m), kSpeed_mps, [&](const StepReport& report) {
        const double s_m = dot(needle.tip(), plan.line.axis);
        if (path_m < 0 && needle.engine().path() != nullptr) path_m = s_m;
        if (force_m < 0 && norm(report.wrench_W.force_N) > 0.05) force_m = s_m;
        if (path_m >= 0 && s_m > path_m + 0.002) share.count(isRight(plan.layers, s_m, report.layer));
      });
      std::printf(
          "first path in tissue: %-16s after %2d ticks of rest: path at %.1f mm, forces from %.1f mm, then right in %.1f %%\n",
          patient.name.c_str(), rest, 1e3 * path_m, 1e3 * force_m, share.percent());
      EXPECT_GT(path_m, 0.1e-3) << patient.name << ", " << rest << ": it came outside";
      EXPECT_GE(force_m, 0) << patient.name << ", " << rest << ": never a force";
      EXPECT_LE(force_m, std::max(0.0, path_m) + 0.002)
          << patient.name << ", " << rest << ": the forces come late";
    }
  }
}

}  // namespace
}  // namespace needlelab::patients_in_body::late_path
