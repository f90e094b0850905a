/// A patient's body as the engine asks it: where the skin is, which layers a straight needle meets, where
/// bone is near. common/anatomy implements it; the engine asks it on the haptic thread only with the
/// needle's cap on.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "common/haptics/geometry.h"

namespace needlelab {

/// The index of a structure: of a scene's layers, in the order of the profile's volume.
using StructureIndex = std::uint8_t;
/// Outside of the skin.
inline constexpr StructureIndex kOutside = 0xFF;

/// The greatest number of layers of a stack: those of the engine.
inline constexpr std::size_t kMaxStackLayers = 32;

/// Why a stack ends.
enum class StackEnd : std::uint8_t {
  kReach,  ///< the needle is no longer
  kBone,   ///< the last layer is bone
  kExit,   ///< the line leaves the patient
  kFull,   ///< there are more layers than a stack holds
};

/// The layers along a line, from the skin inwards.
struct LayerStack {
  struct Layer {
    StructureIndex structure = kOutside;
    double top_m = 0;  ///< along the line, from where the march began
    friend bool operator==(const Layer&, const Layer&) = default;
  };
  std::array<Layer, kMaxStackLayers> layers{};
  std::size_t count = 0;
  double end_m = 0;  ///< along the line: where the last layer ends, or what is known of it
  StackEnd end = StackEnd::kReach;
};

/// A bone's surface near a point, as the plane that touches it.
struct BonePlane {
  Vec3 point_m;
  Vec3 normal;  ///< unit, out of the bone
  StructureIndex structure = kOutside;
  friend bool operator==(const BonePlane&, const BonePlane&) = default;
};

/// The greatest number of bones that a tip meets at once.
inline constexpr std::size_t kMaxBonePlanes = 3;

/// The bones near a point, the nearest first.
struct BonesNear {
  std::array<BonePlane, kMaxBonePlanes> planes{};
  std::size_t count = 0;
};

/// Places and directions are in the body's own frame L. Any number of threads may ask at once; nothing
/// allocates.
class Body {
 public:
  virtual ~Body() = default;
  /// δ: how deep a point is under the nearest skin; negative outside.
  [[nodiscard]] virtual double depth(Vec3 p_m) const noexcept = 0;
  /// The unit normal out of the body, at the skin nearest to a point. Zero where it is undefined.
  [[nodiscard]] virtual Vec3 normal(Vec3 p_m) const noexcept = 0;
  /// The structure at a point; kOutside outside of the skin.
  [[nodiscard]] virtual StructureIndex structureAt(Vec3 p_m) const noexcept = 0;
  /// The layers along the unit vector `axis`, up to `reach_m` (0, 1]. Layers thinner than `min_layer_m` go to
  /// the one before. Empty if the line is outside at its beginning.
  [[nodiscard]] virtual LayerStack layersAlong(Vec3 from_m, Vec3 axis, double reach_m,
                                               double min_layer_m) const noexcept = 0;
  /// The planes that touch the bones nearer than `within_m`, one for each structure.
  [[nodiscard]] virtual BonesNear bonesNear(Vec3 p_m, double within_m) const noexcept = 0;
};

}  // namespace needlelab
