#include "client/view/model/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include "common/anatomy/field_body.h"
#include "common/base/units.h"

namespace needlelab {
namespace {

constexpr double kMaxElevation_rad = radOf(85);
constexpr double kNearest_m = 0.02, kFarthest_m = 2;
constexpr double kWholeLengths = 1.05, kUprightLengths = 1.6;  // how far away a whole body is seen from
constexpr std::string_view kHeadwards = "towards the head";    // Profile.directions

// Returns the unit vector perpendicular to the unit vector `up` that is nearest to `wanted`.
Vec3 levelled(Vec3 wanted, Vec3 up) {
  const Vec3 level = wanted - up * dot(up, wanted);
  if (normSquared(level) > 1e-6) return normalized(level);
  const Vec3 other = std::fabs(up.x) < 0.7 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  return normalized(other - up * dot(up, other));
}

// unit, as seen from the focus
Vec3 outward(const OrbitCamera& camera) {
  const Vec3 side = cross(camera.up_W, camera.front_W);
  const Vec3 level = camera.front_W * std::cos(camera.azimuth_rad) - side * std::sin(camera.azimuth_rad);
  return level * std::cos(camera.elevation_rad) + camera.up_W * std::sin(camera.elevation_rad);
}

}  // namespace

Vec3 OrbitCamera::eye_W_m() const {
  return focus_W_m + outward(*this) * distance_m;
}

Vec3 OrbitCamera::right_W() const {
  return normalized(cross(up_W, outward(*this)));
}

Vec3 OrbitCamera::upward_W() const {
  return cross(outward(*this), right_W());
}

void OrbitCamera::orbit(double dx_px, double dy_px, double height_px) {
  const double rad_per_px = std::numbers::pi / std::max(height_px, 1.0);
  azimuth_rad = std::remainder(azimuth_rad + dx_px * rad_per_px, 2 * std::numbers::pi);
  elevation_rad = std::clamp(elevation_rad + dy_px * rad_per_px, -kMaxElevation_rad, kMaxElevation_rad);
}

void OrbitCamera::pan(double dx_px, double dy_px, double height_px) {
  const double m_per_px = metresPerPixel(height_px);
  focus_W_m += right_W() * (-dx_px * m_per_px) + upward_W() * (dy_px * m_per_px);
}

void OrbitCamera::zoom(double steps) {
  distance_m = std::clamp(distance_m * std::pow(0.88, steps), kNearest_m, kFarthest_m);
}

Matrix4 OrbitCamera::view() const {
  const Vec3 right = right_W(), up = upward_W(), back = outward(*this), eye = eye_W_m();
  const auto f = [](double v) { return static_cast<float>(v); };
  return {f(right.x),          f(up.x),          f(back.x),          0,  //
          f(right.y),          f(up.y),          f(back.y),          0,  //
          f(right.z),          f(up.z),          f(back.z),          0,  //
          f(-dot(right, eye)), f(-dot(up, eye)), f(-dot(back, eye)), 1};
}

Matrix4 OrbitCamera::projection(double width_px, double height_px) const {
  // The nearest relevant object is a needle in front of the focus; 24-bit depth then resolves micrometres.
  const double near_m = distance_m * 0.1, far_m = distance_m * 10;
  const double scale = 1 / std::tan(field_of_view_rad / 2);
  const double aspect = std::max(width_px, 1.0) / std::max(height_px, 1.0);
  const auto f = [](double v) { return static_cast<float>(v); };
  return {f(scale / aspect),
          0,
          0,
          0,  //
          0,
          f(scale),
          0,
          0,  //
          0,
          0,
          f((far_m + near_m) / (near_m - far_m)),
          -1,
          0,
          0,
          f(2 * far_m * near_m / (near_m - far_m)),
          0};
}

std::optional<PicturePoint> OrbitCamera::project(Vec3 p_W_m, double width_px, double height_px) const {
  const Vec3 from_eye = p_W_m - eye_W_m();
  const double ahead_m = -dot(outward(*this), from_eye);
  const double near_m = distance_m * 0.1, far_m = distance_m * 10;
  if (!(ahead_m > near_m)) return std::nullopt;
  const double px_per_share = height_px / 2 / std::tan(field_of_view_rad / 2);
  PicturePoint point;
  point.x_px = width_px / 2 + dot(right_W(), from_eye) / ahead_m * px_per_share;
  point.y_px = height_px / 2 - dot(upward_W(), from_eye) / ahead_m * px_per_share;
  point.depth = far_m * (ahead_m - near_m) / (ahead_m * (far_m - near_m));
  return point;
}

std::optional<PictureSegment> OrbitCamera::projectSegment(Vec3 a_W_m, Vec3 b_W_m, double width_px,
                                                          double height_px) const {
  // The planes through the eye; distances inside the picture are positive. Slightly inside the near plane,
  // where `project` begins.
  const Vec3 ahead = -outward(*this), eye = eye_W_m();
  const double up_share = std::tan(field_of_view_rad / 2), right_share = up_share * width_px / height_px;
  const std::array<Vec3, 4> edges = {ahead * right_share + right_W(), ahead * right_share - right_W(),
                                     ahead * up_share + upward_W(), ahead * up_share - upward_W()};
  double from = 0, to = 1;  // fractions of the segment
  const auto clip = [&](double inside_a, double inside_b) {
    if (inside_a < 0 && inside_b > 0) from = std::max(from, inside_a / (inside_a - inside_b));
    if (inside_a > 0 && inside_b < 0) to = std::min(to, inside_a / (inside_a - inside_b));
    if (inside_a <= 0 && inside_b <= 0) to = -1;
  };
  const double near_m = distance_m * 0.1 * (1 + 1e-9);
  clip(dot(ahead, a_W_m - eye) - near_m, dot(ahead, b_W_m - eye) - near_m);
  for (const Vec3 edge : edges) clip(dot(edge, a_W_m - eye), dot(edge, b_W_m - eye));
  if (!(from < to)) return std::nullopt;
  const auto at = [&](double share) { return project(a_W_m + (b_W_m - a_W_m) * share, width_px, height_px); };
  const auto begin = at(from), end = at(to);
  if (!begin || !end) return std::nullopt;
  return PictureSegment{*begin, *end};
}

Vec3 OrbitCamera::ray_W(double x_px, double y_px, double width_px, double height_px) const {
  const double share_per_px = 2 * std::tan(field_of_view_rad / 2) / height_px;
  return normalized(-outward(*this) + right_W() * ((x_px - width_px / 2) * share_per_px) +
                    upward_W() * ((height_px / 2 - y_px) * share_per_px));
}

double OrbitCamera::metresPerPixel(double height_px) const {
  return 2 * distance_m * std::tan(field_of_view_rad / 2) / std::max(height_px, 1.0);
}

OrbitCamera initialView(const SceneView& scene) {
  OrbitCamera camera;
  camera.up_W = scene.focus_normal_W;
  camera.front_W = levelled({1, 0, 0}, camera.up_W);
  // a little below the skin: needle and syringe above, target and layers below
  camera.focus_W_m = scene.focus_W_m - scene.focus_normal_W * (0.12 * scene.extent_m);
  camera.azimuth_rad = radOf(25);
  camera.elevation_rad = radOf(14);
  camera.distance_m = std::clamp(3.6 * scene.extent_m, kNearest_m, kFarthest_m);
  if (scene.body) {  // farther, with the hand and a recognisable part of the body
    camera.focus_W_m = scene.focus_W_m + scene.focus_normal_W * (0.08 * scene.extent_m);
    camera.elevation_rad = radOf(20);
    camera.distance_m = std::clamp(5.0 * scene.extent_m, kNearest_m, kFarthest_m);
  }
  return camera;
}

OrbitCamera viewFromAbove(const SceneView& scene) {
  OrbitCamera camera = initialView(scene);
  camera.azimuth_rad = 0;
  camera.elevation_rad = kMaxElevation_rad;
  camera.focus_W_m = scene.focus_W_m;
  return camera;
}

OrbitCamera viewFromSide(const SceneView& scene) {
  OrbitCamera camera = initialView(scene);
  camera.azimuth_rad = radOf(90);
  camera.elevation_rad = 0;
  return camera;
}

OrbitCamera viewOfWhole(const SceneView& scene) {
  OrbitCamera camera = initialView(scene);
  if (!scene.body) return camera;
  const FieldBox box = scene.body->field().boxAround(kWholeBody);
  const Vec3 size_m = box.high_m - box.low_m, middle_W_m = scene.X_WL * ((box.low_m + box.high_m) * 0.5);
  const double long_m = std::max({size_m.x, size_m.y, size_m.z});
  const Vec3 along_L = size_m.x == long_m   ? Vec3{1, 0, 0}
                       : size_m.y == long_m ? Vec3{0, 1, 0}
                                            : Vec3{0, 0, 1};
  // its length across the picture, seen from the side that is nearer to the user
  const Vec3 across_W = cross(rotate(scene.X_WL.q, along_L), camera.up_W);
  camera.front_W = levelled(across_W * (across_W.x + 0.5 * across_W.y < 0 ? -1.0 : 1.0), camera.up_W);
  camera.focus_W_m = (scene.focus_W_m + middle_W_m) * 0.5;
  camera.distance_m = std::clamp(kWholeLengths * long_m, camera.distance_m, kFarthest_m);
  camera.azimuth_rad = radOf(20);
  camera.elevation_rad = radOf(42);
  // a trunk sits, seen from the side on which the needle enters
  for (const DirectionView& one : scene.directions) {
    if (one.words != kHeadwards || std::fabs(dot(one.way_W, rotate(scene.X_WL.q, along_L))) < 0.5) continue;
    camera.up_W = one.way_W;
    camera.front_W = levelled(scene.focus_normal_W, camera.up_W);
    camera.focus_W_m = middle_W_m + one.way_W * (0.07 * long_m);  // rather the head than the legs
    camera.distance_m = std::clamp(kUprightLengths * long_m, camera.distance_m, kFarthest_m);
    camera.azimuth_rad = radOf(-35);
    camera.elevation_rad = radOf(8);
  }
  return camera;
}

PicturePlane insertionPlaneOf(const SceneView& scene, const OrbitCamera& camera) {
  const Vec3 n = scene.focus_normal_W, to_eye = camera.eye_W_m() - scene.focus_W_m;
  Vec3 level = to_eye - n * dot(n, to_eye);
  if (!(normSquared(level) > 1e-12)) level = camera.upward_W() * -1.0;
  return {scene.focus_W_m, normalized(level)};
}

}  // namespace needlelab
