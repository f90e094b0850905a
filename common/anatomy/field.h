/// A patient's anatomy, compiled: which structure lies at a point, and how far the next one is at least.
///
/// Shapes of a group are joined by the quadratic smooth minimum: with a blend of k,
/// min(a, b) − max(0, k − |a − b|)²/(4k) (Quilez, "smooth minimum"). Distances are Euclidean, but a capsule
/// of two radii takes its radius at the nearest point of its segment. All of it is + − × ÷ √ and comparisons,
/// so it has the same bits on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/anatomy/field_spec.h"
#include "common/haptics/body.h"

namespace needlelab {

/// A set of structures.
using StructureMask = std::uint32_t;
static_assert(kMaxFieldStructures <= 32);

/// Each bit stands for a structure.
constexpr StructureMask maskOf(StructureIndex structure) {
  return StructureMask{1} << structure;
}
/// Everything within the skin.
inline constexpr StructureMask kWholeBody = ~StructureMask{0};

/// All points from `low_m` to `high_m`; bounds may be infinite.
struct FieldBox {
  Vec3 low_m, high_m;
  [[nodiscard]] bool empty() const {
    return !(low_m.x < high_m.x && low_m.y < high_m.y && low_m.z < high_m.z);
  }
};
/// The points of both.
FieldBox common(const FieldBox& a, const FieldBox& b);

/// What a field says of a point.
struct FieldPoint {
  StructureIndex structure = kOutside;
  /// Every point nearer than this is of the same structure.
  double clearance_m = 0;
};

/// A signed distance, and how it changes per length: by formula, from one evaluation. Where two surfaces are
/// equally near it is the slope of one of them.
struct FieldSlope {
  double distance_m = 0;
  Vec3 slope;
};

/// Immutable after construction: any number of threads may ask at once. No function allocates but those that
/// say so.
class Field {
  struct Part;
  struct Rule;

 public:
  /// The parts of the field that matter on a stretch of a line. Asked outside of it, it answers wrong. Valid
  /// as long as its field.
  class Stretch {
   public:
    /// The same structure as Field's, from the same bits; the clearance is right within the stretch.
    [[nodiscard]] FieldPoint at(double t_m) const noexcept;

   private:
    friend class Field;
    const Field* field_ = nullptr;
    Vec3 origin_m_, axis_;
    std::array<double, kMaxFieldGroups> without_m_;  // each group's distance without the parts that matter
    std::array<std::uint16_t, kMaxFieldParts> parts_;
    std::size_t count_ = 0;
    std::uint32_t far_ = 0, deep_ = 0;  // groups that are far from all of the stretch, or hold it deep inside
  };

  /// A line, and where on it each part of the field begins and ends to matter. Valid as long as its field.
  class OnLine {
   public:
    /// From from_m to to_m, ends included. Asks each part near it once, so many short ones cost time.
    [[nodiscard]] Stretch between(double from_m, double to_m) const noexcept;
    /// The point at t_m of the line.
    [[nodiscard]] Vec3 point(double t_m) const noexcept { return origin_m_ + axis_ * t_m; }

   private:
    friend class Field;
    struct Reach {
      double from_m, to_m;
      std::uint16_t part;
    };
    const Field* field_ = nullptr;
    Vec3 origin_m_, axis_;
    std::array<Reach, kMaxFieldParts> reaches_;
    std::size_t count_ = 0;
  };

  /// The parts of the field that matter in a ball. Asked outside of it, it answers wrong. Valid as long as
  /// its field.
  class InBall {
   public:
    [[nodiscard]] FieldPoint at(Vec3 p_m) const noexcept;
    /// As Field's. Its size is at most √1.25 times the distance, within the ball.
    [[nodiscard]] double structuresDistance(StructureMask mask, Vec3 p_m) const noexcept;
    /// The distance of structuresDistance, the same bits, with its slope. For drawing: forces take normals
    /// from central differences (field_body.cpp).
    [[nodiscard]] FieldSlope slope(StructureMask mask, Vec3 p_m) const noexcept;
    /// The same values in a smaller ball, of fewer parts.
    [[nodiscard]] InBall inBall(Vec3 center_m, double radius_m) const noexcept;

