#include "common/haptics/models/fem_needle.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace needlelab {
namespace {

// tolerances for zero: far below perceptible forces, far above rounding
constexpr double kForceNear_N = 1e-10, kPlaceNear_m = 1e-13;
/// How far the cut may run ahead of the needle in a tick, in stations: further ahead, the force would not
/// keep up.
constexpr double kCutAhead = 0.25;
constexpr std::size_t kMaxUnknowns = kMaxNeedleStations + 1;  // shaft and tip

// The tip's force on the stations: a cubic B-spline of the contact's length about the tip, integrated over
// each station and reflected at the skin and at the path's end. It is a length, so that more stations refine
// it, and a spline, so that the force does not ripple as the tip crosses stations (a hat one station wide
// would give 17 %).
struct TipSpread {
  std::size_t first = 0, count = 0;
  std::array<double, kMaxNeedleStations> weight;
};

// ∫ of the cubic B-spline with knots at −2, −1, 0, 1, 2, up to u
double splineUpTo(double u) {
  if (u > 0.0) return 1.0 - splineUpTo(-u);
  if (u <= -2.0) return 0.0;
  if (u >= -1.0) return 0.5 + u * (4.0 - u * u * (2.0 + 0.75 * u)) / 6.0;
  const double t = (u + 2.0) * (u + 2.0);
  return t * t / 24.0;
}

TipSpread spreadAt(double depth_m, double contact_m, const NeedleCompliance& compliance) {
  const std::size_t stations = compliance.stations();
  assert(stations > 0 && stations <= kMaxNeedleStations && compliance.spacing_m > 0.0);
  const double end_m = compliance.spacing_m * static_cast<double>(stations), knot_m = 0.25 * contact_m;
  const double at_m = std::clamp(depth_m, 0.0, end_m), half_m = 0.5 * contact_m;
  const double last = static_cast<double>(stations - 1);
  TipSpread spread;
  spread.first =
      static_cast<std::size_t>(std::min(last, std::max(0.0, at_m - half_m) / compliance.spacing_m));
  spread.count =
      static_cast<std::size_t>(std::min(last, (at_m + half_m) / compliance.spacing_m)) + 1 - spread.first;
  assert(spread.count > 0 && spread.first + spread.count <= stations);
  const bool near_skin = at_m<half_m, near_end = at_m> end_m - half_m;
  const auto massUpTo = [&](double z_m) {
    double mass = splineUpTo((z_m - at_m) / knot_m);
    if (near_skin) mass += splineUpTo((z_m + at_m) / knot_m) - 1.0;
    if (near_end) mass += splineUpTo((z_m + at_m - 2.0 * end_m) / knot_m);
    return mass;
  };
  double above = 0.0;
  for (std::size_t n = 0; n < spread.count; ++n) {
    const bool is_last = n + 1 == spread.count;
    const double below =
        is_last ? 1.0 : massUpTo(static_cast<double>(spread.first + n + 1) * compliance.spacing_m);
    spread.weight[n] = below - above;
    above = below;
  }
  return spread;
}

double meanOver(const TipSpread& spread, const double* values) {
  double sum = 0;
  for (std::size_t n = 0; n < spread.count; ++n) sum += spread.weight[n] * values[spread.first + n];
  return sum;
}

// to += factor·from; element by element, so that vectorising does not change the bits
void addScaled(double* __restrict to, const double* __restrict from, double factor, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) to[i] += factor * from[i];
}

// Solves the upper triangle `a` (rows of `stride`, symmetric positive definite) · x = b by Cholesky, writing
// x into b; destroys `a`.
void solvePositive(double* a, std::size_t stride, std::size_t size, double* b) {
  assert(size <= stride);
  for (std::size_t k = 0; k < size; ++k) {
    double* row = a + k * stride;
    const double pivot = 1.0 / std::sqrt(row[k]);
    for (std::size_t j = k; j < size; ++j) row[j] *= pivot;
    row[k] = pivot;
    b[k] *= pivot;
    for (std::size_t i = k + 1; i < size; ++i) {
      addScaled(a + i * stride + i, row + i, -row[i], size - i);
      b[i] -= row[i] * b[k];
    }
  }
  for (std::size_t k = size; k-- > 0;) {
    const double* row = a + k * stride;
    for (std::size_t j = k + 1; j < size; ++j) b[k] -= row[j] * b[j];
    b[k] *= row[k];
  }
}

/// The problem of one tick: r = b − A y, with y in [low, high]; r = 0 where y is inside, r ≥ 0 at high, r ≤ 0
/// at low. The first `shaft` unknowns are the forces of the stations, the last unknown is the tip's force.
class Contact {
 public:
  Contact(const FemNeedle& needle, const NeedlePose& pose, NeedleState& state);
  void solve();
  NeedleForce finish();

