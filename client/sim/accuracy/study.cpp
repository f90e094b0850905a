#include "client/sim/accuracy/study.h"
#include "client/sim/accuracy/recorded.h"

namespace needlelab {

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