   private:
    friend class Field;
    const Field* field_ = nullptr;
    std::array<std::uint16_t, kMaxFieldParts> parts_;
    std::size_t count_ = 0;
  };

  /// The distance from some structures, with its slope, and only the parts and rules that decide it in a
  /// ball. Valid as long as its field.
  class Piece {
   public:
    /// Exact up to the joins of shapes, at any distance from the surface (structuresDistance is not). The
    /// same bits in all balls that contain the point. Asked outside of the ball, it answers wrong.
    [[nodiscard]] FieldSlope at(Vec3 p_m) const noexcept;
    /// The same in a ball within this one's.
    [[nodiscard]] Piece within(Vec3 center_m, double radius_m) const noexcept;

   private:
    friend class Field;
    // a bound of a rule's range
    struct Bound {
      std::uint8_t rule, range, group;
      bool is_upper;
    };
    struct RuleBounds {
      std::uint16_t begin, end;
      bool is_asked;  // of a structure that is asked for; others take points from later rules
    };
    static constexpr std::size_t kMostBounds = 2 * kMaxFieldRules * (1 + kMaxRuleClips);
    void add(std::size_t rule, bool is_asked) noexcept;
    /// How far a distance is beyond a bound: negative within the range.
    [[nodiscard]] double beyond(const Bound& bound, double distance_m) const noexcept;
    static bool slopeBelow(const Part& part, Vec3 p_m, double bound_m, FieldSlope& to) noexcept;
    static double leastToEllipsoid(const Part& part, Vec3 p_m) noexcept;
    const Field* field_ = nullptr;
    std::array<std::uint16_t, kMaxFieldParts> parts_;
    std::array<RuleBounds, kMaxFieldRules + 1> rules_;
    std::array<Bound, kMostBounds> bounds_;
    std::size_t part_count_ = 0, rule_count_ = 0, bound_count_ = 0;
    bool skin_decides_ = true;
  };

  /// Errors: those of checkField.
  static Result<Field> make(const FieldSpec& spec);

  [[nodiscard]] FieldPoint at(Vec3 p_m) const noexcept;
  /// The signed distance from the skin: negative inside.
  [[nodiscard]] double skinDistance(Vec3 p_m) const noexcept;
  /// A signed distance from the points of some structures, negative in them: exact at their surface, and of
  /// the right sign elsewhere. Bit i stands for structure i. For normals and surfaces.
  [[nodiscard]] double structuresDistance(StructureMask mask, Vec3 p_m) const noexcept;
  /// The signed distance from a group, by its index in FieldSpec::groups; beyond what matters to any rule, a
  /// lower bound of it.
  [[nodiscard]] double distance(std::size_t group, Vec3 p_m) const noexcept;
  /// The field along a line; `axis` is a unit vector.
  [[nodiscard]] OnLine onLine(Vec3 origin_m, Vec3 axis) const noexcept;

  /// The field in a ball. The same structure as `at`, and the same `structuresDistance` near the surface;
  /// elsewhere its sign; a clearance is right within the ball.
  [[nodiscard]] InBall inBall(Vec3 center_m, double radius_m) const noexcept;
  /// The same with fewer parts, for structuresDistance of this mask only.
  [[nodiscard]] InBall inBall(Vec3 center_m, double radius_m, StructureMask mask) const noexcept;
  /// The whole field as a piece.
  [[nodiscard]] Piece piece(StructureMask mask) const noexcept;
  /// A box around the points of some structures; unbounded where a half-space bounds them.
  [[nodiscard]] FieldBox boxAround(StructureMask mask) const noexcept;

  [[nodiscard]] const std::vector<FieldStructure>& structures() const { return structures_; }
  /// The number of numbers that an author wrote for shapes and rules.
  [[nodiscard]] std::size_t numbers() const { return numbers_; }

