/// Fitting a model that is a program rather than a formula: a search without derivatives, and the error
/// against digitised curves.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace needlelab {

/// A number to fit, with its bounds and the first step of the search.
struct FitParameter {
  std::string name;
  double start = 0, low = 0, high = 0, step = 0;
};

struct FitResult {
  std::vector<double> values;
  double cost = 0;
  int evaluations = 0;
};

/// Pattern search (Hooke and Jeeves, J. ACM 8, 1961): tries each parameter up and down, repeats a move that
/// helped, and halves a parameter's steps where neither helps, until all are below `shrink_to` of their first
/// size or `most_evaluations` are spent. Needs no derivative, so ruptures and layer changes (which jump) do
/// not stop it; finds the nearest valley only. Same inputs give the same result. Costs that are not finite
/// count as infinite.
FitResult patternSearch(const std::function<double(const std::vector<double>&)>& cost,
                        const std::vector<FitParameter>& parameters, int most_evaluations,
                        double shrink_to = 1.0 / 256);

/// One place of a curve: the mean of what was digitised there.
struct CurveBin {
  double at = 0;       ///< mean depth or time of its rows
  double value = 0;    ///< mean of its rows
  double scatter = 0;  ///< rms of its rows about that mean
  int block = 0;       ///< floor(at / block width)
  std::vector<std::size_t> rows;
};

/// Rows (at, value), ordered by `at`, in bins of `width` that do not straddle blocks of `block_width` (a
/// multiple of `width`). A curve that was digitised has many rows where it is steep: bins weigh its parts
/// alike.
std::vector<CurveBin> binned(const std::vector<double>& at, const std::vector<double>& value, double width,
                             double block_width);

struct CurveError {
  double rms = 0, max = 0;
  double rows_rms = 0;  ///< over the single rows, not the bins' means
  double floor = 0;  ///< rms of the rows about their bins' means: no function of `at` can do better by rows
  std::size_t bins = 0, rows = 0;
};

/// Error of `model` (its value at each row) over those bins for which `use` says so: per bin the mean of
/// model − row.
CurveError curveError(const std::vector<CurveBin>& bins, const std::vector<double>& value,
                      const std::vector<double>& model, const std::function<bool(const CurveBin&)>& use);

}  // namespace needlelab
