#include <algorithm>
#include <cmath>

#include "common/scoring/groups.h"

namespace needlelab {
namespace {

/// A movement begins above the first speed and ends when it stays below the second for `kActionPause_s`;
/// shorter ways are no movement. m and m/s, rad and rad/s.
struct ActionLimits {
  double begin_per_s, end_per_s, least;
};
constexpr ActionLimits kTranslation{3e-3, 1.5e-3, 2e-3};
constexpr ActionLimits kRotation{0.1, 0.05, 0.05};
constexpr double kActionPause_s = 0.1;
/// Speeds are those of straight lines over so many points to either side: 0.1 s, over which tremor of 8-12 Hz
/// comes back to where it was.
constexpr std::size_t kActionReach = 5;

/// Movement from point i of a run to the next, as a share of the straight line over 0.1 s around it.
template <typename F>
double chordStep(const Run& run, std::size_t i, const F& quantity) {
  const std::size_t from = i < kActionReach ? 0 : i - kActionReach + 1;
  const std::size_t to = std::min(i + kActionReach, run.inside.size());
  return norm(quantity(run.points[to]) - quantity(run.points[from])) / static_cast<double>(to - from);
}

/// Counts movements in steps of equal time.
class ActionCounter {
 public:
  explicit ActionCounter(const ActionLimits& limits) : limits_(limits) {}

  void add(double step, double period_s) {
    const double speed = step / period_s;
    if (!moving_ && speed > limits_.begin_per_s) {
      moving_ = true;
      way_ = slow_s_ = 0;
    }
    if (!moving_) return;
    way_ += step;
    slow_s_ = speed < limits_.end_per_s ? slow_s_ + period_s : 0;
    if (slow_s_ >= kActionPause_s * (1 - 1e-9)) finish();
  }
  /// The end of a run.
  void finish() {
    if (moving_ && way_ >= limits_.least) ++count_;
    moving_ = false;
  }
  [[nodiscard]] int count() const { return count_; }

 private:
  const ActionLimits limits_;
  bool moving_ = false;
  double way_ = 0, slow_s_ = 0;
  int count_ = 0;
};

}  // namespace

/// - `translational_actions`, `rotational_actions`: movements of the tip and turns of the axis, counted on
/// the track, in tissue and outside.
/// - `clamping_work_j`: Σ max(0, −F·Δp) over the track's steps in tissue, F the force on the hand averaged
/// over the step and Δp the tip's movement, both across the needle's axis: the forces along it (cutting,
/// friction, puncture) have no part in it.
void addActions(const Gesture& gesture, Rows& rows) {
  ActionCounter moves(kTranslation), turns(kRotation);
  double work_J = 0;
  for (const Run& run : gesture.runs) {
    for (std::size_t i = 0; i < run.inside.size(); ++i) {
      const TrackPoint &a = run.points[i], &b = run.points[i + 1];
      const Vec3 step_m = b.p_WT_m - a.p_WT_m;
      moves.add(chordStep(run, i, [](const TrackPoint& p) { return p.p_WT_m; }), run.period_s);
      turns.add(chordStep(run, i, [](const TrackPoint& p) { return p.axis_W; }), run.period_s);
      const Vec3 sum = a.axis_W + b.axis_W;
      if (!(run.inside[i] > 0) || !(normSquared(sum) > 1e-12)) continue;
      const Vec3 axis = normalized(sum);
      const auto across = [&](Vec3 v) { return v - dot(v, axis) * axis; };
      work_J += run.inside[i] * std::max(0.0, -dot(across(run.force_W_N[i]), across(step_m)));
    }
    moves.finish();
    turns.finish();
  }
  rows.add("translational_actions", moves.count());
  rows.add("rotational_actions", turns.count());
  rows.add("clamping_work_j", work_J);
}

}  // namespace needlelab
