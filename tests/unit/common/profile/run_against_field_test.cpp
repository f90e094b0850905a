// A run's list of layers is the field's along the needle; and a new path does not raise the clamping force.
#include <gtest/gtest.h>

#include <numbers>

#include "tests/unit/common/profile/patients_in_body.h"

namespace needlelab::patients_in_body::run_against_field {
namespace {

constexpr double kSpeed_mps = 0.02, kStart_m = 0.007;
/// A layer as thick as half the diameter but for this may be one or none.
constexpr double kUnclear_m = 3e-5;
/// Where the run differs from the field, it does so for no longer than this.
constexpr double kDiffers_m = 0.5e-3;

struct Way {
  Line line;
  double end_m = 0;
  Stretches all, sure;    ///< with the layers that may be none, and without
  bool has_thin = false;  ///< a layer hardly thicker than a sliver
};

// to 1 mm before bone, the far skin or the needle's end
std::optional<Way> randomWay(const Patient& patient, test::Random& random) {
  const auto line = randomLine(patient, random, 0.03, 0.9);
  if (!line) return std::nullopt;
  Way way{.line = *line, .end_m = 0.95 * patient.scene.needle_length_m, .all = {}, .sure = {}};
  const Stretches found = sampled(patient, *line, 1e-5, way.end_m);
  for (const Stretch& one : found)
    if (one.structure == kOutside || patient.isBone(one.structure)) {
      way.end_m = one.from_m - 1e-3;
      break;
    }
  if (way.end_m < 0.005) return std::nullopt;
  way.all = withoutSlivers(found, patient.sliver_m - kUnclear_m);
  way.sure = withoutSlivers(found, patient.sliver_m + kUnclear_m);
  for (const Stretch& one : way.sure)
    way.has_thin |= one.to_m < way.end_m && one.length_m() < 1.5 * patient.sliver_m;
  return way;
}

struct Comparison {
  Share ticks;
  int missed = 0;        ///< layers of the field that the run has not
  double differs_m = 0;  ///< the longest stretch that differs
};

Comparison compare(const Patient& patient, const Way& way) {
  Comparison found;
  Needle needle(patient);
  needle.rest(way.line.at(-kStart_m), way.line.axis);
  std::vector<bool> met(way.sure.size(), false);
  double wrong_from_m = -1;
  needle.to(way.line.at(way.end_m), kSpeed_mps, [&](const StepReport& report) {
    const double s_m = dot(needle.tip() - way.line.origin_m, way.line.axis);
    if (s_m < 0) return;
    const bool is_right = report.layer >= 0 && (structureAt(way.all, s_m) == report.layer ||
                                                structureAt(way.sure, s_m) == report.layer);
    found.ticks.count(is_right);
    if (is_right) wrong_from_m = -1;
    if (!is_right && wrong_from_m < 0) wrong_from_m = s_m;
    if (!is_right) found.differs_m = std::max(found.differs_m, s_m - wrong_from_m);
    for (std::size_t i = 0; i < way.sure.size(); ++i)
      if (way.sure[i].structure == report.layer && s_m > way.sure[i].from_m - kDiffers_m &&
          s_m < way.sure[i].to_m + kDiffers_m)
        met[i] = true;
  });
  for (std::size_t i = 0; i < way.sure.size(); ++i)
    found.missed += !met[i] && way.sure[i].from_m + 2 * kBoundaryError_m < way.end_m;
  return found;
}

TEST(RunAgainstField, aStraightRunHasTheFieldsLayers) {
  const int wanted = test::longForm() ? 1000 : 5;  // of each of twelve patients
  for (const Patient& patient : patients()) {
    test::Random random(651);
    Share ticks, runs;
    int lines = 0, missed = 0;
    double differs_m = 0;
    std::size_t layers = 0;
    for (int tries = 0; tries < 100 * wanted && lines < wanted; ++tries) {
      const auto way = randomWay(patient, random);
      // one in two has a thin layer
      if (!way || (lines % 2 == 0 && !way->has_thin && tries < 50 * wanted)) continue;
      ++lines;
      layers += way->sure.size();
      const Comparison here = compare(patient, *way);
      ticks.right += here.ticks.right, ticks.all += here.ticks.all;
      missed += here.missed;
      differs_m = std::max(differs_m, here.differs_m);
      runs.count(here.missed == 0 && here.differs_m <= kDiffers_m);
      EXPECT_EQ(here.missed, 0) << patient.name << ", line " << lines
                                << ": layers of the field that the run misses";
      EXPECT_LE(here.differs_m, kDiffers_m)
          << patient.name << ", line " << lines << ": it differs for too long";
    }
    EXPECT_EQ(lines, wanted) << patient.name;
    std::printf(
        "run against field: %-16s %ld of %d runs alike, %d of %zu layers missed, right in %.2f %% of %ld ticks, longest difference %.2f mm\n",
        patient.name.c_str(), runs.right, lines, missed, layers, ticks.percent(), ticks.all, 1e3 * differs_m);
  }
}

// A hand goes in, aside, deeper, turns the needle, goes back: in ticks that begin a new path, the clamping
// force grows by no more than its stiffness over the tip's way.
TEST(RunAgainstField, aNewPathDoesNotRaiseTheClampingForce) {
  const int wanted = test::longForm() ? 100 : 5;
  for (const Patient& patient : patients()) {
    test::Random random(661);
    long paths = 0, raised = 0;
    double worst_N = 0;
    for (int run = 0; run < wanted; ++run) {
      const auto line = randomLine(patient, random, 0.02, 0.6);
      if (!line) continue;
      const Vec3 side = normalized(cross(line->axis, {0.3, 0.5, 0.81})), other = cross(line->axis, side);
      Needle needle(patient);
      needle.rest(line->at(-kStart_m), line->axis);
      Vec3 axis = line->axis, tip_before = needle.tip();
      bool inside = false, touched = false;
      double clamping_N = 0, stiffness_N_per_m = 0, depth_m = 0;
      for (int leg = 0; leg < 8; ++leg) {
        depth_m = leg == 0 ? 0.002
                           : std::clamp(depth_m + random.in(-0.004, 0.012), 0.002,
                                        0.6 * patient.scene.needle_length_m);
        const double aside_m = std::min(0.004, 0.4 * depth_m);
        const Vec3 to =
            line->at(depth_m) + side * random.in(-aside_m, aside_m) + other * random.in(-aside_m, aside_m);
        const Vec3 axis_to =
            normalized(line->axis + side * random.in(-0.15, 0.15) + other * random.in(-0.15, 0.15));
        const Vec3 from = needle.tip(), axis_from = axis;
        const int ticks = std::max(20, static_cast<int>(norm(to - from) / random.in(0.01, 0.04) * kRate_hz));
        for (int k = 1; k <= ticks; ++k) {
          const double share = static_cast<double>(k) / ticks;
          axis = normalized(axis_from + (axis_to - axis_from) * share);
          const StepReport& report = needle.at(from + (to - from) * share, axis);
          const bool is_new = (report.flags & kFlagNewPath) != 0, touches = needle.state().bone.touching;
          const bool is_inside = report.layer >= 0;
          if (is_new && inside && is_inside && !touches && !touched) {
            ++paths;
            const double stiffest = std::max(report.clamping_stiffness_N_per_m, stiffness_N_per_m);
            const double beyond_N =
                report.clamping_N - clamping_N - stiffest * norm(needle.tip() - tip_before);
            worst_N = std::max(worst_N, beyond_N);
            raised += beyond_N > 0.02;
            EXPECT_LE(beyond_N, 0.02) << patient.name << ", run " << run << ", leg " << leg << ", tick " << k
                                      << ": a new path raises the clamping force, from " << clamping_N;
          }
          inside = is_inside, touched = touches;
          clamping_N = is_inside ? report.clamping_N : 0;
          stiffness_N_per_m = is_inside ? report.clamping_stiffness_N_per_m : 0;
          tip_before = needle.tip();
        }
      }
    }
    EXPECT_GT(paths, 5 * wanted) << patient.name;
    std::printf(
        "new path: %-16s %ld used in tissue, %ld raised the clamping force, at most by %.3f N beyond stiffness times way\n",
        patient.name.c_str(), paths, raised, worst_N);
  }
}

}  // namespace
}  // namespace needlelab::patients_in_body::run_against_field
