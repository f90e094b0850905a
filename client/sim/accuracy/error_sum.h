/// Sums of errors over a run, and their spread over runs.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace needlelab {

/// Root mean square and greatest of errors that are added one after the other.
class ErrorSum {
 public:
  void add(double error) {
    square_ += error * error;
    max_ = std::max(max_, std::abs(error));
    ++count_;
  }
  [[nodiscard]] double rms() const {
    return count_ > 0 ? std::sqrt(square_ / static_cast<double>(count_)) : 0;
  }
  [[nodiscard]] double max() const { return max_; }
  [[nodiscard]] std::size_t count() const { return count_; }

 private:
  double square_ = 0, max_ = 0;
  std::size_t count_ = 0;
};

/// Several runs of the same kind, e.g. one a seed, each with the same weight.
class ErrorRuns {
 public:
  void add(const ErrorSum& run) {
    rms_.push_back(run.rms());
    max_ = std::max(max_, run.max());
  }
  /// Over all runs: root of the mean of their squares.
  [[nodiscard]] double rms() const {
    ErrorSum all;
    for (const double one : rms_) all.add(one);
    return all.rms();
  }
  [[nodiscard]] double max() const { return max_; }
  /// Standard deviation of the runs' rms (n − 1); 0 for one run.
  [[nodiscard]] double spread() const {
    if (rms_.size() < 2) return 0;
    double mean = 0, square = 0;
    for (const double one : rms_) mean += one / static_cast<double>(rms_.size());
    for (const double one : rms_) square += (one - mean) * (one - mean);
    return std::sqrt(square / static_cast<double>(rms_.size() - 1));
  }
  [[nodiscard]] std::size_t runs() const { return rms_.size(); }

 private:
  std::vector<double> rms_;
  double max_ = 0;
};

/// "rms ± 0.012 N (sd over 8 seeds)".
std::string spreadText(const ErrorRuns& runs, const char* of);

}  // namespace needlelab
