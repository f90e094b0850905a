#include "haptics/models/axial_entry.h"

#include "haptics/axial_model.h"

namespace needlelab {

const AxialEntry& axialEntry(AxialModel model) {
  switch (model) {
    case AxialModel::kTrackingWall:
      return kPlainWallEntry;
    case AxialModel::kDirect:
      return kDirectEntry;
    case AxialModel::kEnhancedTrackingWall:
    default:
      break;
  }
  return kTrackingWallEntry;
}

}  // namespace needlelab
