/// A patient's body as the engine asks it: where the skin is, which layers a straight needle meets, where
/// bone is. common/anatomy implements it. The haptic thread asks only pieces of it.
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
  kBone,   ///< the last layer is bone (AtBone::kEnds)
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

/// Whether a march ends at the first bone.
enum class AtBone : std::uint8_t { kEnds, kGoesOn };

/// The bones of a body, of which a ball is asked often: everywhere right, in the ball fast. In the frame L.
/// Immutable; a tick may ask it: nothing allocates, locks or throws.
class Bones {
 public:
  virtual ~Bones() = default;
  /// A signed distance from the nearest bone, negative in it: exact at its surface; elsewhere its size is at
  /// most kMostSteep times the distance, and its sign is right.
  [[nodiscard]] virtual double distance(Vec3 p_m) const noexcept = 0;
  /// How the distance changes per length; near its surface, along the normal out of the bone. Zero where that
  /// is undefined.
  [[nodiscard]] virtual Vec3 slope(Vec3 p_m) const noexcept = 0;
  /// The structure of the bone nearest to a place on a surface.
  [[nodiscard]] virtual StructureIndex structureAt(Vec3 p_m) const noexcept = 0;
};

/// A signed distance, negative in what it is from, and how it changes per length.
struct DistanceAt {
  double distance_m = 0;
  Vec3 slope;
};

/// The skin and the bones about a place: a piece of a body, right in a ball, where all pieces give the same
/// bits. In the frame L. Immutable; a tick may ask it: nothing allocates, locks or throws.
class Surroundings {
 public:
  virtual ~Surroundings() = default;
  [[nodiscard]] virtual DistanceAt skin(Vec3 p_m) const noexcept = 0;
  /// Infinite where there is no bone; at most kMostSteep times the distance.
  [[nodiscard]] virtual DistanceAt bone(Vec3 p_m) const noexcept = 0;
  /// Where `within` makes one.
  struct Room {
    alignas(std::max_align_t) std::array<std::byte, 8192> bytes;
  };
  /// The same in a ball within this one's, made in `room`: it lives as long, and no longer than this.
  [[nodiscard]] virtual const Surroundings& within(Vec3 center_m, double radius_m,
                                                   Room& room) const noexcept = 0;
};

/// A distance of a body changes by at most this per length: √(1 + ½²) (common/anatomy/field.cpp).
inline constexpr double kMostSteep = 1.118033988749895;

/// Places and directions are in the body's own frame L. Any number of threads may ask at once.
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
  [[nodiscard]] virtual LayerStack layersAlong(Vec3 from_m, Vec3 axis, double reach_m, double min_layer_m,
                                               AtBone at_bone) const noexcept = 0;
  /// The bones, for a tip in this ball. Null if the body has none. It lives no longer than the body, and
  /// allocates.
  [[nodiscard]] virtual std::shared_ptr<const Bones> bonesIn(Vec3 center_m, double radius_m) const = 0;
  /// Skin and bones in this ball. It lives no longer than the body, and allocates.
  [[nodiscard]] virtual std::shared_ptr<const Surroundings> around(Vec3 center_m, double radius_m) const = 0;
};

}  // namespace needlelab
