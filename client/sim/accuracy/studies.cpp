#include "client/sim/accuracy/fem_study.h"
#include "client/sim/accuracy/live_study.h"
#include "client/sim/accuracy/model_study.h"
#include "client/sim/accuracy/rate_study.h"
#include "client/sim/accuracy/recorded_rows.h"
#include "client/sim/accuracy/storage_study.h"
#include "client/sim/accuracy/study.h"

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
