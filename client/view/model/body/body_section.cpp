#include "client/view/model/body/body_section.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "client/view/model/body/tissue_grain.h"
#include "common/anatomy/field_body.h"

namespace needlelab {
namespace {

constexpr double kCortex_m = 1.8e-3;  // of a bone: dense and pale; within it spongy bone
constexpr double kBetween_m = 7e-3;   // grain so far apart has nothing in common
constexpr double kFarthest = 2;       // from the eye, in distances to the focus
constexpr Rgb kSpongy = rgbOf(0xD9BE94);

/// The rectangle of the plane that the picture shows, as far as it is not much farther away than the focus.
SectionFrame frameOf(const SceneView& scene, const PicturePlane& plane, const OrbitCamera& camera,
                     double width_per_height, int long_px) {
  const Vec3 n = plane.to_viewer_W;
  const Vec3 up = normalized(scene.focus_normal_W - n * dot(n, scene.focus_normal_W));
  const Vec3 across = cross(up, n), eye_W_m = camera.eye_W_m();
  double left = 0, right = 0, low = 0, top = 0;
  for (const double x : {0.0, width_per_height})
    for (const double y : {0.0, 1.0}) {
      const Vec3 ray_W = camera.ray_W(x, y, width_per_height, 1);
      const double ahead_m = dot(n, plane.place_W_m - eye_W_m) / std::min(dot(n, ray_W), -1e-9);
      const Vec3 at =
          eye_W_m + ray_W * std::clamp(ahead_m, 0.0, kFarthest * camera.distance_m) - scene.focus_W_m;
      left = std::min(left, dot(across, at));
      right = std::max(right, dot(across, at));
      low = std::min(low, dot(up, at));
      top = std::max(top, dot(up, at));
    }
  const Vec3 foot = scene.focus_W_m + n * dot(n, plane.place_W_m - scene.focus_W_m);
  const double point_m = std::max(right - left, top - low) / long_px;
  return {foot + across * left + up * low, across * (right - left), up * (top - low),
          std::max(1, static_cast<int>((right - left) / point_m)),
          std::max(1, static_cast<int>((top - low) / point_m))};
}

class Painter {
 public:
  Painter(const SceneView& scene, const FieldSection& section, const SectionFrame& frame_W)
      : scene_(scene), section_(section), frame_W_(frame_W) {
    point_m_ = norm(frame_W.across_m) / frame_W.width;
    X_LW_ = inverse(scene.X_WL);
    for (const LayerView& layer : scene.layers) {
      colours_.push_back(layer.colour);
      grains_.push_back(&tissueGrain(layer.kind));
    }
    cortex_ = std::max(2, static_cast<int>(std::lround(kCortex_m / point_m_)));
  }

  RgbaImage paint(const std::optional<Dimple>& dimple) {
    const int width = frame_W_.width, height = frame_W_.height;
    RgbaImage image{width, height, {}};
    image.pixels.resize(4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    const Rgb skin = mixed(kindColour(pb::Volume::Structure::SKIN), kBlack, 0.1F);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const int from_y = dimple ? y + pressed(*dimple, x, y) : y;
        const StructureIndex here = at(x, from_y);
        std::uint8_t* const pixel =
            &image.pixels[4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                               static_cast<std::size_t>(x))];
        const bool shown = here != kOutside || besideSkin(x, from_y);
        // beside the skin its colour, without opacity: edges are blended without a fringe
        const Rgb colour = here == kOutside ? skin : colourOf(here, x, from_y);
        const auto byte = [](float share) {
          return static_cast<std::uint8_t>(std::clamp(share, 0.0F, 1.0F) * 255.0F + 0.5F);
        };
        pixel[0] = byte(colour.red);
        pixel[1] = byte(colour.green);
        pixel[2] = byte(colour.blue);
        pixel[3] = shown ? 255 : 0;
      }
    return image;
  }

 private:
  [[nodiscard]] StructureIndex at(int x, int y) const {
    x = std::clamp(x, 0, frame_W_.width - 1);
    if (y >= frame_W_.height) return kOutside;
    return section_.at(x, std::max(y, 0));
  }

  /// The outermost points: the cut covers the edge of the skin's mesh.
  [[nodiscard]] bool besideSkin(int x, int y) const {
    return at(x - 1, y) != kOutside || at(x + 1, y) != kOutside || at(x, y - 1) != kOutside ||
           at(x, y + 1) != kOutside;
  }

