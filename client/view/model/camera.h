/// A camera that orbits a point; independent of any window.
#pragma once

#include <array>
#include <optional>

#include "client/view/model/scene_view.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// Column-major, as in OpenGL.
using Matrix4 = std::array<float, 16>;

/// A point in a picture: x to the right, y down, in pixels from its upper left corner; depth 0 (near) to 1.
struct PicturePoint {
  double x_px = 0, y_px = 0, depth = 0;
};

/// A segment within a picture.
struct PictureSegment {
  PicturePoint from, to;
};

/// Looks at `focus_W_m` from `distance_m`; `up_W` (unit) points up in the picture.
struct OrbitCamera {
  Vec3 focus_W_m;
  Vec3 up_W{0, 0, 1};
  Vec3 front_W{1, 0, 0};     ///< unit, perpendicular to `up_W`: from the focus to the eye at azimuth 0
  double azimuth_rad = 0;    ///< to the left of `front_W`, seen from the eye
  double elevation_rad = 0;  ///< clamped to ±85°
  double distance_m = 0.3;
  double field_of_view_rad = 0.6;  ///< vertical, full angle
  friend bool operator==(const OrbitCamera&, const OrbitCamera&) = default;

  [[nodiscard]] Vec3 eye_W_m() const;
  [[nodiscard]] Vec3 right_W() const;   ///< unit, to the right in the picture
  [[nodiscard]] Vec3 upward_W() const;  ///< unit, up in the picture
  /// Turns the scene by a pointer drag in pixels, in a picture of this height.
  void orbit(double dx_px, double dy_px, double height_px);
  /// Shifts the focus in the picture's plane by a pointer drag.
  void pan(double dx_px, double dy_px, double height_px);
  /// Positive: the eye moves nearer; one wheel step is 1. The distance is clamped to 2 cm - 2 m.
  void zoom(double steps);

  [[nodiscard]] Matrix4 view() const;
  [[nodiscard]] Matrix4 projection(double width_px, double height_px) const;
  /// Returns where a W point appears in the picture; empty behind the eye.
  [[nodiscard]] std::optional<PicturePoint> project(Vec3 p_W_m, double width_px, double height_px) const;
  /// Returns the visible part of a segment, in the segment's direction; empty if none is visible.
  [[nodiscard]] std::optional<PictureSegment> projectSegment(Vec3 a_W_m, Vec3 b_W_m, double width_px,
                                                             double height_px) const;
  /// Returns the unit vector from the eye through a pixel.
  [[nodiscard]] Vec3 ray_W(double x_px, double y_px, double width_px, double height_px) const;
  /// Returns metres per pixel at the focus.
  [[nodiscard]] double metresPerPixel(double height_px) const;
};

/// Returns the scene's initial view: limb, target and needle in the picture, the surface's normal up, the
/// user's side (W's x) in front.
OrbitCamera initialView(const SceneView& scene);
/// Views along the surface's normal from above, and from the side.
OrbitCamera viewFromAbove(const SceneView& scene);
OrbitCamera viewFromSide(const SceneView& scene);
/// Returns a view from farther away, which shows what part of a body it is, and where its head lies; a body
/// whose length the profile's directions call "towards the head" sits upright. The initial view where there
/// is no body.
OrbitCamera viewOfWhole(const SceneView& scene);

/// Returns the plane in which the scene's picture shows the insertion: upright (it contains the surface's
/// normal), through the scene's focus, facing the eye. The cut lies slightly behind it.
PicturePlane insertionPlaneOf(const SceneView& scene, const OrbitCamera& camera);

}  // namespace needlelab
