#include "client/view/model/ultrasound/ultrasound_slice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "client/view/model/ultrasound/tissue_echoes.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/surface.h"

namespace needlelab {
namespace {

constexpr double kDeepest_m = 0.12, kShallowest_m = 0.02;
constexpr double kMaxTurn_rad = 0.2;  // maximum turn of the plane between pictures
constexpr double kFaintest = 0.02;    // fainter hazards are not drawn
constexpr float kThrough = 0.6F;      // opacity of hazard parts outside their section
constexpr int kGrainSize = 256;       // a tile of speckle, repeated
constexpr double kGrainAcross_m = 0.00022,
                 kGrainDown_m = 0.00012;  // wider than high, because sound resolves better along its path

// Speckle: magnitude of a sum of random phases (Rayleigh distribution), mean about 1; slightly smoothed,
// tiles seamlessly.
std::array<float, kGrainSize * kGrainSize> makeGrain() {
  std::array<float, kGrainSize * kGrainSize> raw{}, smooth{};
  std::uint64_t state = 0x9E3779B97F4A7C15u;
  for (float& value : raw) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    const double uniform = (static_cast<double>(state >> 11) + 0.5) * 0x1.0p-53;
    value = static_cast<float>(std::sqrt(-2 * std::log(uniform)) * 0.7979);
  }
  for (int y = 0; y < kGrainSize; ++y) {
    for (int x = 0; x < kGrainSize; ++x) {
      float sum = 0;
      for (int dx = -1; dx <= 1; ++dx)
        for (int dy = -1; dy <= 1; ++dy)
          sum += raw[static_cast<std::size_t>(((y + dy) & 255) * kGrainSize + ((x + dx) & 255))] *
                 (dx == 0 ? 0.5F : 0.25F) * (dy == 0 ? 0.6F : 0.2F);
      smooth[static_cast<std::size_t>(y * kGrainSize + x)] = sum;
    }
  }
  return smooth;
}

using GrainTile = std::array<float, kGrainSize * kGrainSize>;
const GrainTile& grainTile() {
  static const GrainTile kGrain = makeGrain();
  return kGrain;
}

float grainAt(const GrainTile& tile, int x, int y) {
  return tile[static_cast<std::size_t>((y & 255) * kGrainSize + (x & 255))];
}

/// A hazard's section in the plane, in the plane's coordinates.
struct Shape {
  Vec3 a, b;  // x right, y down, z out of the plane, from the picture's origin
  double radius_m = 0;
  Echo echo;

  /// The part of the hazard that projects onto a point of the picture.
  struct Projection {
    double away_m = 0;  // in the picture, from the outline; negative inside
    double off_m = 0;   // from the plane
  };
  [[nodiscard]] Projection projectionAt(double x_m, double y_m) const {
    const double dx = b.x - a.x, dy = b.y - a.y, squared = dx * dx + dy * dy;
    const double t =
        squared > 0 ? std::clamp(((x_m - a.x) * dx + (y_m - a.y) * dy) / squared, 0.0, 1.0) : 0.5;
    return {std::hypot(x_m - a.x - t * dx, y_m - a.y - t * dy) - radius_m,
            std::max(0.0, std::fabs(a.z + t * (b.z - a.z)) - radius_m)};
  }
  // Distance from the surface; negative inside.
  [[nodiscard]] double distance_m(double x_m, double y_m) const {
    const Vec3 p{x_m, y_m, 0}, ab = b - a;
    const double squared = normSquared(ab);
    const double t = squared > 0 ? std::clamp(dot(p - a, ab) / squared, 0.0, 1.0) : 0.0;
    return norm(p - (a + ab * t)) - radius_m;
  }
  /// Whether a point of the picture is near the hazard; lets most pixels skip the distances.
  [[nodiscard]] bool isNear(double x_m, double y_m, double margin_m) const {
    const double reach_m = radius_m + margin_m;
    return y_m > std::min(a.y, b.y) - reach_m && y_m < std::max(a.y, b.y) + reach_m &&
           x_m > std::min(a.x, b.x) - reach_m && x_m < std::max(a.x, b.x) + reach_m;
  }
};

Vec3 inPlane(const SlicePlane& plane, Vec3 p_W_m) {
  const Vec3 from = p_W_m - plane.origin_W_m;
  return {dot(from, plane.right_W), dot(from, plane.down_W), dot(from, cross(plane.right_W, plane.down_W))};
}

std::uint8_t greyOf(float share) {
  return static_cast<std::uint8_t>(std::clamp(share, 0.0F, 1.0F) * 255.0F + 0.5F);
}

/// The needle: a bright line, brighter at its tip, with fainter echoes below; weaker off the plane.
void drawNeedle(const SlicePlane& plane, const Moment& moment, double needle_length_m, double m_per_px,
                GreyImage& out) {
  const Vec3 tip = inPlane(plane, moment.p_WT_m);
  const Vec3 hub = inPlane(plane, moment.p_WT_m - normalized(zAxis(moment.q_WT)) * needle_length_m);
  const double length_px = norm(hub - tip) / m_per_px;
  if (!(length_px > 0)) return;
  const double half_width_px = std::max(1.0, 0.00035 / m_per_px);
  const int samples = std::min(4000, static_cast<int>(length_px * 2) + 2);
  const auto put = [&](double x_m, double y_m, float light) {
    const double x_px = x_m / m_per_px + out.width * 0.5, y_px = y_m / m_per_px;
    const int x0 = static_cast<int>(std::floor(x_px - 2 * half_width_px));
    const int x1 = static_cast<int>(std::ceil(x_px + 2 * half_width_px));
    const int y0 = static_cast<int>(std::floor(y_px - 2 * half_width_px));
    const int y1 = static_cast<int>(std::ceil(y_px + 2 * half_width_px));
    for (int y = std::max(0, y0); y <= std::min(out.height - 1, y1); ++y) {
      for (int x = std::max(0, x0); x <= std::min(out.width - 1, x1); ++x) {
        const double away = std::hypot(x + 0.5 - x_px, y + 0.5 - y_px) / half_width_px;
        std::uint8_t& pixel = out.pixels[static_cast<std::size_t>(y * out.width + x)];
        pixel = std::max(pixel, greyOf(light * static_cast<float>(std::exp(-away * away))));
      }
    }
  };
  for (int i = samples; i >= 0; --i) {
    const double share = static_cast<double>(i) / samples;
    const Vec3 p = tip + (hub - tip) * share;
    if (p.y < -0.001) continue;
    if (std::fabs(p.x) > 0.6 * out.width * m_per_px) continue;
    // visible only near the plane
    const auto held = static_cast<float>(std::exp(-(p.z / 0.0015) * (p.z / 0.0015)));
    const float at_tip = share * length_px * m_per_px < 0.0015 ? 1.0F : 0.0F;
    const float wave = 0.85F + 0.15F * grainAt(grainTile(), i / 2, 7);
    put(p.x, p.y, held * (0.78F + 0.22F * at_tip) * wave);
    if (i % 2 == 0) {
      put(p.x, p.y + 0.0016, held * 0.34F * wave);
      put(p.x, p.y + 0.0032, held * 0.2F * wave);
    }
  }
}

}  // namespace

