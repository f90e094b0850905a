// The passes of a drawing, in order: opaque surfaces, hidden parts that shine through, transparent surfaces.
#include "client/view/scene/scene_drawing.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

constexpr Rgb kSteel = rgbOf(0xCBD3DC), kHubBlue = rgbOf(0x3F7FBF), kCapColour = rgbOf(0xE9C46A),
              kGlass = rgbOf(0xBFD9EA), kPlungerGrey = rgbOf(0x4A5361), kMarkInk = rgbOf(0x1B2A3A),
              kLiquid = rgbOf(0x8FC7F0);
constexpr double kMark_m = 2.5e-3;
constexpr Rgb kBackdropLow = rgbOf(0x171B21), kBackdropHigh = rgbOf(0x303947);

float asFloat(double value) {
  return static_cast<float>(value);
}

}  // namespace

Matrix4 modelMatrix(const Pose& X, Vec3 scale) {
  const Vec3 x = rotate(X.q, {scale.x, 0, 0}), y = rotate(X.q, {0, scale.y, 0}),
             z = rotate(X.q, {0, 0, scale.z});
  return {asFloat(x.x), asFloat(x.y), asFloat(x.z), 0, asFloat(y.x),   asFloat(y.y),   asFloat(y.z),   0,
          asFloat(z.x), asFloat(z.y), asFloat(z.z), 0, asFloat(X.p.x), asFloat(X.p.y), asFloat(X.p.z), 1};
}

Pose poseTowards(Vec3 p, Vec3 axis) {
  const double w = 1 + axis.z;
  if (w < 1e-9) return {p, {1, 0, 0, 0}};
  return {p, normalized(Quat{-axis.y, axis.x, 0, w})};
}

void SceneParts::put(const GlMesh& mesh, const Matrix4& model, Rgb colour, float opacity, float shine,
                     float rim) const {
  solid.set("model", model);
  solid.set("colour", colour, opacity);
  solid.set("shine", shine);
  solid.set("rim", rim);
  mesh.draw();
}

void SceneParts::drawInto(SceneBuffers& buffers, const SceneFrame& now, int width_px, int height_px,
                          bool limb_too) {
  frame = &now;
  open = now.cut_open && now.aids.has(pb::Exercise::TISSUES);
  glDisable(GL_SCISSOR_TEST);
  setView(width_px, height_px);
  glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
  if (limb_too) {
    buffers.still.bind(width_px, height_px);
    drawStill(&buffers == &quick && has_quick);
    buffers.picture.bind(width_px, height_px);
    covered = buffers.picture.whole();
  }
  // restore the area that the needle covered, then draw the needle at its new pose
  const PixelRect moving = movingRect(width_px, height_px), changed = joined(covered, moving);
  buffers.picture.copyFrom(buffers.still, changed);
  buffers.picture.bind(width_px, height_px);
  if (!moving.empty()) {
    glEnable(GL_SCISSOR_TEST);
    glScissor(moving.x, moving.y, moving.width, moving.height);
    drawMoving();
    glDisable(GL_SCISSOR_TEST);
  }
  covered = moving;
  glUseProgram(0);
  buffers.picture.resolve(changed);
}

// Draws opaque surfaces first (skin and cut), then hidden parts that shine through from inside the tissue.
void SceneParts::drawStill(bool in_haste) {
  glDisable(GL_CULL_FACE);
  glDisable(GL_BLEND);
  glDepthMask(GL_TRUE);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LEQUAL);
  glClearDepth(1);
  glClear(GL_DEPTH_BUFFER_BIT);
  drawBackdrop();
  if (scene->body) {
    const bool see_through = !open && frame->aids.has(pb::Exercise::TISSUES);
    body.drawStill(*scene, *frame, seen, bodyCut(), see_through, in_haste);
  } else {
    drawSkin();
    if (open) drawSection();
  }
  solid.use();
  if (frame->aids.has(pb::Exercise::ANATOMY)) {
    glEnable(GL_BLEND);
    glEnable(GL_CULL_FACE);
    glDepthMask(GL_FALSE);
    glDepthFunc(GL_GREATER);
    drawAnatomy(0.42F);
    glDisable(GL_BLEND);
    glDisable(GL_CULL_FACE);
    glDepthMask(GL_TRUE);
    glDepthFunc(GL_LEQUAL);
    drawAnatomy(1);
  }
  if (open && !in_haste && !scene->body) {
    glEnable(GL_BLEND);
    glDepthMask(GL_FALSE);
    drawFrontSkin();
    glDisable(GL_BLEND);
    glDepthMask(GL_TRUE);
  }
  glDisable(GL_DEPTH_TEST);
}

