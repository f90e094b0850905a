#include "client/view/scene_renderer.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "client/view/model/mesh_tools.h"
#include "client/view/redraw.h"
#include "client/view/scene_parts.h"
#include "client/view/scene_shaders.h"
#include "client/view/surface_pixels.h"
#include "client/view/tissue_table.h"
#include "common/base/clock.h"

namespace needlelab {
namespace {

// finer than this nobody sees: what changes less is not drawn anew
constexpr double kSeenLength_m = 2e-5, kSeenAngle = 2e-3, kSeenForce_N = 0.01;

void addStepped(std::vector<double>& key, double value, double step) {
  key.push_back(std::isfinite(value) ? std::round(value / step) : -1e18);
}

void addPlace(std::vector<double>& key, Vec3 p_m) {
  for (const double value : {p_m.x, p_m.y, p_m.z}) addStepped(key, value, kSeenLength_m);
}

void addMoment(std::vector<double>& key, const Moment& moment, const AidSet& aids) {
  addPlace(key, moment.p_WT_m);
  for (const double value : {moment.q_WT.x, moment.q_WT.y, moment.q_WT.z, moment.q_WT.w})
    addStepped(key, value, kSeenAngle / 2);
  addStepped(key, moment.plunger, 0.004);
  key.push_back(moment.inside ? 1 : 0);
  if (!moment.inside) return;
  addPlace(key, moment.p_entry_W_m);
  for (const double value : {moment.u_W.x, moment.u_W.y, moment.u_W.z}) addStepped(key, value, kSeenAngle);
  if (aids.has(pb::Exercise::GUIDES)) {
    addStepped(key, moment.alpha_rad, 0.004);
    addPlace(key, moment.wall_W_m);
    key.push_back(moment.tilt_rad > 0.85 * moment.alpha_rad ? 1 : 0);
  }
  if (aids.has(pb::Exercise::ARROWS))
    for (const EffectEntry* effect : effectsAsShown()) addStepped(key, termOf(*effect, moment), kSeenForce_N);
}

std::vector<double> stillKey(const SceneFrame& frame, int width_px, int height_px) {
  std::vector<double> key;
  key.push_back(width_px);
  key.push_back(height_px);
  const OrbitCamera& camera = frame.camera;
  for (const Vec3 v : {camera.focus_W_m, camera.up_W, camera.front_W}) key.insert(key.end(), {v.x, v.y, v.z});
  key.insert(key.end(),
             {camera.azimuth_rad, camera.elevation_rad, camera.distance_m, camera.field_of_view_rad,
              frame.cut_open ? 1.0 : 0.0, frame.aids.has(pb::Exercise::TISSUES) ? 1.0 : 0.0,
              frame.aids.has(pb::Exercise::ANATOMY) ? 1.0 : 0.0});
  return key;
}

std::vector<double> movingKey(const SceneFrame& frame) {
  std::vector<double> key;
  key.reserve(80);
  key.insert(key.end(), {frame.arrow_extents_per_N, frame.show_needle ? 1.0 : 0.0,
                         frame.aids.has(pb::Exercise::GUIDES) ? 1.0 : 0.0,
                         frame.aids.has(pb::Exercise::ARROWS) ? 1.0 : 0.0});
  if (frame.show_needle) addMoment(key, frame.moment, frame.aids);
  if (frame.second) addMoment(key, *frame.second, AidSet{});
  return key;
}

// a square of 1 by 1; its z is the backdrop's depth, far behind
Mesh unitSquare() {
  Mesh mesh;
  for (const Vec3 corner : {Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{1, 1, 0}, Vec3{0, 1, 0}})
    addVertex(mesh, corner, {0, 0, 1});
  addTriangle(mesh, 0, 1, 2);
  addTriangle(mesh, 0, 2, 3);
  return mesh;
}

}  // namespace

Result<std::unique_ptr<SceneRenderer>> SceneRenderer::make(int samples) {
  auto parts = std::make_unique<Parts>(samples > 1 ? 4 : 1);
  if (Status built = parts->solid.build("solid", kSolidVertex, kSolidFragment); !built) return built.error();
  if (Status built = parts->section.build("section", kSectionVertex, kSectionFragment); !built)
    return built.error();
  if (Status built = parts->backdrop.build("backdrop", kBackdropVertex, kBackdropFragment); !built)
    return built.error();
  parts->unit_square.upload(unitSquare());
  parts->ball.upload(ballMesh(1, 14));
  parts->arrow.upload(arrowMesh());
  // from its apex at the origin to radius 1 at z = 1
  parts->cone.upload(latheMesh({{0, 0}, {1, 1}}, 40));
  parts->ring.upload(latheMesh({{0.8, 0}, {0.8, 0.1}, {1, 0.1}, {1, 0}}, 32));
  return std::unique_ptr<SceneRenderer>(new SceneRenderer(std::move(parts)));
}

SceneRenderer::SceneRenderer(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
SceneRenderer::~SceneRenderer() = default;

void SceneRenderer::setScene(std::shared_ptr<const SceneView> scene) {
  Parts& parts = *parts_;
  parts.scene = std::move(scene);
  parts.still_key.clear();
  parts.still_changed_before = false;
  parts.shown = nullptr;
  parts.hazards.clear();
  if (!parts.scene) return;
  const SceneView& view = *parts.scene;
  parts.table.upload(tissueTable(view, deepestLayer_m(view)));
  // the table repeats along the layers
  glBindTexture(GL_TEXTURE_2D, static_cast<GLuint>(reinterpret_cast<std::uintptr_t>(parts.table.id())));
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_REPEAT);
  glBindTexture(GL_TEXTURE_2D, 0);
  parts.skin.upload(layerSurface(view, 0));
  for (const HazardView& hazard : view.hazards) {
    parts.hazards.push_back(std::make_unique<GlMesh>());
    parts.hazards.back()->upload(tubeMesh(hazard.a_W_m, hazard.b_W_m, hazard.radius_m, 10, 36));
  }
  parts.needle.upload(needleMesh(view.needle, drawnDiameter_m(view)));
  parts.syringe = syringeMesh(view.needle.length_m);
  parts.hub.upload(parts.syringe.hub);
  parts.barrel.upload(parts.syringe.barrel);
  parts.marks.upload(parts.syringe.scale);
  parts.plunger.upload(parts.syringe.plunger);
  parts.liquid.upload(latheMesh({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, 24));
}

const SceneView* SceneRenderer::scene() const {
  return parts_->scene.get();
}

bool SceneRenderer::draw(const SceneFrame& frame, int width_px, int height_px) {
  Parts& parts = *parts_;
  if (!parts.scene || width_px < 1 || height_px < 1) return false;
  std::vector<double> still = stillKey(frame, width_px, height_px), moving = movingKey(frame);
  const bool still_changed = still != parts.still_key;
  // a camera that has come to rest gets the fine picture
  const bool turning = still_changed && parts.still_changed_before && parts.has_quick;
  SceneBuffers& buffers = turning ? parts.quick : parts.fine;
  const bool limb_too = still_changed || parts.shown != &buffers;
  parts.still_changed_before = still_changed;
  if (!limb_too && moving == parts.moving_key) return false;
  const std::int64_t began_ns = steadyNowNs();
  parts.drawInto(buffers, frame, width_px, height_px, limb_too);
  if (wait_for_pixels) glFinish();
  parts.last_draw_s = static_cast<double>(steadyNowNs() - began_ns) * 1e-9;
  parts.shown = &buffers;
  parts.still_key = std::move(still);
  parts.moving_key = std::move(moving);
  noteTextureChange();
  return true;
}

ImTextureID SceneRenderer::texture() const {
  return reinterpret_cast<ImTextureID>(
      static_cast<std::uintptr_t>(parts_->shown != nullptr ? parts_->shown->picture.texture() : 0));
}

RgbaImage SceneRenderer::picture() const {
  return parts_->shown != nullptr ? parts_->shown->picture.read() : RgbaImage{};
}

void SceneRenderer::show(ImDrawList& list, ImVec2 corner_px) {
  Parts& parts = *parts_;
  if (parts.shown == nullptr) return;
  parts.shown_corner_px = corner_px;
  for (const float number : {corner_px.x, corner_px.y}) noteContent(std::bit_cast<std::uint32_t>(number));
  // copied, not blended: ten times cheaper than a textured rectangle where the processor draws
  list.AddCallback(
      [](const ImDrawList*, const ImDrawCmd* command) {
        const Parts& of = *static_cast<const Parts*>(command->UserCallbackData);
        const FrameBuffer& picture = of.shown->picture;
        const ImVec2 from = of.shown_corner_px;
        const ImVec2 to{from.x + static_cast<float>(picture.width()),
                        from.y + static_cast<float>(picture.height())};
        const PixelRect seen = surfacePixels(from, to, command->ClipRect);
        if (seen.empty()) return;
        glScissor(seen.x, seen.y, seen.width, seen.height);
        constexpr float kAll = 1e6F;
        const PixelRect all = surfacePixels(from, to, {-kAll, -kAll, kAll, kAll});
        picture.showAt(all.x, all.y);
      },
      &parts);
}

double SceneRenderer::lastDraw_s() const {
  return parts_->last_draw_s;
}

}  // namespace needlelab