  [[nodiscard]] Rgb colourOf(StructureIndex here, int x, int y) const {
    const LayerView& layer = scene_.layers[here];
    Rgb colour = colours_[here];
    if (layer.kind == pb::Volume::Structure::BONE) {
      const int far = cortex_, aslant = static_cast<int>(0.7 * cortex_);
      bool deep = true;
      for (const auto& [dx, dy] : {std::pair{far, 0},
                                   {-far, 0},
                                   {0, far},
                                   {0, -far},
                                   {aslant, aslant},
                                   {aslant, -aslant},
                                   {-aslant, aslant},
                                   {-aslant, -aslant}})
        deep = deep && at(x + dx, y + dy) == here;
      if (deep) colour = kSpongy;
    }
    float light = 0.93F + 0.8F * grainAt(here, x, y);
    // a line where another structure begins
    int different = 0;
    for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}})
      if (const StructureIndex beside = at(x + dx, y + dy); beside != here && beside != kOutside) ++different;
    if (different > 0) light *= 0.72F;
    return {colour.red * light, colour.green * light, colour.blue * light};
  }

  /// Along the structure's fibres, if it has any. Across them the grain is the same in three directions, 60°
  /// apart: lines where the picture lies along the fibres, bundles where it cuts them.
  [[nodiscard]] float grainAt(StructureIndex here, int x, int y) const {
    const LayerView& layer = scene_.layers[here];
    const bool has_fibres = layer.tubes != nullptr || normSquared(layer.fibre_L) > 0;
    if (!has_fibres) return grains_[here]->at(y * point_m_, x * point_m_);
    const Vec3 p_L_m = X_LW_ * frame_W_.at(x + 0.5, y + 0.5);
    double along_m = 0, across_m = 0, beside_m = 0;
    if (layer.tubes != nullptr) {
      const TubePlace place = layer.tubes->at(p_L_m);
      along_m = place.along_m;
      across_m = place.radial_m * std::cos(place.angle_rad);
      beside_m = place.radial_m * std::sin(place.angle_rad);
    } else {
      const Vec3 way = layer.fibre_L;
      const Vec3 across = normalized(cross(way, std::fabs(way.x) < 0.7 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
      along_m = dot(way, p_L_m);
      across_m = dot(across, p_L_m);
      beside_m = dot(cross(way, across), p_L_m);
    }
    const TissueGrain& grain = *grains_[here];
    const double half = 0.5 * across_m, slant = 0.8660254037844386 * beside_m;
    return (grain.at(across_m, along_m) + grain.at(half + slant, along_m + kBetween_m) +
            grain.at(half - slant, along_m + 2 * kBetween_m)) *
           0.577F;  // as uneven as one of them: 1/√3
  }

  /// By how many rows a point has come down.
  [[nodiscard]] int pressed(const Dimple& dimple, int x, int y) const {
    const Vec3 d = frame_W_.at(x + 0.5, y + 0.5) - dimple.place_W_m;
    const double r2 = normSquared(d), two_sigma2 = 2 * dimple.sigma_m * dimple.sigma_m;
    if (r2 > 8 * two_sigma2) return 0;
    return static_cast<int>(std::lround(dimple.depth_m * std::exp(-r2 / two_sigma2) / point_m_));
  }

  const SceneView& scene_;
  const FieldSection& section_;
  const SectionFrame& frame_W_;
  double point_m_ = 0;
  int cortex_ = 2;
  Pose X_LW_;
  std::vector<Rgb> colours_;
  std::vector<const TissueGrain*> grains_;
};

}  // namespace

BodySection bodySectionOf(const SceneView& scene, const PicturePlane& plane, const OrbitCamera& camera,
                          double width_per_height, int long_px, const std::optional<Dimple>& dimple) {
  BodySection section;
  section.frame_W = frameOf(scene, plane, camera, width_per_height, long_px);
  const Pose X_LW = inverse(scene.X_WL);
  const SectionFrame frame_L{X_LW * section.frame_W.corner_m, rotate(X_LW.q, section.frame_W.across_m),
                             rotate(X_LW.q, section.frame_W.upward_m), section.frame_W.width,
                             section.frame_W.height};
  const FieldSection structures = sectionOf(scene.body->field(), frame_L, X_LW * scene.focus_W_m);
  section.picture = Painter(scene, structures, section.frame_W).paint(dimple);
  for (const FieldSection::Place& place : structures.places)
    section.names.push_back({place.structure, section.frame_W.at(place.x, place.y)});
  return section;
}

}  // namespace needlelab