// Draws the needle faint inside the tissue and solid in front of it, then the transparent parts from the
// inside outward.
void SceneParts::drawMoving() {
  glEnable(GL_DEPTH_TEST);
  if (scene->body && frame->show_needle) {
    glDepthFunc(GL_LEQUAL);
    body.drawShadow(seen, bodyCut());
    if (frame->show_hand) body.drawHand(seen, frame->camera, frame->moment);
  }
  solid.use();
  if (scene->body && frame->show_needle && frame->moment.inside) drawEntryMark();
  if (frame->aids.has(pb::Exercise::TISSUES)) {
    glEnable(GL_BLEND);
    glEnable(GL_CULL_FACE);
    glDepthMask(GL_FALSE);
    glDepthFunc(GL_GREATER);
    if (frame->show_needle) drawInstrument(frame->moment, kSteel, 0.55F);
    if (frame->second) drawInstrument(*frame->second, kSecondGesture, 0.45F);
    glDisable(GL_BLEND);
    glDisable(GL_CULL_FACE);
  }
  glDepthMask(GL_TRUE);
  glDepthFunc(GL_LEQUAL);
  if (frame->show_needle) drawInstrument(frame->moment, kSteel, 1);
  if (frame->second) drawInstrument(*frame->second, kSecondGesture, 1);
  glEnable(GL_BLEND);
  glDepthMask(GL_FALSE);
  if (frame->show_needle) drawGlass(frame->moment);
  if (frame->show_needle && frame->moment.inside && frame->aids.has(pb::Exercise::GUIDES)) drawGuides();
  if (frame->show_needle && frame->moment.inside && frame->aids.has(pb::Exercise::ARROWS)) drawArrows();
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
  glDisable(GL_DEPTH_TEST);
}

void SceneParts::drawBackdrop() {
  glDepthMask(GL_FALSE);
  backdrop.use();
  backdrop.set("low", kBackdropLow, 1);
  backdrop.set("high", kBackdropHigh, 1);
  unit_square.draw();
  glDepthMask(GL_TRUE);
}

void SceneParts::setView(int width_px, int height_px) {
  const OrbitCamera& camera = frame->camera;
  const Matrix4 view = camera.view(), projection = camera.projection(width_px, height_px);
  Matrix4 both{};
  for (std::size_t column = 0; column < 4; ++column)
    for (std::size_t row = 0; row < 4; ++row)
      for (std::size_t k = 0; k < 4; ++k)
        both[4 * column + row] += projection[4 * k + row] * view[4 * column + k];

  // the cut is upright, faces the eye, and lies slightly behind the target
  insertion_plane = insertionPlaneOf(*scene, camera);
  cut_normal_W = insertion_plane.to_viewer_W;
  cut_place_W_m = insertion_plane.place_W_m - cut_normal_W * (0.10 * scene->extent_m);

  if (const auto plane = bodyCut()) insertion_plane = *plane;

  const Vec3 forward = normalized(camera.focus_W_m - camera.eye_W_m());
  const Vec3 light = normalized(camera.upward_W() * 0.85 - camera.right_W() * 0.5 - forward * 0.75);
  seen = {both, camera.eye_W_m(), light, camera.upward_W(),
          static_cast<double>(width_px) / std::max(height_px, 1)};
  section.use();
  section.set("view_projection", both);
  solid.use();
  solid.set("view_projection", both);
  solid.set("eye_W", camera.eye_W_m());
  solid.set("light_W", light);
  solid.set("cut_place_W", cut_place_W_m);
  solid.set("cut_normal_W", cut_normal_W);
  solid.set("cut", 0);
}

std::optional<PicturePlane> SceneParts::bodyCut() const {
  if (!scene->body || !open) return std::nullopt;
  const bool planned = frame->plan_W && frame->aids.has(pb::Exercise::PLANNED_LINE);
  return bodyCutOf(*scene, frame->camera, frame->show_needle ? &frame->moment : nullptr,
                   planned ? &*frame->plan_W : nullptr);
}

// A drop of blood where the needle went in.
void SceneParts::drawEntryMark() {
  const Vec3 out = dimpleOf(*scene, frame->moment)->normal_W;
  const double down_m = dimpleOf(*scene, frame->moment)->depth_m, wide_m = 1.3e-3;
  put(ball, modelMatrix(poseTowards(frame->moment.p_entry_W_m - out * down_m, out), {wide_m, wide_m, 0.4e-3}),
      rgbOf(0x8C1D1D), 1, 0.5F);
}

