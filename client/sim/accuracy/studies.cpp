#include "accuracy/study.h"

namespace needlelab {

const std::vector<AccuracyPart>& accuracyParts() {
  static const std::vector<AccuracyPart> parts = {};
  return parts;
}

}  // namespace needlelab
