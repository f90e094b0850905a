// A score depends on the gesture, not on its sampling.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <map>
#include <set>

#include "common/scoring/measures/measure_table.h"
#include "common/scoring/motion/dtw.h"
#include "tests/support/run_form.h"
#include "tests/unit/common/scoring/continuous_gesture.h"

namespace needlelab {
namespace {

/// The tolerance of a measure between 500 Hz, 1 kHz and 2 kHz: a share of its value plus an absolute part in
/// its unit. Times are known to a tick at each end; counts must match exactly.
struct Tolerance {
  double share, besides;
};
/// Other measures have 0.5 % if they have a unit; counts and yes or no are exact.
const std::map<std::string_view, Tolerance> kTolerances = {
    {"elapsed_s", {0, 2.1e-3}},
    {"path_length_m", {2e-3, 0}},
    {"time_in_tissue_s", {0, 8e-3}},
    {"mean_speed_m_s", {2e-3, 0}},
    {"tissue_damage_m2", {0.01, 1e-8}},
    {"sparc", {0.02, 0}},
    {"ldlj", {0.02, 0}},
    {"clamping_work_j", {0.02, 1e-7}},
    {"greatest_depth_m", {0, 1e-5}},
    {"greatest_insertion_m", {0, 1e-5}},
    {"peak_force_n", {2e-3, 0}},
    {"mean_force_in_tissue_n", {2e-3, 0}},
    {"peak_force_layer_K_n", {0.01, 0}},
    {"largest_lateral_error_m", {1e-3, 0}},
    {"path_inefficiency", {5e-3, 0}},
    {"time_at_target_s", {0, 8e-3}},
    {"target_distance_m", {0, 5e-5}},
    {"target_nearest_m", {0, 2e-5}},
    {"planned_entry_error_m", {0, 1e-5}},
    {"planned_angle_error_rad", {0, 1e-6}},
    {"largest_planned_line_error_m", {5e-3, 5e-5}},
    {"injected_share", {5e-3, 0}},
    {"injected_in_target_share", {5e-3, 0}},
    {"dtw_distance_m", {5e-3, 5e-5}},
};

Tolerance toleranceOf(const std::string& name) {
  const MeasureKind& kind = *measureKind(name);
  const auto found = kTolerances.find(kind.name);
  if (found != kTolerances.end()) return found->second;
  return kind.unit.empty() ? Tolerance{0, 0} : Tolerance{5e-3, 0};
}

/// Checks that both rates have the same rows and that their values agree.
void expectSame(const std::vector<Measure>& a, const std::vector<Measure>& b, double times,
                const std::string& what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].name, b[i].name) << what;
    const Tolerance tolerance = toleranceOf(a[i].name);
    EXPECT_NEAR(a[i].value, b[i].value, times * (tolerance.share * std::abs(a[i].value) + tolerance.besides))
        << what << ", " << a[i].name;
    if (test::longForm())
      std::printf("%s %s %.6g: off by %.3g\n", what.c_str(), a[i].name.c_str(), a[i].value,
                  b[i].value - a[i].value);
  }
}

std::vector<Measure> scoreAt(const ContinuousGesture& gesture, double rate_hz,
                             std::vector<GestureSample> samples, const std::vector<TipPath>& references) {
  const pb::Exercise exercise = plannedExercise();
  return scoreGesture(samples, rate_hz, gesture.profile(), {}, &exercise, references);
}

std::vector<TipPath> twoReferences() {
  return {tipPathOf(ContinuousGesture(901).samples(1000), 1000, {}),
          tipPathOf(ContinuousGesture(902).samples(1000), 1000, {})};
}

TEST(Invariance, theSameGestureAtThreeRates) {
  const auto references = twoReferences();
  std::set<std::string> seen;
  const std::uint64_t gestures = test::longForm() ? 100 : 6;
  for (std::uint64_t seed = 1; seed <= gestures; ++seed) {
    const ContinuousGesture gesture(seed);
    const auto at = [&](double rate_hz) {
      return scoreAt(gesture, rate_hz, gesture.samples(rate_hz), references);
    };
    const auto middle = at(1000);
    for (const Measure& row : middle) seen.insert(std::string(measureKind(row.name)->name));
    expectSame(middle, at(500), 1, "gesture " + std::to_string(seed) + ", 1 kHz and 500 Hz");
    expectSame(middle, at(2000), 1, "gesture " + std::to_string(seed) + ", 1 kHz and 2 kHz");
  }
  EXPECT_EQ(seen.size(), measureKinds().size() - 2)
      << "these gestures have every measure but the time to a landmark, and nothing is missing";
}

TEST(Invariance, whenAndWhereDoesNotMatter) {
  const auto references = twoReferences();
  const ContinuousGesture gesture(7);
  const auto samples = gesture.samples(1000);
  const auto score = scoreAt(gesture, 1000, samples, references);

  // a year of ticks later, on another clock: bit for bit the same
  auto later = samples;
  for (GestureSample& s : later) s.tick += 31'536'000'000u, s.time_ns += 1'000'000'000'000'007;
  const auto later_score = scoreAt(gesture, 1000, later, references);
  ASSERT_EQ(score.size(), later_score.size());
  for (std::size_t i = 0; i < score.size(); ++i)
    EXPECT_EQ(score[i].value, later_score[i].value) << score[i].name;

  // limb and gesture placed elsewhere together: the same except for rounding
  const Pose X_WL{{0.3, -0.2, 0.1}, normalized(Quat{0.1, 0.4, -0.3, 0.8})};
  auto moved = samples;
  for (GestureSample& s : moved) {
    setTip(s, X_WL * Vec3{s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]});
    const Quat q = X_WL.q * Quat{s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]};
    s.q_WT[0] = q.x, s.q_WT[1] = q.y, s.q_WT[2] = q.z, s.q_WT[3] = q.w;
    const Vec3 f = rotate(X_WL.q, {s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]});
    s.force_W_N[0] = f.x, s.force_W_N[1] = f.y, s.force_W_N[2] = f.z;
  }
  const pb::Exercise exercise = plannedExercise();
  const auto moved_score = scoreGesture(moved, 1000, gesture.profile(), X_WL, &exercise, references);
  ASSERT_EQ(score.size(), moved_score.size());
  for (std::size_t i = 0; i < score.size(); ++i)
    EXPECT_NEAR(score[i].value, moved_score[i].value, 1e-9 * std::max(1.0, std::abs(score[i].value)))
        << score[i].name;
}

TEST(Invariance, aHundredthOfTheSamplesLostChangesLittle) {
  const auto references = twoReferences();
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const ContinuousGesture gesture(seed);
    const auto samples = gesture.samples(1000);
    std::mt19937_64 random(seed);
    std::vector<GestureSample> left;
    for (const GestureSample& s : samples) {
      if (random() % 100 != 0) left.push_back(s);
    }
    // ten times fewer ticks beside each gap than at 500 Hz: twice the tolerance between rates
    expectSame(scoreAt(gesture, 1000, samples, references), scoreAt(gesture, 1000, left, references), 2,
               "gesture " + std::to_string(seed) + " with 1 % lost");
  }
}

}  // namespace
}  // namespace needlelab
