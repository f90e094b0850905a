#include "client/sim/stability/loop/measures.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace needlelab {
namespace {

/// A second-order section in transposed direct form II.
struct Section {
  double b0 = 1, b1 = 0, b2 = 0, a1 = 0, a2 = 0;
  double s1 = 0, s2 = 0;
  double next(double in) {
    const double out = b0 * in + s1;
    s1 = b1 * in - a1 * out + s2;
    s2 = b2 * in - a2 * out;
    return out;
  }
};

// Pole pair `i` of a Butterworth filter has 1/Q = 2 sin((2i + 1)π/(2·order)).
Section section(double corner_hz, double rate_hz, int order, int i, bool high_pass) {
  const double k = std::tan(std::numbers::pi * corner_hz / rate_hz);
  const double inverse_q = 2 * std::sin((2 * i + 1) * std::numbers::pi / (2 * order));
  const double norm = 1 / (1 + k * inverse_q + k * k);
  Section s;
  s.b0 = high_pass ? norm : k * k * norm;
  s.b1 = high_pass ? -2 * s.b0 : 2 * s.b0;
  s.b2 = s.b0;
  s.a1 = 2 * (k * k - 1) * norm;
  s.a2 = (1 - k * inverse_q + k * k) * norm;
  return s;
}

double acRms(std::span<const double> signal) {
  if (signal.empty()) return 0;
  double mean = 0;
  for (const double value : signal) mean += value / static_cast<double>(signal.size());
  double sum = 0;
  for (const double value : signal) sum += (value - mean) * (value - mean);
  return std::sqrt(sum / static_cast<double>(signal.size()));
}

// How much a report's force components fell at a declared release; a rise does not count as one.
double declaredFall_N(const StepReport& before, const StepReport& now) {
  if ((now.flags & kDeclaredReleases) == 0) return 0;
  // an attracted force that ends may uncover opposing friction: the sum changes sign although nothing rose
  double fall_N = 0;
  for (double StepReport::*part : {&StepReport::cutting_N, &StepReport::attracted_N, &StepReport::friction_N,
                                   &StepReport::puncture_N, &StepReport::clamping_N}) {
    const double from_N = before.*part, to_N = now.*part;
    fall_N += from_N * to_N < 0 ? std::abs(from_N) : std::max(0.0, std::abs(from_N) - std::abs(to_N));
  }
  return fall_N;
}

}  // namespace

std::span<const PlantTick> ticksIn(const PlantRun& run, TimeWindow window) {
  const auto at = [&](double time_s) {
    return std::lower_bound(run.ticks.begin(), run.ticks.end(), time_s - 1e-9,
                            [](const PlantTick& tick, double t) { return tick.time_s < t; });
  };
  const auto from = at(window.from_s), to = std::max(from, at(window.to_s));
  return {from, to};
}

std::vector<double> forceAlong(std::span<const PlantTick> ticks, Vec3 direction) {
  std::vector<double> force;
  force.reserve(ticks.size());
  for (const PlantTick& tick : ticks) force.push_back(dot(tick.report.wrench_W.force_N, direction));
  return force;
}

double peakToPeak(std::span<const double> signal) {
  if (signal.empty()) return 0;
  const auto [least, most] = std::minmax_element(signal.begin(), signal.end());
  return *most - *least;
}

double rmsOf(std::span<const double> signal) {
  double sum = 0;
  for (const double value : signal) sum += value * value;
  return signal.empty() ? 0 : std::sqrt(sum / static_cast<double>(signal.size()));
}

std::vector<double> aboutSlowPart(std::span<const double> signal, std::size_t around) {
  std::vector<double> sum(signal.size() + 1, 0.0), out;
  for (std::size_t i = 0; i < signal.size(); ++i) sum[i + 1] = sum[i] + signal[i];
  for (std::size_t i = 0; i < signal.size(); ++i) {
    const std::size_t reach = std::min({around, i, signal.size() - 1 - i});
    out.push_back(signal[i] - (sum[i + reach + 1] - sum[i - reach]) / static_cast<double>(2 * reach + 1));
  }
  return out;
}

std::vector<double> bandPassed(std::span<const double> signal, double rate_hz, const BandFilter& band) {
  std::vector<Section> sections;
  for (int i = 0; i < band.order / 2; ++i) {
    sections.push_back(section(band.low_hz, rate_hz, band.order, i, true));
    if (band.high_hz < 0.5 * rate_hz)
      sections.push_back(section(band.high_hz, rate_hz, band.order, i, false));
  }
  std::vector<double> out;
  out.reserve(signal.size());
  // a high-pass at rest has zero output for constant input, so subtract the first value
  for (const double value : signal) {
    double passed = value - signal.front();
    for (Section& s : sections) passed = s.next(passed);
    out.push_back(passed);
  }
  return out;
}

