#include "client/sim/accuracy/recorded_rows.h"

namespace needlelab {

Result<AccuracyRows> recordedRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                  std::vector<std::string>& notes) {
  AccuracyRows all;
  for (const auto part :
       {recordedCurveRows, recordedHoldRows, recordedFilmRows, statisticalRows, epiduralRows}) {
    auto rows = part(options, progress, notes);
    if (!rows.ok()) return rows.error();
    all.insert(all.end(), rows->begin(), rows->end());
  }
  return all;
}

}  // namespace needlelab
