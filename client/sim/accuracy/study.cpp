#include "client/sim/accuracy/study.h"
#include "client/sim/accuracy/recorded.h"

namespace needlelab {

CostEffort costEffort(const AccuracyOptions& options) {
  if (options.effort) return *options.effort;
  CostEffort effort;
  if (options.long_form) effort.flushed = 51, effort.slept = 1000;
  if (options.full) effort.hot = 20'000, effort.flushed = 501, effort.slept = 20'000;
  return effort;
}

const std::vector<AccuracyPart>& accuracyParts() {
  static const std::vector<AccuracyPart> parts = {
      {AccuracyStudy::kModel, "scene profile", modelProfileStudy},
      {AccuracyStudy::kModel, "finest FEM", modelFemStudy},
      {AccuracyStudy::kModel, "FEM as a table", tableRows},
      {AccuracyStudy::kModel, "recorded force over depth", recordedCurveRows},
      {AccuracyStudy::kModel, "recorded hold and withdrawal", recordedHoldRows},
      {AccuracyStudy::kModel, "recorded puncture of a film", recordedFilmRows},
      {AccuracyStudy::kModel, "statistical draws", statisticalRows},
      {AccuracyStudy::kModel, "epidural polynomials", epiduralRows},
      {AccuracyStudy::kMesh, "size of the FEM mesh", meshRows},
      {AccuracyStudy::kRate, "rate of the loop", rateStudy},
      {AccuracyStudy::kStorage, "stored resolution", storageStudy},
      {AccuracyStudy::kLive, "live frames", liveStudy},
  };
  return parts;
}

}  // namespace needlelab
