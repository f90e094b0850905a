#include "haptics/models/axial_entry.h"

#include "haptics/axial_model.h"

namespace needlelab {

const AxialEntry& axialEntry(AxialModel model) {
  switch (model) {
    case AxialModel::kEnhancedTrackingWall:
      return kTrackingWallEntry;
    case AxialModel::kTrackingWall:
      return kPlainWallEntry;
    case AxialModel::kDirect:
      return kDirectEntry;
    case AxialModel::kVoigt:
    case AxialModel::kGodObject:
    case AxialModel::kFirstOrder:
    case AxialModel::kStatistical:
    case AxialModel::kPrecomputed:
    case AxialModel::kFem:
      break;
  }
  return kNotBuiltEntry;
}

}  // namespace needlelab
