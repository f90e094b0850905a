#include "accuracy/recorded_rows.h"
#include "accuracy/study.h"

namespace needlelab {

const std::vector<AccuracyPart>& accuracyParts() {
  static const std::vector<AccuracyPart> parts = {
      {AccuracyStudy::kModel, "recorded force over depth", recordedCurveRows},
      {AccuracyStudy::kModel, "recorded hold and withdrawal", recordedHoldRows},
      {AccuracyStudy::kModel, "recorded puncture of a film", recordedFilmRows},
      {AccuracyStudy::kModel, "statistical draws", statisticalRows},
      {AccuracyStudy::kModel, "epidural polynomials", epiduralRows},
  };
  return parts;
}

}  // namespace needlelab
