#include "client/view/scene/body_drawing.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/view/model/body/hand_mesh.h"
#include "client/view/scene/body_shaders.h"
#include "client/view/scene/scene_drawing.h"

namespace needlelab {
namespace {

constexpr Rgb kSkin = rgbOf(0xDFB096), kBone = rgbOf(0xEFE6D0), kGlove = rgbOf(0xB4D3E6),
              kInside = rgbOf(0x8E3F33);
constexpr int kFinePicture_px = 1280, kQuickPicture_px = 640;

// A shadow is darkest where the instrument touches the skin, and softer the farther it is away.
constexpr double kShadowDark = 0.62, kPenumbra = 0.16, kFarthestShadow_m = 0.15;
constexpr double kHand_m = 0.022;     // the hand's shadow: half its width
constexpr double kBehindHand = 0.85;  // cosine between the needle and the way from the eye
constexpr int kShadowRows = 30, kShadowColumns = 6;

constexpr double kUnbounded_m = 100;
constexpr double kSeam_m = 0.3e-3;  // by which the far skin begins within the near one
constexpr double kSlab_m = 0.015;   // nerves and vessels this near before the cut are solid, others glass

void setView(const GlProgram& program, const ViewOfScene& view, const Matrix4& model, Vec3 ball_W_m = {},
             double ball_m = kUnbounded_m) {
  program.use();
  program.set("cut_normal_W", Vec3{});
  program.set("ball_W", ball_W_m, ball_m);
  program.set("view_projection", view.view_projection);
  program.set("model", model);
  program.set("eye_W", view.eye_W_m);
  program.set("light_W", view.light_W);
  program.set("up_W", view.up_W);
}

/// Keeps what is behind the plane, or before it.
void setCut(const GlProgram& program, const PicturePlane& plane, bool behind) {
  program.set("cut_place_W", plane.place_W_m);
  program.set("cut_normal_W", behind ? plane.to_viewer_W : -plane.to_viewer_W);
}

/// Where the light's ray through a point meets the skin, if it does so soon.
std::optional<Vec3> castOnSkin(const SceneView& scene, Vec3 p_W_m, Vec3 light_W, double& way_m) {
  way_m = 0;
  for (int step = 0; step < 40; ++step) {
    const double above_m = -depthAt(scene, p_W_m - light_W * way_m);
    if (above_m < 5e-5) return p_W_m - light_W * way_m;
    way_m += 0.9 * above_m;
    if (way_m > kFarthestShadow_m) return std::nullopt;
  }
  return std::nullopt;
}

/// Makes the last rows of a shadow end softly.
void fadeOut(Mesh& shadow, std::size_t rows) {
  const std::size_t row = kShadowColumns + 1;
  for (std::size_t i = 0; i < rows && shadow.vertices.size() >= (i + 1) * row; ++i)
    for (std::size_t k = 0; k < row; ++k)
      shadow.vertices[shadow.vertices.size() - 1 - i * row - k].normal[1] *= i == 0 ? 0.0F : 0.5F;
}

/// The hand's own axes in W: z along the needle, x from the barrel to the palm, which is at the user's right,
/// a little towards them.
struct HandAxes {
  Vec3 x, y, z;
};
HandAxes handAxes(const OrbitCamera& camera, const Moment& moment) {
  const Vec3 z = normalized(zAxis(moment.q_WT));
  const Vec3 right = cross(camera.up_W, camera.front_W);
  const Vec3 wanted = right * 0.9 + camera.front_W * 0.25 + camera.up_W * 0.1;
  const Vec3 level = wanted - z * dot(z, wanted);
  const Vec3 x = normSquared(level) > 1e-6 ? normalized(level) : sideAxes(z).a;
  return {x, cross(z, x), z};
}

}  // namespace

Status BodyDrawing::build() {
  RETURN_IF_ERROR(skin_.build("skin", kBodyVertex, kSkinFragment));
  RETURN_IF_ERROR(dimpled_.build("dimpled skin", kDimpledVertex, kSkinFragment));
  RETURN_IF_ERROR(tissue_.build("tissue", kBodyVertex, kTissueFragment));
  RETURN_IF_ERROR(ghost_.build("ghost", kBodyVertex, kGhostFragment));
  RETURN_IF_ERROR(inside_.build("inside", kBodyVertex, kInsideFragment));
  RETURN_IF_ERROR(section_.build("body section", kBodySectionVertex, kBodySectionFragment));
  return shadow_.build("shadow", kBodyVertex, kShadowFragment);
}

void BodyDrawing::setScene(const SceneView& scene) {
  const BodyMeshes meshes = bodyMeshesOf(scene);
  body_ = modelMatrix(scene.X_WL);
  skin_mesh_.upload(meshes.skin);
  far_skin_.upload(meshes.far_skin);
  bones_.upload(meshes.bones);
  parts_.clear();
  for (const BodyMeshes::Part& part : meshes.parts) {
    const LayerView& structure = scene.layers[part.structure];
    parts_.push_back(std::make_unique<Part>());
    parts_.back()->structure = part.structure;
    parts_.back()->colour = structure.colour;
    parts_.back()->line = structureKind(structure.kind).shape == StructureShape::kLine;
    parts_.back()->mesh.upload(part.mesh);
  }
  const Mesh hand = handMesh(syringeMesh(scene.needle.length_m));
  hand_.upload(hand);
  hand_low_m_ = {1, 1, 1};
  hand_high_m_ = {-1, -1, -1};
  for (const MeshVertex& vertex : hand.vertices) {
    const Vec3 p{static_cast<double>(vertex.p_m[0]), static_cast<double>(vertex.p_m[1]),
                 static_cast<double>(vertex.p_m[2])};
    hand_low_m_ = {std::min(hand_low_m_.x, p.x), std::min(hand_low_m_.y, p.y), std::min(hand_low_m_.z, p.z)};
    hand_high_m_ = {std::max(hand_high_m_.x, p.x), std::max(hand_high_m_.y, p.y),
                    std::max(hand_high_m_.z, p.z)};
  }
  if (square_.empty()) {
    Mesh square;
    for (const Vec3 corner : {Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{1, 1, 0}, Vec3{0, 1, 0}})
      addVertex(square, corner, {0, 0, 1});
    addTriangle(square, 0, 1, 2);
    addTriangle(square, 0, 2, 3);
    square_.upload(square);
  }
  fine_.key.clear();
  quick_.key.clear();
  names_.clear();
}

/// `program` has its view, with the ball: the fine skin ends there, the coarse one goes on.
void BodyDrawing::drawSkin(const GlProgram& program, const SceneView& scene, const Rgb& colour,
                           float opacity) const {
  program.set("colour", colour, opacity);
  skin_mesh_.draw();
  program.set("ball_W", scene.focus_W_m, kSeam_m - bodyBall_m(scene));
  far_skin_.draw();
}

void BodyDrawing::drawStill(const SceneView& scene, const SceneFrame& frame, const ViewOfScene& view,
                            const std::optional<PicturePlane>& cut, bool see_through, bool in_haste) {
  names_.clear();
  const double ball_m = bodyBall_m(scene);
  glEnable(GL_CULL_FACE);
  glCullFace(GL_BACK);
  glEnable(GL_CLIP_DISTANCE0);
  glEnable(GL_CLIP_DISTANCE1);
  if (!see_through) {
    const std::optional<Dimple> dimple = frame.show_needle ? dimpleOf(scene, frame.moment) : std::nullopt;
    const GlProgram& skin = dimple ? dimpled_ : skin_;
    setView(skin, view, body_, scene.focus_W_m, ball_m);
    if (cut) setCut(skin, *cut, true);
    if (dimple) {
      skin.set("dimple_W", dimple->place_W_m);
      skin.set("dimple_normal_W", dimple->normal_W);
      skin.set("dimple_depth", static_cast<float>(dimple->depth_m));
      skin.set("dimple_sigma", static_cast<float>(dimple->sigma_m));
    }
    drawSkin(skin, scene, kSkin, 1);
    // where the mesh ends, or before the cut's picture begins
    glCullFace(GL_FRONT);
    setView(inside_, view, body_, scene.focus_W_m, ball_m);
    if (cut) setCut(inside_, *cut, true);
    drawSkin(inside_, scene, kInside, 1);
    glCullFace(GL_BACK);
  }
  if (cut) {
    glDisable(GL_CULL_FACE);
    drawCut(scene, frame, view, *cut, in_haste);
    glEnable(GL_CULL_FACE);
  }
  const bool lines = frame.aids.has(pb::Exercise::ANATOMY);
  if (see_through || cut) {
    setView(tissue_, view, body_, scene.focus_W_m, ball_m);
    // before the cut: a slab
    if (cut) setCut(tissue_, {cut->place_W_m + cut->to_viewer_W * kSlab_m, cut->to_viewer_W}, true);
    if (see_through) {
      tissue_.set("shine", 0.10F);
      tissue_.set("colour", kBone, 1);
      bones_.draw();
    }
    glDisable(GL_CULL_FACE);  // sheets have thin rims
    for (const std::unique_ptr<Part>& part : parts_) {
      if (part->line ? !lines : !see_through) continue;
      tissue_.set("shine", part->line ? 0.30F : 0.16F);
      tissue_.set("colour", part->colour, 1);
      part->mesh.draw();
    }
    glEnable(GL_CULL_FACE);
  }
  if (see_through || (cut && !in_haste)) {
    glEnable(GL_BLEND);
    glDepthMask(GL_FALSE);
    setView(ghost_, view, body_, scene.focus_W_m, ball_m);
    if (cut) {
      setCut(ghost_, *cut, false);
      ghost_.set("colour", kBone, 0.10F);
      ghost_.set("rim", 0.50F);
      bones_.draw();
      setCut(ghost_, {cut->place_W_m + cut->to_viewer_W * kSlab_m, cut->to_viewer_W}, false);
      for (const std::unique_ptr<Part>& part : parts_) {
        if (!part->line || !lines) continue;
        ghost_.set("colour", part->colour, 0.16F);
        part->mesh.draw();
      }
      setCut(ghost_, *cut, false);
    }
    ghost_.set("rim", cut ? 0.22F : 0.55F);
    drawSkin(ghost_, scene, kSkin, cut ? 0.03F : 0.22F);
    glDepthMask(GL_TRUE);
    glDisable(GL_BLEND);
  }
  glDisable(GL_CLIP_DISTANCE0);
  glDisable(GL_CLIP_DISTANCE1);
  glDisable(GL_CULL_FACE);
}

void BodyDrawing::drawCut(const SceneView& scene, const SceneFrame& frame, const ViewOfScene& view,
                          const PicturePlane& plane, bool in_haste) {
  Cut& cut = in_haste ? quick_ : fine_;
  const std::optional<Dimple> dimple = frame.show_needle ? dimpleOf(scene, frame.moment) : std::nullopt;
  const OrbitCamera& camera = frame.camera;
  std::vector<double> key;
  for (const Vec3 v :
       {plane.place_W_m, plane.to_viewer_W, camera.focus_W_m, dimple ? dimple->place_W_m : Vec3{}})
    key.insert(key.end(), {v.x, v.y, v.z});
  key.insert(key.end(), {camera.elevation_rad, camera.distance_m, camera.field_of_view_rad,
                         view.width_per_height, dimple ? 1.0 : 0.0});
  if (key != cut.key) {
    BodySection made = bodySectionOf(scene, plane, camera, view.width_per_height,
                                     in_haste ? kQuickPicture_px : kFinePicture_px, dimple);
    cut.picture.upload(made.picture);
    cut.frame_W = made.frame_W;
    cut.names = std::move(made.names);
    cut.key = std::move(key);
  }
  section_.use();
  section_.set("view_projection", view.view_projection);
  section_.set("corner_W", cut.frame_W.corner_m);
  section_.set("across_W", cut.frame_W.across_m);
  section_.set("upward_W", cut.frame_W.upward_m);
  section_.set("picture", 0);
  if (!in_haste) glEnable(GL_SAMPLE_ALPHA_TO_COVERAGE);  // a smooth outline
  glActiveTexture(GL_TEXTURE0);
  glBindTexture(GL_TEXTURE_2D, static_cast<GLuint>(reinterpret_cast<std::uintptr_t>(cut.picture.id())));
  square_.draw();
  glDisable(GL_SAMPLE_ALPHA_TO_COVERAGE);
  glBindTexture(GL_TEXTURE_2D, 0);
  names_ = cut.names;
}

std::array<Vec3, 8> BodyDrawing::handBox(const OrbitCamera& camera, const Moment& moment) const {
  const HandAxes axes = handAxes(camera, moment);
  std::array<Vec3, 8> corners;
  for (unsigned i = 0; i < 8; ++i)
    corners[i] = moment.p_WT_m + axes.x * ((i & 1u) != 0 ? hand_high_m_.x : hand_low_m_.x) +
                 axes.y * ((i & 2u) != 0 ? hand_high_m_.y : hand_low_m_.y) +
                 axes.z * ((i & 4u) != 0 ? hand_high_m_.z : hand_low_m_.z);
  return corners;
}

void BodyDrawing::drawHand(const ViewOfScene& view, const OrbitCamera& camera, const Moment& moment) {
  const auto [x, y, z] = handAxes(camera, moment);
  const Vec3 p = moment.p_WT_m;
  const auto f = [](double value) { return static_cast<float>(value); };
  const Matrix4 model = {f(x.x), f(x.y), f(x.z), 0, f(y.x), f(y.y), f(y.z), 0,
                         f(z.x), f(z.y), f(z.z), 0, f(p.x), f(p.y), f(p.z), 1};
  // from behind the syringe it would hide the entry: glass
  const bool behind = -dot(z, normalized(view.eye_W_m - p)) > kBehindHand;
  const GlProgram& program = behind ? ghost_ : tissue_;
  glEnable(GL_CULL_FACE);
  setView(program, view, model);
  program.set("colour", kGlove, behind ? 0.12F : 1);
  program.set(behind ? "rim" : "shine", behind ? 0.6F : 0.12F);
  if (behind) {
    glEnable(GL_BLEND);
    glDepthMask(GL_FALSE);
  }
  hand_.draw();
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
  glDisable(GL_CULL_FACE);
}

const Mesh& BodyDrawing::makeShadow(const SceneView& scene, const ViewOfScene& view, const Moment& moment,
                                    const SyringeMesh& syringe) {
  shadow_mesh_ = {};
  const Vec3 axis_W = normalized(zAxis(moment.q_WT));
  const Vec3 across_W = cross(axis_W, view.light_W);
  if (!(normSquared(across_W) > 1e-4)) return shadow_mesh_;
  const Vec3 side_W = normalized(across_W);
  // from where the needle leaves the skin back to the syringe's middle
  const double in_m = moment.inside ? std::max(0.0, dot(moment.p_WT_m - moment.p_entry_W_m, axis_W)) : 0;
  const double front_m = scene.needle.length_m, hand_m = front_m + 0.035, end_m = front_m + 0.075;
  std::uint32_t before = 0;
  bool has_before = false;
  for (int row = 0; row <= kShadowRows; ++row) {
    const double share = static_cast<double>(row) / kShadowRows;
    const double back_m = in_m + 2e-4 + (end_m - in_m) * share * share;
    const Vec3 on_W_m = moment.p_WT_m - axis_W * back_m;
    const double held = std::clamp((back_m - hand_m) / 0.02, 0.0, 1.0);
    const double hub = std::clamp((back_m - front_m) / 0.015, 0.0, 1.0),
                 thin_m = 0.5 * drawnDiameter_m(scene);
    const double thick_m =
        thin_m + hub * (syringe.radius_m - thin_m) + held * held * (kHand_m - syringe.radius_m);
    double way_m = 0;
    const std::optional<Vec3> middle = castOnSkin(scene, on_W_m, view.light_W, way_m);
    const double half_m = thick_m * 1.3 + kPenumbra * way_m;
    const double fading = 1 - std::clamp((share - 0.8) / 0.2, 0.0, 1.0);
    const double dark =
        kShadowDark * std::min(1.0, 1.6 * thick_m / half_m) * (1 - way_m / kFarthestShadow_m) * fading;
    bool whole = middle.has_value() && dark > 0.004;
    std::vector<Vec3> places;
    for (int column = 0; whole && column <= kShadowColumns; ++column) {
      const double across = 2.0 * column / kShadowColumns - 1;
      double unused_m = 0;
      const auto at = castOnSkin(scene, on_W_m + side_W * (across * half_m) + view.light_W * 2e-3,
                                 view.light_W, unused_m);
      whole = at.has_value();
      if (whole) places.push_back(*at + view.light_W * 2e-4);
    }
    if (!whole) {
      fadeOut(shadow_mesh_, has_before ? 2 : 0);
      has_before = false;
      continue;
    }
    const auto first = static_cast<std::uint32_t>(shadow_mesh_.vertices.size());
    for (int column = 0; column <= kShadowColumns; ++column)
      addVertex(shadow_mesh_, places[static_cast<std::size_t>(column)],
                {2.0 * column / kShadowColumns - 1, dark, 0});
    if (has_before)
      for (std::uint32_t column = 0; column < kShadowColumns; ++column) {
        addTriangle(shadow_mesh_, before + column, before + column + 1, first + column + 1);
        addTriangle(shadow_mesh_, before + column, first + column + 1, first + column);
      }
    before = first;
    has_before = true;
  }
  return shadow_mesh_;
}

void BodyDrawing::drawShadow(const ViewOfScene& view, const std::optional<PicturePlane>& cut) {
  if (shadow_mesh_.triangles.empty()) return;
  shadow_gl_.upload(shadow_mesh_);
  setView(shadow_, view, modelMatrix({}));
  if (cut) {
    glEnable(GL_CLIP_DISTANCE0);
    setCut(shadow_, *cut, true);
  }
  glEnable(GL_BLEND);
  glDepthMask(GL_FALSE);
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(-2, -8);
  shadow_gl_.draw();
  glDisable(GL_POLYGON_OFFSET_FILL);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
  if (cut) glDisable(GL_CLIP_DISTANCE0);
}

}  // namespace needlelab
