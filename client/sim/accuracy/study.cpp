#include "client/sim/accuracy/study.h"

namespace needlelab {

const std::vector<AccuracyStudy>& accuracyStudies() {
  static const std::vector<AccuracyStudy> studies = {
      {Comparator::kVerification, verificationRows},
      {Comparator::kRefinement, refinementRows},
      {Comparator::kValidation, validationRows},
      {Comparator::kReplay, replayRows},
  };
  return studies;
}

}  // namespace needlelab
