#include "client/view/scene/scene_renderer.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "client/view/gl_objects.h"
#include "client/view/model/mesh.h"
#include "client/view/scene/scene_drawing.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

// surfaces: lit from the eye's upper left, with a highlight and a rim that makes edges visible
constexpr const char* kSolidVertex = R"(#version 330 core
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
uniform mat4 view_projection;
uniform mat4 model;
out vec3 p_W;
out vec3 n_W;
void main() {
  vec4 world = model * vec4(place, 1.0);
  p_W = world.xyz;
  n_W = mat3(model) * normal;
  gl_Position = view_projection * world;
})";
constexpr const char* kSolidFragment = R"(#version 330 core
in vec3 p_W;
in vec3 n_W;
uniform vec4 colour;
uniform vec3 eye_W;
uniform vec3 light_W;      // toward the light
uniform float shine;       // of the highlight
uniform float rim;         // more opaque at the edges: glass
uniform int cut;           // 1: only what is behind the cut; -1: only what is before it
uniform vec3 cut_place_W;
uniform vec3 cut_normal_W; // toward the eye
out vec4 shown;
void main() {
  float before = dot(p_W - cut_place_W, cut_normal_W);
  if (cut != 0 && before * float(cut) > 0.0) discard;
  vec3 to_eye = normalize(eye_W - p_W);
  vec3 n = normalize(n_W);
  if (dot(n, to_eye) < 0.0) n = -n;
  float lit = max(dot(n, light_W), 0.0);
  float soft = 0.5 + 0.5 * dot(n, light_W);
  float edge = 1.0 - abs(dot(n, to_eye));
  vec3 half_way = normalize(light_W + to_eye);
  // to the 48th, without a logarithm
  float g = max(dot(n, half_way), 0.0);
  g *= g;
  g *= g;
  g *= g;
  g *= g;
  float glint = shine * g * g * g;
  vec3 light = colour.rgb * (0.30 + 0.30 * soft + 0.48 * lit) + vec3(glint);
  float opacity = mix(colour.a, min(1.0, colour.a + rim), edge * edge);
  shown = vec4(light, opacity);
})";

// the cut: a flat sheet coloured by the tissue at each depth
constexpr const char* kSectionVertex = R"(#version 330 core
layout(location = 0) in vec3 place;  // x across, y up, in the unit square
uniform mat4 view_projection;
uniform vec3 corner_W;
uniform vec3 across_W;
uniform vec3 upward_W;
out vec3 p_W;
out vec2 at;
void main() {
  p_W = corner_W + across_W * place.x + upward_W * place.y;
  at = place.xy;
  gl_Position = view_projection * vec4(p_W, 1.0);
})";
constexpr const char* kSectionFragment = R"(#version 330 core
in vec3 p_W;
in vec2 at;
uniform int shape;          // 0 plane, 1 sphere, 2 capsule
uniform vec3 a_W;
uniform vec3 b_W;
uniform float radius;
uniform vec3 normal_W;
uniform float deepest;      // of the table
uniform float period;       // of the table, along the layers
uniform vec3 along_W;
uniform float fades;        // 1: ends softly at the sides and below
uniform sampler2D table;
out vec4 shown;
void main() {
  float depth;
  if (shape == 0) {
    depth = -dot(normal_W, p_W - a_W);
  } else {
    vec3 ab = b_W - a_W;
    float t = shape == 1 ? 0.0 : clamp(dot(p_W - a_W, ab) / dot(ab, ab), 0.0, 1.0);
    depth = radius - distance(p_W, a_W + ab * t);
  }
  if (depth <= 0.0) discard;
  vec3 tissue = texture(table, vec2(depth / deepest, dot(p_W, along_W) / period)).rgb;
  float opacity = 1.0;
  if (fades > 0.0) {
    float side = abs(at.x - 0.5) * 2.0;
    opacity = (1.0 - smoothstep(0.80, 1.0, side)) * smoothstep(0.0, 0.10, at.y);
  }
  shown = vec4(tissue, opacity);
})";

// the background: slightly lighter in the middle, so that the dark syringe stands out
constexpr const char* kBackdropVertex = R"(#version 330 core
layout(location = 0) in vec3 place;
out vec2 at;
void main() {
  at = place.xy;
  gl_Position = vec4(place.xy * 2.0 - 1.0, 0.99999, 1.0);
})";
constexpr const char* kBackdropFragment = R"(#version 330 core
in vec2 at;
uniform vec4 low;
uniform vec4 high;
out vec4 shown;
void main() {
  shown = mix(low, high, at.y);
})";

// smaller changes are invisible and do not trigger a redraw
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
  key.insert(key.end(), {moment.inside ? 1.0 : 0.0, isCapped(moment) ? 1.0 : 0.0});
  if (!moment.inside) return;
  addPlace(key, moment.p_entry_W_m);
  for (const double value : {moment.u_W.x, moment.u_W.y, moment.u_W.z}) addStepped(key, value, kSeenAngle);
  if (aids.has(pb::Exercise::GUIDES)) {
    addPlace(key, moment.wall_W_m);
  }
  if (aids.has(pb::Exercise::ARROWS))
    for (const EffectEntry* effect : effectsAsShown()) addStepped(key, termOf(*effect, moment), kSeenForce_N);
}

