/// The comparators of the accuracy report: each is a function that returns rows; study.cpp lists them.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/accuracy/row.h"
#include "client/sim/benchmark/curve_set.h"
#include "common/base/result.h"

namespace needlelab {

struct AccuracyOptions {
  bool long_form = false;      ///< more gestures, finer meshes: minutes
  std::filesystem::path data;  ///< folder of the recordings; empty if missing
};

/// Called now and then with the current work and the finished share of the comparator (0-1).
using AccuracyProgress = std::function<void(std::string_view doing, double share)>;

/// One comparator. Returns rows in display order; if its data are missing, no rows and a remark in `notes`
/// that names the setting. Deterministic. Thread: one.
struct AccuracyStudy {
  Comparator comparator;
  Result<AccuracyRows> (*run)(const AccuracyOptions& options, const AccuracyProgress& progress,
                              std::vector<std::string>& notes);
};
const std::vector<AccuracyStudy>& accuracyStudies();

/// All models with a quasi-static formula (closed_form.h), at 250 Hz to 4 kHz and with encoder steps of 1 to
/// 50 µm; STATISTICAL by its distribution.
Result<AccuracyRows> verificationRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes);

/// FEM on increasingly fine meshes for several numbers of stations, at the same E, compared with the finest.
Result<AccuracyRows> refinementRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                    std::vector<std::string>& notes);

/// Models fitted to measured curves and judged on held-out parts, with baselines; hold and withdrawal.
Result<AccuracyRows> validationRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                    std::vector<std::string>& notes);
/// The part about insertions, for any set of curves.
Result<AccuracyRows> insertionRows(const CurveSet& set, const AccuracyProgress& progress);

/// All models at equal stiffness along recorded hands.
Result<AccuracyRows> replayRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                std::vector<std::string>& notes);

}  // namespace needlelab