 private:
  // what is left out is left out by this margin: far more than rounding can move a distance of a metre
  static constexpr double kRounding_m = 1e-9;
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  using GroupMask = std::uint32_t;
  static_assert(kMaxFieldGroups <= 32);
  enum class Kind : std::uint8_t { kCapsule, kEllipsoid, kHalfSpace };
  struct Part {
    Kind kind;
    std::uint8_t group;
    double blend_m;
    Vec3 a;           // capsule: a; ellipsoid: centre; half-space: point
    Vec3 b;           // capsule: b − a; ellipsoid: its radii; half-space: unit normal
    double radius_m;  // capsule: at a
    double growth_m;  // capsule: radius at b − radius at a
    double inverse;   // capsule: 1/|b − a|², 0 for a ball
    Vec3 x, y, z;     // ellipsoid: its axes
    Vec3 inverses;    // ellipsoid: 1/radius along each
    double ruled_m;   // the greatest distance from its group that any rule asks about
    double reach_m;   // beyond its surface it matters up to here at most, to a rule or a blend (Mattering)
  };
  /// Outside of this ball a part does not matter: infinite for a half-space.
  struct Ball {
    Vec3 center_m;
    double radius_m;
  };
  struct Range {
    std::uint8_t group;
    double from_m, to_m;
  };
  struct Rule {
    std::array<Range, 1 + kMaxRuleClips> ranges;
    std::uint8_t count;
    StructureIndex structure;
    StructureMask from_here;  // the structures of this and later rules
    GroupMask near, outside;  // groups that it holds only near to or in, and only outside of or near to
  };
  using Distances = std::array<double, kMaxFieldGroups>;
  class Mattering;

  Field() = default;
  void addPart(std::uint8_t group, const FieldPart& part);
  void addSegment(std::uint8_t group, double blend_m, const CapsulePart& capsule);
  [[nodiscard]] static double distanceTo(const Part& part, Vec3 p_m) noexcept;
  [[nodiscard]] static double distanceToEllipsoid(const Part& part, Vec3 p_m, Vec3* slope = nullptr) noexcept;
  [[nodiscard]] static double exactDistanceToEllipsoid(const Part& part, Vec3 p_m,
                                                       Vec3* slope = nullptr) noexcept;
  static void join(const Part& part, Vec3 p_m, Distances& distances) noexcept;
  void distancesAt(Vec3 p_m, Distances& distances) const noexcept;
  [[nodiscard]] static FieldSlope slopeTo(const Part& part, Vec3 p_m, bool exact = false) noexcept;
  /// Whether the distance from a capsule is no more than a bound; if so, with its slope.
  static bool capsuleBelow(const Part& part, Vec3 p_m, double bound_m, FieldSlope& to) noexcept;
  /// structuresDistance from the groups' distances, or from these with their slopes.
  template <class Number>
  [[nodiscard]] Number joined(StructureMask mask,
                              const std::array<Number, kMaxFieldGroups>& distances) const noexcept;
  [[nodiscard]] FieldBox boxAround(std::size_t group, double beyond_m) const noexcept;
  [[nodiscard]] bool isWhole(StructureMask mask) const noexcept;
  /// The groups that structuresDistance of the mask looks at.
  [[nodiscard]] GroupMask groupsOf(StructureMask mask) const noexcept;
  [[nodiscard]] InBall inBallOf(GroupMask groups, Vec3 center_m, double radius_m) const noexcept;
  /// `far`, `deep`: groups that are so far from the point, or around it, that they decide nothing.
  [[nodiscard]] FieldPoint judge(const Distances& distances, GroupMask far = 0,
                                 GroupMask deep = 0) const noexcept;

  std::vector<FieldStructure> structures_;
  std::vector<Part> parts_;
  std::vector<Ball> balls_;  // of each part
  std::vector<Rule> rules_;
  double steep_ = 1;  // the most that a distance changes per length
  std::size_t groups_ = 0, skin_ = 0, numbers_ = 0;
  StructureIndex rest_ = 0;
};

}  // namespace needlelab
