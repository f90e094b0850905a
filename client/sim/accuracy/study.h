/// The studies of the accuracy report. Each part is a function that gives rows; the list is in studies.cpp.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/accuracy/row.h"
#include "common/base/result.h"

namespace needlelab {

/// What every study is asked with.
struct AccuracyOptions {
  bool long_form = false;      ///< more seeds, more repeats, larger meshes: minutes instead of seconds
  std::filesystem::path data;  ///< folder of the recordings (DESIGN: ../shared/data); empty = not there
};

/// Told now and then by a study: what it does, and the share of its work that is done (0-1).
using AccuracyProgress = std::function<void(std::string_view doing, double share)>;

/// One part of the report. Parts of one study differ in reference or scene.
struct AccuracyPart {
  AccuracyStudy study;
  std::string_view name;  ///< of the part, e.g. "scene profile"
  /// Rows in the order in which they are shown. Without the data that it needs: no rows, and a remark by
  /// `note`. Thread: one. Deterministic but for what it measures in time.
  Result<AccuracyRows> (*run)(const AccuracyOptions& options, const AccuracyProgress& progress,
                              std::vector<std::string>& notes);
};

/// All parts, in the order of the report.
const std::vector<AccuracyPart>& accuracyParts();

}  // namespace needlelab
