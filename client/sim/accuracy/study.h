/// The comparators of the accuracy report: each is a function that gives rows; the list is in study.cpp.
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
  std::filesystem::path data;  ///< folder of the recordings; empty = not there
};

/// Called now and then with the current work and the share of the comparator's work that is done (0-1).
using AccuracyProgress = std::function<void(std::string_view doing, double share)>;

/// One comparator. Rows in display order; if its data are missing: no rows, and a remark in `notes` that
/// names the setting. Deterministic. Thread: one.
struct AccuracyStudy {
  Comparator comparator;
  Result<AccuracyRows> (*run)(const AccuracyOptions& options, const AccuracyProgress& progress,
                              std::vector<std::string>& notes);
};
const std::vector<AccuracyStudy>& accuracyStudies();

/// Every model whose quasi-static answer is a formula (closed_form.h), at 250 Hz to 4 kHz and with encoder
/// steps of 1 to 50 µm; STATISTICAL by its distribution.
Result<AccuracyRows> verificationRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes);

/// FEM on meshes of growing nodes for several numbers of stations, at the same E, against the finest.
Result<AccuracyRows> refinementRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                    std::vector<std::string>& notes);

/// Models fitted to measured curves, judged on what was held out, with baselines; hold and withdrawal.
Result<AccuracyRows> validationRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                    std::vector<std::string>& notes);
/// Its part about insertions, for any set of curves.
Result<AccuracyRows> insertionRows(const CurveSet& set, const AccuracyProgress& progress);

/// Every model at equal stiffness along recorded hands.
Result<AccuracyRows> replayRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                std::vector<std::string>& notes);

}  // namespace needlelab
