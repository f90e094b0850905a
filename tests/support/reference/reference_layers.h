/// The layers along a straight line through a limb, found by search (FORCE_MODEL.md, "Contact"): the judge of
/// the engine's closed forms.
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "common/haptics/scene_spec.h"

namespace needlelab::test {

/// The layer at each distance from P0 along a line in direction u.
class ReferenceLayers {
 public:
  ReferenceLayers() = default;
  /// `slant` is the line's c; `depth_at` gives δ.
  ReferenceLayers(const SceneSpec& scene, const std::function<double(Vec3)>& depth_at, Vec3 p_entry_W_m,
                  Vec3 u_W, double slant);

  /// ∫₀^d of a layer's number ds; for d < 0 the first part extends before P0.
  [[nodiscard]] double integral(double d_m, const std::function<double(const LayerSpec&)>& number) const;
  /// ∫₀^d min(∫₀^s number dt, most) ds.
  [[nodiscard]] double integralOfIntegral(double d_m, const std::function<double(const LayerSpec&)>& number,
                                          double most) const;
  /// Where the line is deepest; infinite under a plane.
  [[nodiscard]] double deepest() const { return deepest_m_; }

 private:
  std::vector<LayerSpec> layers_;
  std::vector<std::pair<double, int>> parts_;  ///< end, and the index in `layers_` or −1
  double deepest_m_ = 0;
};

}  // namespace needlelab::test
