#include "client/sim/curves/curve_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/base/time/clock.h"

namespace needlelab {
FitResult patternSearch(const std::function<double(const std::vector<double>&)>& cost,
                        const std::vector<FitParameter>& parameters, int max_evaluations, double shrink_to) {
  FitResult best;
  std::vector<double> steps;
  for (const FitParameter& p : parameters) {
    best.values.push_back(std::clamp(p.start, p.low, p.high));
    steps.push_back(p.step);
  }
  const auto evaluate = [&](const std::vector<double>& values) {
    ++best.evaluations;
    const double c = cost(values);
    return std::isfinite(c) ? c : std::numeric_limits<double>::infinity();
  };
  best.cost = evaluate(best.values);

  // One parameter at a time: a move that helps is kept and its step grows; otherwise the step shrinks.
  std::vector<double> before = best.values;
  while (best.evaluations < max_evaluations) {
    bool fine = true;
    for (std::size_t i = 0; i < parameters.size() && best.evaluations < max_evaluations; ++i) {
      if (steps[i] < shrink_to * parameters[i].step) continue;
      fine = false;
      bool helped = false;
      for (const double sign : {1.0, -1.0}) {
        std::vector<double> tried = best.values;
        tried[i] = std::clamp(tried[i] + sign * steps[i], parameters[i].low, parameters[i].high);
        if (tried[i] == best.values[i]) continue;
        const double c = evaluate(tried);
        if (c < best.cost) {
          best.cost = c;
          best.values = std::move(tried);
          helped = true;
          break;
        }
      }
      steps[i] *= helped ? 1.5 : 0.5;
    }
    if (fine) break;

    // pattern move: repeats all of the round's changes
    std::vector<double> tried = best.values;
    for (std::size_t i = 0; i < tried.size(); ++i)
      tried[i] = std::clamp(2 * tried[i] - before[i], parameters[i].low, parameters[i].high);
    before = best.values;
    if (tried == best.values) continue;
    const double c = evaluate(tried);
    if (c < best.cost) {
      best.cost = c;
      best.values = std::move(tried);
    }
  }
  return best;
}

std::vector<CurveBin> binned(const std::vector<double>& at, const std::vector<double>& value, double width,
                             double block_width) {
  std::vector<CurveBin> bins;
  const int per_block = std::max(1, static_cast<int>(std::lround(block_width / width)));
  int last = std::numeric_limits<int>::min();
  for (std::size_t i = 0; i < at.size(); ++i) {
    const int block = static_cast<int>(std::floor(at[i] / block_width));
    const int part = std::min(per_block - 1, static_cast<int>((at[i] - block * block_width) / width));
    const int bin = block * per_block + part;
    if (bins.empty() || bin != last) {
      bins.emplace_back();
      bins.back().block = block;
      last = bin;
    }
    bins.back().rows.push_back(i);
  }
  for (CurveBin& bin : bins) {
    const auto count = static_cast<double>(bin.rows.size());
    for (const std::size_t row : bin.rows) {
      bin.at += at[row] / count;
      bin.value += value[row] / count;
    }
    double squares = 0;
    for (const std::size_t row : bin.rows)
      squares += (value[row] - bin.value) * (value[row] - bin.value) / count;
    bin.scatter = std::sqrt(squares);
  }
  return bins;
}

CurveError curveError(const std::vector<CurveBin>& bins, const std::vector<double>& value,
                      const std::vector<double>& model, const std::function<bool(const CurveBin&)>& use) {
  CurveError error;
  double squares = 0, row_squares = 0, scatter = 0;
  for (const CurveBin& bin : bins) {
    if (!use(bin)) continue;
    double mean = 0;
    for (const std::size_t row : bin.rows) {
      const double off = model[row] - value[row];
      mean += off / static_cast<double>(bin.rows.size());
      row_squares += off * off;
      scatter += (value[row] - bin.value) * (value[row] - bin.value);
    }
    squares += mean * mean;
    error.max = std::max(error.max, std::fabs(mean));
    ++error.bins;
    error.rows += bin.rows.size();
  }
  if (error.bins == 0) return error;
  error.rms = std::sqrt(squares / static_cast<double>(error.bins));
  error.rows_rms = std::sqrt(row_squares / static_cast<double>(error.rows));
  error.floor = std::sqrt(scatter / static_cast<double>(error.rows));
  return error;
}

void runStraight(const SceneModel& model, const StraightGesture& gesture, AxialRun& run) {
  // half a turn about x: the tip frame's z axis points to −z of W
  constexpr Quat kDown{1, 0, 0, 0};
  SimState state{};
  StepReport report;
  run.force_N.resize(gesture.depth_m.size());
  run.flags.resize(gesture.depth_m.size());
  for (std::size_t i = 0; i < gesture.depth_m.size(); ++i) {
    step(model, {{0, 0, -gesture.depth_m[i]}, kDown}, state, report);
    run.force_N[i] = report.wrench_W.force_N.z;
    run.flags[i] = report.flags;
  }
}

Result<AxialRun> runStraight(const SceneSpec& scene, const StraightGesture& gesture) {
  ASSIGN_OR_RETURN(const auto model, compile(scene, gesture.rate_hz));
  AxialRun run;
  runStraight(model, gesture, run);
  return run;
}

StraightGesture constantSpeed(double from_m, double to_m, double speed_mps, double rate_hz) {
  StraightGesture gesture{rate_hz, {}};
  const double step_m = speed_mps / rate_hz;
  const auto ticks = static_cast<std::size_t>(std::ceil((to_m - from_m) / step_m)) + 1;
  for (std::size_t i = 0; i < ticks; ++i) gesture.depth_m.push_back(from_m + static_cast<double>(i) * step_m);
  return gesture;
}

double forceAtTick(const AxialRun& run, double tick) {
  if (run.force_N.empty()) return 0;
  const double held = std::clamp(tick, 0.0, static_cast<double>(run.force_N.size() - 1));
  const auto before = static_cast<std::size_t>(held);
  const std::size_t after = std::min(before + 1, run.force_N.size() - 1);
  return std::lerp(run.force_N[before], run.force_N[after], held - static_cast<double>(before));
}

SceneSpec fittedSceneBase() {
  SceneSpec scene;
  scene.needle_length_m = 1;
  scene.max_force_N = 50;
  scene.tracking_wall.stop_speed_mps = 0.001;
  return scene;
}

double hotTickTime_ns(const SceneModel& model, const StraightGesture& gesture) {
  constexpr Quat kDown{1, 0, 0, 0};
  constexpr std::size_t kTicks = 2000;
  SimState state{};
  StepReport report;
  std::size_t next = 0;
  const auto tick = [&] {
    step(model, {{0, 0, -gesture.depth_m[next]}, kDown}, state, report);
    keep(report);
    if (++next == gesture.depth_m.size()) next = 0;
  };
  const auto median_ns = [](auto&& operation) {
    for (int i = 0; i < 200; ++i) operation();
    std::vector<std::int64_t> single_ns;
    for (std::size_t i = 0; i < kTicks; ++i) {
      const std::int64_t from_ns = steadyNowNs();
      operation();
      single_ns.push_back(steadyNowNs() - from_ns);
    }
    std::nth_element(single_ns.begin(), single_ns.begin() + kTicks / 2, single_ns.end());
    return static_cast<double>(single_ns[kTicks / 2]);
  };
  return std::max(0.0, median_ns(tick) - median_ns([] {}));
}

}  // namespace needlelab