 private:
  [[nodiscard]] double giveBetween(std::size_t a, std::size_t b) const;
  void solveOnce();
  std::size_t findWrong(std::array<std::size_t, kMaxUnknowns>& which) const;
  void boundShaft(double length_m);
  void spreadTip(double depth_m);

  const NeedleCompliance& compliance_;
  const FemNeedle& needle_;
  const NeedlePose& pose_;
  NeedleState& state_;
  std::size_t stations_, shaft_ = 0, count_ = 0;
  TipSpread spread_;
  std::array<double, kMaxNeedleStations> tip_column_;  // C φ
  std::array<double, kMaxUnknowns> low_, high_, target_, force_, rest_;
  std::array<Hold, kMaxUnknowns> hold_;
};

Contact::Contact(const FemNeedle& needle, const NeedlePose& pose, NeedleState& state)
    : compliance_(*needle.compliance),
      needle_(needle),
      pose_(pose),
      state_(state),
      stations_(compliance_.stations()) {
  assert(state.stations == 0 || state.stations == stations_);
  assert(pose.slant > 0.0 && !(state.gap_m < 0.0) && !(state.tip_N < 0.0));
  state.stations = static_cast<std::uint32_t>(stations_);
  boundShaft(std::min({std::max(0.0, pose.x_m), pose.insertion_m, state.cut_m}));
  const double tip_depth = state.cut_m * pose.slant;
  spreadTip(tip_depth);

  // this tick's motion splits into tissue motion and slip
  const double motion = pose.x_m - state.x_m;
  for (std::size_t i = 0; i < shaft_; ++i) {
    target_[i] = motion + state.moved_m[i];
    hold_[i] = state.hold[i];
  }
  low_[shaft_] = 0.0;
  high_[shaft_] = (needle.cutting_N_m.upTo(tip_depth) - needle.cutting_N_m.upTo(tip_depth - needle.bevel_m)) /
                  needle.bevel_m;
  assert(!(high_[shaft_] < low_[shaft_]));
  target_[shaft_] =
      motion + meanOver(spread_, state.moved_m.data()) + needle.tip_give_m_per_N * state.tip_N - state.gap_m;
  hold_[shaft_] = state.tip_hold;
  count_ = shaft_ + 1;
}

// friction of the inserted part of each station; 0 for a station that the needle has left
void Contact::boundShaft(double length_m) {
  const double depth = length_m * pose_.slant;
  const double last = depth / compliance_.spacing_m;
  while (shaft_ < stations_ && static_cast<double>(shaft_) < last) {
    const double top = static_cast<double>(shaft_) * compliance_.spacing_m;
    const double most = top + compliance_.spacing_m <= depth
                            ? needle_.station_friction_N[shaft_]
                            : needle_.friction_N.upTo(depth) - needle_.friction_N.upTo(top);
    high_[shaft_] = most / pose_.slant;
    assert(!(high_[shaft_] < 0.0));
    low_[shaft_] = -high_[shaft_];
    ++shaft_;
  }
}

void Contact::spreadTip(double depth_m) {
  spread_ = spreadAt(depth_m, needle_.contact_m, compliance_);
  std::fill_n(tip_column_.begin(), stations_, 0.0);
  for (std::size_t n = 0; n < spread_.count; ++n)
    addScaled(tip_column_.data(), &compliance_.give_m_per_N[(spread_.first + n) * stations_],
              spread_.weight[n], stations_);
}

double Contact::giveBetween(std::size_t a, std::size_t b) const {
  assert(a < count_ && b < count_);
  if (a == shaft_ && b == shaft_) return meanOver(spread_, tip_column_.data()) + needle_.tip_give_m_per_N;
  if (a == shaft_) return tip_column_[b];
  if (b == shaft_) return tip_column_[a];
  return compliance_.give(a, b);
}

