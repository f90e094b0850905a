#include "client/sim/accuracy/recorded_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace needlelab {

FitResult patternSearch(const std::function<double(const std::vector<double>&)>& cost,
                        const std::vector<FitParameter>& parameters, int most_evaluations, double shrink_to) {
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

  // one parameter after the other: a move that helps is kept and its step grows, one that does not shrinks it
  std::vector<double> before = best.values;
  while (best.evaluations < most_evaluations) {
    bool fine = true;
    for (std::size_t i = 0; i < parameters.size() && best.evaluations < most_evaluations; ++i) {
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

    // the pattern move: all of the round's changes once more
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

}  // namespace needlelab