double chatterOf(const PlantRun& run, Vec3 direction, TimeWindow window, const BandFilter& band) {
  const auto passed = bandPassed(forceAlong(run.ticks, direction), run.rate_hz, band);
  const auto ticks = ticksIn(run, window);
  if (ticks.empty()) return 0;
  return rmsOf(
      std::span(passed).subspan(static_cast<std::size_t>(ticks.data() - run.ticks.data()), ticks.size()));
}

int stopsIn(std::span<const PlantTick> ticks, Phase before) {
  int stops = 0;
  for (const PlantTick& tick : ticks) {
    stops += tick.report.phase == Phase::kStopped && before != Phase::kStopped;
    before = tick.report.phase;
  }
  return stops;
}

bool allFinite(const PlantRun& run) {
  return std::all_of(run.ticks.begin(), run.ticks.end(), [](const PlantTick& tick) {
    return isFinite(tick.report.wrench_W.force_N) && isFinite(tick.report.wrench_W.torque_Nm) &&
           isFinite(tick.p_W_m) && std::isfinite(tick.energy_J);
  });
}

double maxForce_N(const PlantRun& run) {
  double most = 0;
  for (const PlantTick& tick : run.ticks) most = std::max(most, norm(tick.report.wrench_W.force_N));
  return most;
}

std::optional<double> greatestInASecond_J(std::span<const PlantTick> ticks, double rate_hz) {
  const auto second = static_cast<std::size_t>(rate_hz + 0.5);
  if (ticks.size() < 2 * second) return std::nullopt;
  double more_J = 0, most_J = 0;  // the sum over the later second minus that over the earlier one
  for (std::size_t k = 0; k < ticks.size(); ++k) {
    more_J += ticks[k].grip_J;
    if (k >= second) more_J -= 2 * ticks[k - second].grip_J;
    if (k >= 2 * second) more_J += ticks[k - 2 * second].grip_J;
    if (k + 1 >= 2 * second) most_J = std::max(most_J, more_J / static_cast<double>(second));
  }
  return most_J;
}

double unexplainedStep_N(Vec3 p_before_m, const StepReport& before, Vec3 p_m, const StepReport& report,
                         double axial_stiffness_N_per_m, double slant) {
  const int times = (report.flags & kFlagTurn) != 0 ? 3 : 2;
  const double fixture_N_per_m =
      times * std::max(before.clamping_stiffness_N_per_m, report.clamping_stiffness_N_per_m);
  const double way_m = norm(p_m - p_before_m) / slant;
  // where the hole follows a needle that lies under the skin, the fixture gets shorter than by that way
  const bool both_inside = (report.flags & (kFlagEntry | kFlagExit)) == 0;
  const double length_m = both_inside ? std::fabs(report.insertion_m - before.insertion_m) : 0.0;
  const double step_N = norm(report.wrench_W.force_N - before.wrench_W.force_N);
  return std::max(0.0, step_N - axial_stiffness_N_per_m * way_m -
                           fixture_N_per_m * std::max(way_m, length_m) - declaredFall_N(before, report));
}

double maxUnexplainedStep_N(const PlantRun& run) {
  double most = 0;
  const PlantTick* before = nullptr;
  for (const PlantTick& tick : run.ticks) {
    if (!tick.stepped) continue;
    if (before != nullptr)
      most = std::max(most, unexplainedStep_N(before->seen.p_WT_m, before->report, tick.seen.p_WT_m,
                                              tick.report, run.axial_stiffness_N_per_m));
    before = &tick;
  }
  return most;
}

bool grows(std::span<const double> signal, double floor) {
  const std::size_t quarter = signal.size() / 4;
  if (quarter == 0) return false;
  // from quarter to quarter: a hand that comes to rest within the window grows once and then stays
  const double first = acRms(signal.first(quarter));
  double before = first, last = first;
  for (std::size_t i = 1; i < 4; ++i, before = last) {
    last = acRms(signal.subspan(i * quarter, quarter));
    if (!(last > 1.1 * before)) return false;
  }
  return last > floor && last > 1.5 * first;
}

}  // namespace needlelab