std::vector<double> stillKey(const SceneView& scene, const SceneFrame& frame, int width_px, int height_px) {
  std::vector<double> key;
  key.push_back(width_px);
  key.push_back(height_px);
  const OrbitCamera& camera = frame.camera;
  for (const Vec3 v : {camera.focus_W_m, camera.up_W, camera.front_W}) key.insert(key.end(), {v.x, v.y, v.z});
  key.insert(key.end(),
             {camera.azimuth_rad, camera.elevation_rad, camera.distance_m, camera.field_of_view_rad,
              frame.cut_open ? 1.0 : 0.0, frame.aids.has(pb::Exercise::TISSUES) ? 1.0 : 0.0,
              frame.aids.has(pb::Exercise::ANATOMY) ? 1.0 : 0.0});
  if (scene.body) {  // the cut and the dimple are at the needle
    const bool inside = frame.show_needle && frame.moment.inside;
    key.push_back(inside ? 1 : 0);
    if (inside) {
      addPlace(key, frame.moment.p_entry_W_m);
      for (const double value : {frame.moment.u_W.x, frame.moment.u_W.y, frame.moment.u_W.z})
        addStepped(key, value, kSeenAngle);
    } else if (frame.plan_W && frame.aids.has(pb::Exercise::PLANNED_LINE)) {
      addPlace(key, frame.plan_W->entry_W_m);
      addPlace(key, frame.plan_W->to_W_m);
    }
  }
  return key;
}

std::vector<double> movingKey(const SceneFrame& frame) {
  std::vector<double> key;
  key.reserve(80);
  key.insert(key.end(), {frame.arrow_extents_per_N, frame.show_needle ? 1.0 : 0.0,
                         frame.aids.has(pb::Exercise::GUIDES) ? 1.0 : 0.0,
                         frame.aids.has(pb::Exercise::ARROWS) ? 1.0 : 0.0, frame.show_hand ? 1.0 : 0.0});
  if (frame.show_needle) addMoment(key, frame.moment, frame.aids);
  if (frame.second) addMoment(key, *frame.second, AidSet{});
  return key;
}

// A 1 × 1 square; its z is the backdrop's depth, far behind.
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
  auto parts = std::make_unique<SceneParts>(samples > 1 ? 4 : 1);
  RETURN_IF_ERROR(parts->solid.build("solid", kSolidVertex, kSolidFragment));
  RETURN_IF_ERROR(parts->section.build("section", kSectionVertex, kSectionFragment));
  RETURN_IF_ERROR(parts->backdrop.build("backdrop", kBackdropVertex, kBackdropFragment));
  RETURN_IF_ERROR(parts->body.build());
  parts->unit_square.upload(unitSquare());
  parts->ball.upload(ballMesh(1, 14));
  parts->arrow.upload(arrowMesh());
  parts->ring.upload(latheMesh({{0.8, 0}, {0.8, 0.1}, {1, 0.1}, {1, 0}}, 32));
  return std::unique_ptr<SceneRenderer>(new SceneRenderer(std::move(parts)));
}

SceneRenderer::SceneRenderer(std::unique_ptr<SceneParts> parts) : parts_(std::move(parts)) {}
SceneRenderer::~SceneRenderer() = default;

void SceneRenderer::setScene(std::shared_ptr<const SceneView> scene) {
  SceneParts& parts = *parts_;
  parts.scene = std::move(scene);
  parts.still_key.clear();
  parts.still_changed_before = false;
  parts.shown = nullptr;
  parts.hazards.clear();
  if (!parts.scene) return;
  const SceneView& view = *parts.scene;
  if (view.body) {
    parts.body.setScene(view);
  } else {
    parts.table.upload(tissueTable(view, deepestLayer_m(view)));
    // the table repeats along the layers
    glBindTexture(GL_TEXTURE_2D, static_cast<GLuint>(reinterpret_cast<std::uintptr_t>(parts.table.id())));
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_REPEAT);
    glBindTexture(GL_TEXTURE_2D, 0);
    parts.skin.upload(layerSurface(view, 0));
  }
  for (const HazardView& hazard : view.hazards) {
    parts.hazards.push_back(std::make_unique<GlMesh>());
    parts.hazards.back()->upload(tubeMesh(hazard.a_W_m, hazard.b_W_m, hazard.radius_m, 10, 36));
  }
  parts.needle.upload(needleMesh(view.needle, drawnDiameter_m(view)));
  if (view.cap_radius_m > 0) parts.cap.upload(tubeMesh({}, {0, 0, -view.needle.length_m}, view.cap_radius_m));
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
  SceneParts& parts = *parts_;
  if (!parts.scene || width_px < 1 || height_px < 1) return false;
  std::vector<double> still = stillKey(*parts.scene, frame, width_px, height_px), moving = movingKey(frame);
  const bool still_changed = still != parts.still_key;
  // fine picture when the camera rests; a first one comes sooner in haste
  const bool in_haste = still_changed && (parts.still_changed_before || !parts.shown) && parts.has_quick;
  SceneBuffers& buffers = in_haste ? parts.quick : parts.fine;
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
  SceneParts& parts = *parts_;
  if (parts.shown == nullptr) return;
  parts.shown_corner_px = corner_px;
  for (const float number : {corner_px.x, corner_px.y}) noteContent(std::bit_cast<std::uint32_t>(number));
  // copy without blending: ten times cheaper than a textured rectangle with software rendering
  list.AddCallback(
      [](const ImDrawList*, const ImDrawCmd* command) {
        const SceneParts& of = *static_cast<const SceneParts*>(command->UserCallbackData);
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

const std::vector<BodySection::Name>& SceneRenderer::cutNames() const {
  return parts_->body.names();
}

double SceneRenderer::lastDraw_s() const {
  return parts_->last_draw_s;
}

}  // namespace needlelab
