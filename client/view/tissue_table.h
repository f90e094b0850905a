/// The tissues' colours over depth, as a picture for the cut. Private to this folder.
#pragma once

#include "client/view/model/image.h"
#include "client/view/model/scene_view.h"

namespace needlelab {

inline constexpr int kTableDepths = 768, kTableAlong = 128;
inline constexpr double kTablePeriod_m = 0.024;  ///< along the layers, then it repeats

/// x: depth from 0 to `deepest_m`; y: along the layers, without a seam. Each tissue has its colour and a
/// grain of its own (lobes of fat, fibres of muscle and tendon), layers end with a dark line. Deterministic.
RgbaImage tissueTable(const SceneView& scene, double deepest_m);
/// The last layer's bottom.
double deepestLayer_m(const SceneView& scene);

}  // namespace needlelab