// computes the forces of the sticking unknowns, with the slipping ones at their bounds; `rest_` becomes r
void Contact::solveOnce() {
  std::array<std::size_t, kMaxUnknowns> sticking;
  std::size_t free = 0;
  std::copy_n(target_.begin(), count_, rest_.begin());
  const auto subtract = [&](std::size_t n) {
    if (force_[n] == 0.0) return;
    const double* column = n == shaft_ ? tip_column_.data() : compliance_.give_m_per_N.data() + n * stations_;
    addScaled(rest_.data(), column, -force_[n], shaft_);
    rest_[shaft_] -= force_[n] * giveBetween(shaft_, n);
  };
  for (std::size_t n = 0; n < count_; ++n) {
    if (hold_[n] == Hold::kSticks) {
      sticking[free++] = n;
      continue;
    }
    force_[n] = hold_[n] == Hold::kSlipsIn ? high_[n] : low_[n];
    subtract(n);
  }
  if (free == 0) return;

  std::array<double, kMaxUnknowns * kMaxUnknowns> matrix;
  std::array<double, kMaxUnknowns> unknown;
  for (std::size_t i = 0; i < free; ++i) {
    unknown[i] = rest_[sticking[i]];
    double* row = matrix.data() + i * free;
    for (std::size_t j = i; j < free; ++j) row[j] = giveBetween(sticking[i], sticking[j]);
  }
  solvePositive(matrix.data(), free, free, unknown.data());
  for (std::size_t i = 0; i < free; ++i) {
    force_[sticking[i]] = unknown[i];
    subtract(sticking[i]);
  }
}

// finds the violations: an unknown beyond its bound should slip, an unknown slipping the wrong way should
// stick. Fills `which`; returns their number
std::size_t Contact::findWrong(std::array<std::size_t, kMaxUnknowns>& which) const {
  std::size_t wrong = 0;
  for (std::size_t n = 0; n < count_; ++n) {
    const bool sticks = hold_[n] == Hold::kSticks;
    const bool beyond = sticks && (force_[n] > high_[n] + kForceNear_N || force_[n] < low_[n] - kForceNear_N);
    const bool backward = !sticks && low_[n] < high_[n] &&
                          (hold_[n] == Hold::kSlipsIn ? rest_[n] < -kPlaceNear_m : rest_[n] > kPlaceNear_m);
    if (beyond || backward) which[wrong++] = n;
  }
  return wrong;
}

// Block principal pivoting (Portugal, Júdice and Vicente 1994): changes all violations at once while their
// number falls. If it does not fall three times in a row, changes only the last violation, which must
// terminate, until the number falls again.
void Contact::solve() {
  constexpr int kPatience = 3;
  // without friction to hold it, a station slips in either direction
  for (std::size_t n = 0; n < count_; ++n)
    if (low_[n] == high_[n] && hold_[n] == Hold::kSticks) hold_[n] = Hold::kSlipsIn;
  std::array<std::size_t, kMaxUnknowns> wrong;
  std::size_t least = kMaxUnknowns + 1;
  int patience = kPatience, solves = 0;
  while (solves < kMaxSolves) {
    solveOnce();
    ++solves;
    const std::size_t count = findWrong(wrong);
    if (count == 0) {
      state_.solves = static_cast<std::uint32_t>(solves);
      return;
    }
    const bool better = count < least;
    if (better) {
      least = count;
      patience = kPatience;
    }
    const bool all = better || patience-- > 0;
    for (std::size_t i = all ? 0 : count - 1; i < count; ++i) {
      Hold& hold = hold_[wrong[i]];
      if (hold != Hold::kSticks)
        hold = Hold::kSticks;
      else
        hold = force_[wrong[i]] > high_[wrong[i]] ? Hold::kSlipsIn : Hold::kSlipsOut;
    }
  }
  state_.solves = kMaxSolves;
  ++state_.unsettled;
  // clamp in any case: the remainder is slip in this tick
  for (std::size_t n = 0; n < count_; ++n) force_[n] = std::clamp(force_[n], low_[n], high_[n]);
}

NeedleForce Contact::finish() {
  NeedleState& state = state_;
  double shaft_N = 0;
  std::fill_n(state.moved_m.begin(), stations_, 0.0);
  for (std::size_t i = 0; i < stations_; ++i) {
    const bool inside = i < shaft_;
    state.shaft_N[i] = inside ? std::clamp(force_[i], low_[i], high_[i]) : 0.0;
    state.hold[i] = inside ? hold_[i] : Hold::kSlipsIn;
    if (state.shaft_N[i] == 0.0) continue;
    shaft_N += state.shaft_N[i];
    addScaled(state.moved_m.data(), compliance_.give_m_per_N.data() + i * stations_, state.shaft_N[i],
              stations_);
  }
  state.tip_N = std::clamp(force_[shaft_], low_[shaft_], high_[shaft_]);
  state.tip_hold = hold_[shaft_];
  if (state.tip_N != 0.0) addScaled(state.moved_m.data(), tip_column_.data(), state.tip_N, stations_);

  // the tip: moving more than the tissue cuts, moving less leaves a gap
  state.tip_moved_m = meanOver(spread_, state.moved_m.data());
  const double slip = rest_[shaft_];
  state.gap_m = state.tip_hold == Hold::kSticks ? 0.0 : std::max(0.0, -slip);
  bool releases = state.tip_hold == Hold::kSlipsIn && high_[shaft_] < state.tip_most_N - kForceNear_N;
  if (state.tip_hold == Hold::kSlipsIn && slip > 0.0) {
    const double beyond =
        pose_.x_m - state.tip_moved_m - needle_.tip_give_m_per_N * state.tip_N - state.cut_m;
    const double with_needle = 2.0 * std::fabs(pose_.x_m - state.x_m);
    const double most = std::max(with_needle, kCutAhead * compliance_.spacing_m);
    const double advance = std::clamp(beyond, 0.0, std::min(4.0 * slip, most));
    releases = releases || advance > with_needle;
    state.cut_m += advance;
  }
  state.tip_most_N = high_[shaft_];
  state.x_m = pose_.x_m;
  return {-state.tip_N, -shaft_N, releases};
}

}  // namespace