PixelRect SceneParts::movingRect(int width_px, int height_px) {
  double left = width_px, right = 0, top = height_px, low = 0;
  bool all = false;
  const auto take = [&](Vec3 p_W_m, double radius_m) {
    const auto at = frame->camera.project(p_W_m, width_px, height_px);
    if (!at) {
      all = true;  // beside the eye: use the whole picture
      return;
    }
    const double near_m = std::max(
        0.05 * frame->camera.distance_m,
        dot(normalized(frame->camera.focus_W_m - frame->camera.eye_W_m()), p_W_m - frame->camera.eye_W_m()) -
            radius_m);
    const double radius_px =
        radius_m / near_m * height_px / 2 / std::tan(frame->camera.field_of_view_rad / 2) + 3;
    left = std::min(left, at->x_px - radius_px);
    right = std::max(right, at->x_px + radius_px);
    top = std::min(top, at->y_px - radius_px);
    low = std::max(low, at->y_px + radius_px);
  };
  const auto takeInstrument = [&](const Moment& moment) {
    const Vec3 axis_W = normalized(zAxis(moment.q_WT));
    const double end_m = -syringe.end_z_m, hub_m = scene->needle.length_m;
    take(moment.p_WT_m, std::max(drawnDiameter_m(*scene), scene->cap_radius_m));
    for (const double back_m : {hub_m, 0.5 * (hub_m + end_m), end_m})
      take(moment.p_WT_m - axis_W * back_m, 2.2 * syringe.radius_m);
  };
  if (frame->second) takeInstrument(*frame->second);
  if (frame->show_needle) {
    const Moment& moment = frame->moment;
    takeInstrument(moment);
    if (scene->body) {
      for (const MeshVertex& vertex : body.makeShadow(*scene, seen, moment, syringe).vertices)
        take({static_cast<double>(vertex.p_m[0]), static_cast<double>(vertex.p_m[1]),
              static_cast<double>(vertex.p_m[2])},
             0);
      if (frame->show_hand)
        for (const Vec3 corner_W_m : body.handBox(frame->camera, moment)) take(corner_W_m, 0);
      if (moment.inside) take(moment.p_entry_W_m, 3e-3);
    }
    if (moment.inside && frame->aids.has(pb::Exercise::GUIDES)) {
      take(moment.p_entry_W_m, 0.06 * scene->extent_m);
      if (isFinite(moment.wall_W_m)) take(moment.wall_W_m, 0.06 * scene->extent_m);
    }
    if (moment.inside && frame->aids.has(pb::Exercise::ARROWS)) {
      double along_N = 0;
      for (const EffectEntry* effect : effectEntries())
        if (effect->along_u) along_N += std::fabs(moment.term(effect->effect));
      const double m_per_N = frame->arrow_extents_per_N * scene->extent_m, wide_m = 0.15 * scene->extent_m;
      for (const double way : {-1.0, 0.0, 1.0})
        take(moment.p_entry_W_m + moment.u_W * (way * along_N * m_per_N), wide_m);
      take(moment.p_WT_m + moment.clamping_W * (moment.term(Effect::kClamping) * m_per_N), wide_m);
    }
  }
  if (all) return {0, 0, width_px, height_px};
  const int x0 = std::clamp(static_cast<int>(std::floor(left)), 0, width_px),
            x1 = std::clamp(static_cast<int>(std::ceil(right)), 0, width_px);
  const int y0 = std::clamp(static_cast<int>(std::floor(height_px - low)), 0, height_px),
            y1 = std::clamp(static_cast<int>(std::ceil(height_px - top)), 0, height_px);
  return {x0, y0, x1 - x0, y1 - y0};
}

void SceneParts::drawSkin() {
  solid.use();
  solid.set("cut", open ? 1 : 0);
  glEnable(GL_CULL_FACE);  // its inside is never visible
  put(skin, modelMatrix({}), mixed(scene->layers.front().colour, kBlack, 0.06F), 1, 0.10F);
  glDisable(GL_CULL_FACE);
  solid.set("cut", 0);
}

