/// Triangle meshes computed from the scene's numbers, and pictures as plain bytes; the renderer only uploads
/// them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "client/view/model/scene_view.h"
#include "common/haptics/geometry.h"
#include "common/haptics/needle_spec.h"

namespace needlelab {

struct MeshVertex {
  float p_m[3] = {};
  float normal[3] = {};  ///< unit; of a body shorter in hollows, which are darker
};

struct Mesh {
  std::vector<MeshVertex> vertices;
  std::vector<std::uint32_t> triangles;  ///< three indices each, counter-clockwise from outside
};

/// About the origin.
Mesh ballMesh(double radius_m, int rings = 16);
/// From `a` to `b`, radii at both ends (0: a point), with caps where `closed`.
Mesh coneMesh(Vec3 a_m, Vec3 b_m, double radius_a_m, double radius_b_m, int sides = 24, bool closed = true);
/// A capsule of `radius_m` about the segment; a ball when a = b.
Mesh tubeMesh(Vec3 a_m, Vec3 b_m, double radius_m, int rings = 8, int sides = 24);
/// An arrow from the origin along +z, 1 long, with a head of 0.3; shaft radius 0.04.
Mesh arrowMesh(int sides = 16);

/// Returns the limb's surface at depth `depth_m`, near the scene's focus (radius: 1.2 extents); empty if the
/// limb is not that deep. Normals point out of the tissue.
Mesh layerSurface(const SceneView& scene, double depth_m);

/// The needle in its own frame T: tip at the origin, shaft along −z. The bevel faces +y. A pencil point is a
/// cone.
Mesh needleMesh(const NeedleSpec& needle, double drawn_diameter_m);

/// A syringe behind a needle of `needle_length_m`, in T. The plunger is a separate mesh: draw it shifted by
/// `plungerShift_m` along +z.
struct SyringeMesh {
  Mesh hub, barrel, scale, plunger;
  double stroke_m = 0;
  // Inside of the barrel, along T's z: the stopper's front when drawn out, and the hub's end.
  double stopper_z_m = 0, outlet_z_m = 0, radius_m = 0;
  double end_z_m = 0;  ///< of the drawn-out plunger's plate: the rearmost point
};
SyringeMesh syringeMesh(double needle_length_m);
/// 0 (drawn out) - 1 (pressed down).
double plungerShift_m(const SyringeMesh& syringe, double plunger);

// building blocks

/// Adds a vertex and returns its index.
std::uint32_t addVertex(Mesh& mesh, Vec3 p_m, Vec3 normal);
void addTriangle(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c);
/// Appends `part` to `mesh`.
void append(Mesh& mesh, const Mesh& part);
/// Returns the mesh transformed by the pose.
Mesh moved(Mesh mesh, const Pose& X);

/// A grid of (rows + 1)·(columns + 1) vertices over the unit square, with normals from the neighbours'
/// positions; outward is row × column.
Mesh gridMesh(int rows, int columns, const std::function<Vec3(double row, double column)>& place);

/// A surface of revolution about the z axis. `profile`: (radius, z) points with ascending z; each piece has
/// its own normal, so edges stay sharp.
struct LathePoint {
  double radius_m = 0, z_m = 0;
};
Mesh latheMesh(const std::vector<LathePoint>& profile, int sides);

/// Two unit vectors that form a right-handed frame with the unit vector `axis`.
struct SideAxes {
  Vec3 a, b;
};
SideAxes sideAxes(Vec3 axis);

/// Rows from top to bottom, one byte per pixel, 0 black to 255 white.
struct GreyImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;  ///< width·height
};

/// Rows from top to bottom, four bytes per pixel: red, green, blue, opacity (sRGB).
struct RgbaImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;  ///< 4·width·height
};

}  // namespace needlelab