void LayerIntegral::add(double top_m, double rate) {
  assert(count_ < kMaxLayers && (count_ == 0 || top_m >= top_m_[count_ - 1]));
  const double sum = count_ == 0 ? 0.0 : sum_[count_ - 1] + rate_[count_ - 1] * (top_m - top_m_[count_ - 1]);
  top_m_[count_] = top_m;
  rate_[count_] = rate;
  sum_[count_] = sum;
  ++count_;
}

double LayerIntegral::upTo(double depth_m) const noexcept {
  assert(count_ > 0);
  std::uint32_t n = count_ - 1;
  while (n > 0 && depth_m < top_m_[n]) --n;
  return sum_[n] + rate_[n] * (depth_m - top_m_[n]);
}

FemNeedle compileNeedle(const SceneSpec& spec) {
  assert(spec.fem.compliance != nullptr && spec.fem.layers.size() == spec.layers.size());
  FemNeedle needle;
  needle.compliance = spec.fem.compliance;
  const NeedleCompliance& compliance = *needle.compliance;
  double top = 0;
  for (std::size_t i = 0; i < spec.layers.size(); ++i) {
    needle.cutting_N_m.add(top, spec.fem.layers[i].cutting_N);
    needle.friction_N.add(top, spec.fem.layers[i].friction_N_per_m);
    top += spec.layers[i].thickness_m;
  }
  const std::size_t stations = compliance.stations();
  assert(stations > 0 && stations <= kMaxNeedleStations);
  assert(compliance.give_m_per_N.size() == stations * stations);
  double mean_give = 0;
  for (std::size_t i = 0; i < stations; ++i) {
    const double from = static_cast<double>(i) * compliance.spacing_m;
    needle.station_friction_N[i] =
        needle.friction_N.upTo(from + compliance.spacing_m) - needle.friction_N.upTo(from);
    mean_give += compliance.give(i, i) / static_cast<double>(stations);
  }
  needle.bevel_m = 2 * compliance.radius_m;
  needle.contact_m = kBevelPerDiameter * 2 * compliance.radius_m;
  // keeps the tip's equation independent of the shaft's when everything sticks
  needle.tip_give_m_per_N = 0.01 * mean_give;

  std::vector<double> matrix = compliance.give_m_per_N, force(stations, 1.0);
  solvePositive(matrix.data(), stations, stations, force.data());
  for (const double f : force) needle.stiffness_N_per_m += f;
  return needle;
}

NeedleForce stepNeedle(const FemNeedle& needle, const NeedlePose& pose, NeedleState& state) noexcept {
  Contact contact(needle, pose, state);
  contact.solve();
  return contact.finish();
}

double tipGive_m_per_N(const FemNeedle& needle, double depth_m) noexcept {
  const NeedleCompliance& compliance = *needle.compliance;
  const TipSpread spread = spreadAt(depth_m, needle.contact_m, compliance);
  double give = needle.tip_give_m_per_N;
  for (std::size_t a = 0; a < spread.count; ++a)
    for (std::size_t b = 0; b < spread.count; ++b)
      give += spread.weight[a] * spread.weight[b] * compliance.give(spread.first + a, spread.first + b);
  return give;
}

double storedEnergy(const FemNeedle& needle, const NeedleState& state) noexcept {
  assert(state.stations == 0 || state.stations == needle.compliance->stations());
  double twice = needle.tip_give_m_per_N * state.tip_N * state.tip_N;
  for (std::size_t i = 0; i < state.stations; ++i) twice += state.shaft_N[i] * state.moved_m[i];
  twice += state.tip_N * state.tip_moved_m;
  return 0.5 * twice;
}

}  // namespace needlelab