// A sheet in the cut's plane, large enough for the limb; the shader keeps only tissue.
void SceneParts::drawSection() {
  const Vec3 up = scene->focus_normal_W, across = cross(up, cut_normal_W);
  const double reach_m = 1.35 * scene->extent_m;
  double half_m = reach_m, below_m = deepestLayer_m(*scene);
  section.use();
  section.set("fades", 1.0F);
  section.set("radius", 0.0F);
  section.set("normal_W", up);
  if (const auto* plane = std::get_if<PlaneLimb>(&scene->limb_W)) {
    section.set("shape", 0);
    section.set("a_W", plane->point_m);
    section.set("b_W", plane->point_m);
    below_m = std::min(below_m, 2.2 * reach_m);
  } else if (const auto* sphere = std::get_if<SphereLimb>(&scene->limb_W)) {
    section.set("shape", 1);
    section.set("a_W", sphere->center_m);
    section.set("b_W", sphere->center_m);
    section.set("radius", asFloat(sphere->radius_m));
    section.set("fades", 0.0F);
    half_m = 1.01 * sphere->radius_m;
    below_m = 2.01 * sphere->radius_m;
  } else {
    const auto& capsule = std::get<CapsuleLimb>(scene->limb_W);
    section.set("shape", 2);
    section.set("a_W", capsule.a_m);
    section.set("b_W", capsule.b_m);
    section.set("radius", asFloat(capsule.radius_m));
    // ends naturally across the limb, and fades along it
    const double lengthwise = std::fabs(dot(across, normalized(capsule.b_m - capsule.a_m)));
    half_m = std::max(1.35 * reach_m, 1.02 * capsule.radius_m);
    section.set("fades", lengthwise > 0.3 ? 1.0F : 0.0F);
    below_m = 2.02 * capsule.radius_m;
  }
  const Vec3 corner = cut_place_W_m - across * half_m - up * below_m;
  section.set("corner_W", corner);
  section.set("across_W", across * (2 * half_m));
  section.set("upward_W", up * (below_m + 0.02 * scene->extent_m));
  section.set("deepest", asFloat(deepestLayer_m(*scene)));
  section.set("period", asFloat(kTablePeriod_m));
  section.set("along_W", across);
  section.set("table", 0);
  glActiveTexture(GL_TEXTURE0);
  glBindTexture(GL_TEXTURE_2D, static_cast<GLuint>(reinterpret_cast<std::uintptr_t>(table.id())));
  glEnable(GL_BLEND);
  unit_square.draw();
  glDisable(GL_BLEND);
  glBindTexture(GL_TEXTURE_2D, 0);
}

void SceneParts::drawAnatomy(float opacity) {
  for (std::size_t i = 0; i < hazards.size(); ++i) {
    const HazardView& hazard = scene->hazards[i];
    if (hazard.structure) continue;  // it has a surface, or is in the cut: a ball within it says nothing
    // with a cut, objects off its plane fade, also in front of the tissue
    const float fading = open ? asFloat(offPlaneOpacity(offPlane_m(hazard, insertion_plane))) : 1.0F;
    const bool blends = opacity >= 1 && fading < 1;
    if (blends) {
      glEnable(GL_BLEND);
      glEnable(GL_CULL_FACE);
    }
    put(*hazards[i], modelMatrix({}), hazardColour(hazard.kind),
        fading * (0.8F * opacity + (opacity < 1 ? 0 : 0.2F)), 0.3F);
    if (blends) {
      glDisable(GL_BLEND);
      glDisable(GL_CULL_FACE);
    }
  }
  for (const TargetView& target : scene->targets) {
    // flat if its tissue is thinner than the ball; in a body, a mark at the place to aim at
    const double mark_m = std::min(target.radius_m, kMark_m);
    const Vec3 size_m = scene->body
                            ? Vec3{mark_m, mark_m, mark_m}
                            : Vec3{target.radius_m, target.radius_m, 0.5 * (target.bottom_m - target.top_m)};
    put(ball,
        modelMatrix(poseTowards(scene->body ? target.center_W_m : target.middle_W_m, target.normal_W),
                    size_m),
        kTargetColour, opacity < 1 ? 0.7F : 1, 0.2F);
  }
}