SlicePlane slicePlaneOf(const SceneView& scene, const Moment& moment, const SlicePlane* before) {
  SlicePlane plane;
  const Vec3 axis_W = moment.inside ? moment.u_W : normalized(zAxis(moment.q_WT));
  const Vec3 out_W = surfaceNormal(scene.limb_W, moment.inside ? moment.p_entry_W_m : moment.p_WT_m, axis_W);
  plane.down_W = -out_W;
  plane.origin_W_m =
      moment.inside ? moment.p_entry_W_m : moment.p_WT_m + out_W * signedDepth(scene.limb_W, moment.p_WT_m);
  // the needle's direction across the skin, if defined; otherwise the previous plane
  const auto level = [&](Vec3 v) { return v - plane.down_W * dot(plane.down_W, v); };
  Vec3 across = level(axis_W);
  // Outside, a needle wavers. In the tissue it has a trajectory, and a plane beside that would lose it.
  const double open = moment.inside ? 0.02 : 0.09;
  const Vec3 kept = before != nullptr ? level(before->right_W) : level({1, 0, 0});
  const Vec3 usual = normalized(normSquared(kept) > 1e-6 ? kept : level({0, 1, 0}));
  if (normSquared(across) < open * open) across = usual;
  // Keep the same side, so that the picture does not flip; turn no faster than a hand turns a probe.
  across = normalized(dot(across, usual) < 0 ? -across : across);
  if (before == nullptr) {
    plane.right_W = across;
    return plane;
  }
  const Vec3 beside = cross(plane.down_W, usual);
  const double turn_rad =
      std::clamp(std::atan2(dot(across, beside), dot(across, usual)), -kMaxTurn_rad, kMaxTurn_rad);
  plane.right_W = usual * std::cos(turn_rad) + beside * std::sin(turn_rad);
  return plane;
}

PicturePlane picturePlaneOf(const SlicePlane& plane) {
  return {plane.origin_W_m, -cross(plane.right_W, plane.down_W)};
}

std::vector<SliceLabel> sliceLabels(const SceneView& scene, const SlicePlane& plane, double half_width_m,
                                    double depth_m) {
  std::vector<SliceLabel> labels;
  for (const HazardView& hazard : scene.hazards) {
    const double off_m = offPlane_m(hazard, picturePlaneOf(plane)), opacity = offPlaneOpacity(off_m);
    if (opacity < kFaintest) continue;
    const Vec3 a = inPlane(plane, hazard.a_W_m), b = inPlane(plane, hazard.b_W_m);
    // where the axis crosses the plane, otherwise its nearer end
    const double rise_m = b.z - a.z;
    const double share = rise_m == 0 ? 0.5 : std::clamp(-a.z / rise_m, 0.0, 1.0);
    const Vec3 at = a + (b - a) * share;
    if (std::fabs(at.x) > half_width_m || at.y < 0 || at.y > depth_m) continue;
    labels.push_back({at.x, at.y, hazardLabel(hazard, off_m), hazard.kind, opacity});
  }
  return labels;
}