void SceneParts::drawInstrument(const Moment& moment, Rgb steel, float opacity) {
  const Pose X_WT{moment.p_WT_m, normalized(moment.q_WT)};
  const Matrix4 tip = modelMatrix(X_WT);
  if (scene->cap_radius_m > 0 && isCapped(moment))
    put(cap, tip, kCapColour, opacity, 0.4F);
  else
    put(needle, tip, steel, opacity, 0.8F);
  if (openingBehindTip_m(scene->needle) > 0) {
    const double radius_m = 0.6 * drawnDiameter_m(*scene);
    put(ball,
        modelMatrix({openingOf(*scene, moment.p_WT_m, moment.q_WT), {}}, {radius_m, radius_m, radius_m}),
        kMarkInk, opacity, 0);
  }
  put(hub, tip, kHubBlue, opacity, 0.3F);
  put(marks, tip, kMarkInk, opacity, 0);
  const double shift_m = plungerShift_m(syringe, moment.plunger);
  put(plunger, modelMatrix(X_WT * Pose{{0, 0, shift_m}, {}}), kPlungerGrey, opacity, 0.3F);
}

void SceneParts::drawGlass(const Moment& moment) {
  const Pose X_WT{moment.p_WT_m, normalized(moment.q_WT)};
  const double shift_m = plungerShift_m(syringe, moment.plunger);
  const double from_m = syringe.stopper_z_m + shift_m, to_m = syringe.outlet_z_m;
  glEnable(GL_CULL_FACE);
  if (to_m > from_m) {
    const double radius_m = 0.9 * syringe.radius_m;
    put(liquid, modelMatrix(X_WT * Pose{{0, 0, from_m}, {}}, {radius_m, radius_m, to_m - from_m}), kLiquid,
        0.38F, 0.1F);
  }
  put(barrel, modelMatrix(X_WT), kGlass, 0.14F, 0.9F, 0.45F);
  glDisable(GL_CULL_FACE);
}

// The wall as a ring across the trajectory.
void SceneParts::drawGuides() {
  const Moment& moment = frame->moment;
  if (!isFinite(moment.wall_W_m)) return;
  const double ring_m = 0.055 * scene->extent_m;
  glDisable(GL_DEPTH_TEST);
  put(ring, modelMatrix(poseTowards(moment.wall_W_m, moment.u_W), {ring_m, ring_m, ring_m}), kWallColour,
      0.85F, 0.1F);
  glEnable(GL_DEPTH_TEST);
}

// Stacks the axial arrows along the needle, pushing ones on one side and pulling ones on the other; lateral
// arrows start at the tip.
void SceneParts::drawArrows() {
  const Moment& moment = frame->moment;
  const OrbitCamera& camera = frame->camera;
  Vec3 aside = cross(moment.u_W, camera.eye_W_m() - moment.p_entry_W_m);
  if (!(normSquared(aside) > 1e-12)) aside = camera.right_W();
  aside = normalized(aside);
  if (dot(aside, camera.right_W()) < 0) aside = -aside;
  const double m_per_N = frame->arrow_extents_per_N * scene->extent_m;
  const double thick_m = 0.5 * scene->extent_m, beside_m = 0.075 * scene->extent_m;
  constexpr double kMin_N = 0.03;
  double pushing_m = 0, pulling_m = 0;
  glDisable(GL_DEPTH_TEST);
  glEnable(GL_CULL_FACE);
  for (const EffectEntry* effect : effectsAsShown()) {
    const double along_N = moment.term(effect->effect);
    if (!effect->along_u || !(std::fabs(along_N) >= kMin_N)) continue;
    const bool pushes = along_N < 0;
    const Vec3 direction = pushes ? -moment.u_W : moment.u_W;
    double& from_m = pushes ? pushing_m : pulling_m;
    const Vec3 foot = moment.p_entry_W_m + aside * (pushes ? beside_m : -beside_m) + direction * from_m;
    const double length_m = std::fabs(along_N) * m_per_N;
    put(arrow, modelMatrix(poseTowards(foot, direction), {thick_m, thick_m, length_m}), colourOf(*effect), 1,
        0.2F);
    from_m += length_m;
  }
  const double clamping_N = moment.term(Effect::kClamping);
  if (clamping_N >= kMin_N && normSquared(moment.clamping_W) > 0)
    put(arrow,
        modelMatrix(poseTowards(moment.p_WT_m, moment.clamping_W), {thick_m, thick_m, clamping_N * m_per_N}),
        colourOf(effectEntry(Effect::kClamping)), 1, 0.2F);
  glDisable(GL_CULL_FACE);
  glEnable(GL_DEPTH_TEST);
}

// Draws the removed half as faint skin.
void SceneParts::drawFrontSkin() {
  glEnable(GL_CULL_FACE);
  solid.set("cut", -1);
  put(skin, modelMatrix({}), scene->layers.front().colour, 0.05F, 0, 0.30F);
  solid.set("cut", 0);
  glDisable(GL_CULL_FACE);
}

}  // namespace needlelab