double sliceDepth_m(const SceneView& scene, const SliceSettings& settings) {
  if (settings.depth_m > 0) return std::clamp(settings.depth_m, 0.005, 0.5);
  double deepest_m = 0;
  for (const TargetView& target : scene.targets) deepest_m = std::max(deepest_m, target.bottom_m);
  if (!(deepest_m > 0)) deepest_m = 0.6 * scene.needle.length_m;
  return std::clamp(1.33 * deepest_m, kShallowest_m, kDeepest_m);
}

void drawSlice(const SceneView& scene, const SlicePlane& plane, const Moment& moment,
               const SliceSettings& settings, GreyImage& out) {
  out.width = std::clamp(settings.width, 16, 1024);
  out.height = std::clamp(settings.height, 16, 1024);
  out.pixels.assign(static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height), 0);
  const double depth_m = sliceDepth_m(scene, settings);
  const double m_per_px = depth_m / out.height;
  std::optional<EchoTable> of_shells;
  std::optional<BodyEchoes> of_body;
  if (scene.body)
    of_body.emplace(scene, plane, out, m_per_px);
  else
    of_shells.emplace(scene, 2 * depth_m);

  std::vector<Shape> shapes;
  for (const HazardView& hazard : scene.hazards)
    // a structure is in the section
    if (!hazard.structure && offPlaneOpacity(offPlane_m(hazard, picturePlaneOf(plane))) >= kFaintest)
      shapes.push_back(
          {inPlane(plane, hazard.a_W_m), inPlane(plane, hazard.b_W_m), hazard.radius_m, echoOf(hazard.kind)});

  // Proceed downward from the probe: anything that stops sound darkens everything below it.
  std::vector<float> sound(static_cast<std::size_t>(out.width), 1.0F);
  const auto lost_in_bone = static_cast<float>(std::exp(-m_per_px / 0.0008));
  // the grain belongs to the tissue: it stays fixed in W when the plane moves
  const double shift_x_m = dot(plane.origin_W_m, plane.right_W),
               shift_y_m = dot(plane.origin_W_m, plane.down_W);
  const GrainTile& tile = grainTile();
  for (int y = 0; y < out.height; ++y) {
    const double y_m = (y + 0.5) * m_per_px;
    const auto fading = static_cast<float>(1.0 - 0.35 * y_m / depth_m);
    const int grain_y = static_cast<int>(std::floor((y_m + shift_y_m) / kGrainDown_m));
    const Vec3 row_W_m = plane.origin_W_m + plane.down_W * y_m;
    for (int x = 0; x < out.width; ++x) {
      const double x_m = (x + 0.5 - out.width * 0.5) * m_per_px;
      std::optional<TissueEcho> tissue;
      if (of_body)
        tissue = of_body->at(x, y);
      else if (const double below_m = signedDepth(scene.limb_W, row_W_m + plane.right_W * x_m); below_m > 0)
        tissue = of_shells->at(below_m);
      float& heard = sound[static_cast<std::size_t>(x)];
      std::uint8_t& pixel = out.pixels[static_cast<std::size_t>(y * out.width + x)];
      if (!tissue) {
        // gel between probe and skin
        pixel = greyOf(0.03F + (y < 3 ? 0.25F : 0.0F));
        continue;
      }
      Echo echo = tissue->echo;
      float line = tissue->line;
      for (const Shape& shape : shapes) {
        if (!shape.isNear(x_m, y_m, 0.001)) continue;
        // off-plane parts shine through and cast no shadow
        const Shape::Projection through = shape.projectionAt(x_m, y_m);
        if (through.away_m < 0) {
          const float seen = kThrough * static_cast<float>(offPlaneOpacity(through.off_m));
          echo.mean += seen * (shape.echo.mean - echo.mean);
          echo.grain += seen * (shape.echo.grain - echo.grain);
          line *= 1 - seen;
        }
        const double away_m = shape.distance_m(x_m, y_m);
        if (away_m < 0) {
          echo = shape.echo;
          line = 0;
        }
        // its wall; of bone only the side facing the sound
        const double wide_m = shape.echo.stops_sound ? 0.0005 : 0.00025;
        if (std::fabs(away_m) < 3 * wide_m)
          line = std::max(line, (shape.echo.stops_sound ? 0.85F : 0.45F) *
                                    static_cast<float>(std::exp(-(away_m / wide_m) * (away_m / wide_m))));
      }
      const int grain_x = static_cast<int>(std::floor((x_m + shift_x_m) / kGrainAcross_m));
      const float grain = grainAt(tile, grain_x, grain_y);
      const float light = echo.mean * (1 + echo.grain * (grain - 1)) + line * (0.75F + 0.25F * grain);
      pixel = greyOf(light * heard * fading);
      if (echo.stops_sound) heard *= lost_in_bone;
    }
  }
  drawNeedle(plane, moment, scene.needle.length_m, m_per_px, out);
}

}  // namespace needlelab
