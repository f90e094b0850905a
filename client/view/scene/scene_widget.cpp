#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <imgui/imgui.h>

#include "client/view/model/plot.h"
#include "client/view/scene/label_places.h"
#include "client/view/scene/scene_renderer.h"
#include "client/view/theme.h"
#include "common/haptics/surface.h"

namespace needlelab {
namespace {

/// The picture's position on the surface, and its camera.
struct PictureFrame {
  ImVec2 corner_px, size_px;
  const OrbitCamera* camera = nullptr;
  /// Returns a point on the surface; empty behind the eye.
  [[nodiscard]] std::optional<ImVec2> at(Vec3 p_W_m) const;
  /// Returns the ends of the visible part of a segment; empty if none is visible.
  [[nodiscard]] std::optional<std::pair<ImVec2, ImVec2>> partOf(Vec3 a_W_m, Vec3 b_W_m) const;
  [[nodiscard]] bool holds(ImVec2 point_px) const;
};

ImVec2 sizeOfLabel(const std::string& text) {
  return ImGui::CalcTextSize(text.c_str());
}

ImVec2 wrappedSize(const std::string& text, float wrap_px) {
  return ImGui::CalcTextSize(text.c_str(), nullptr, false, wrap_px);
}

void shadowedText(ImDrawList& list, ImVec2 at, ImU32 colour, const std::string& text, float wrap_px = 0) {
  for (const auto& [shift_px, shade] : {std::pair{1.0F, packed(kBlack, 0.9F)}, std::pair{0.0F, colour}})
    list.AddText(ImGui::GetFont(), ImGui::GetFontSize(), {at.x + shift_px, at.y + shift_px}, shade,
                 text.c_str(), nullptr, wrap_px);
}

// Both ends must be within the picture: a line far beyond it would need ten thousand dashes.
void dashedLine(ImDrawList& list, ImVec2 a, ImVec2 b, ImU32 colour, float width_px, float dash_px) {
  const float length_px = std::hypot(b.x - a.x, b.y - a.y);
  const int dashes = static_cast<int>(length_px / (2 * dash_px)) + 1;
  for (int i = 0; i < dashes; ++i) {
    const float from = static_cast<float>(2 * i) * dash_px / std::max(length_px, 1.0F);
    const float to = std::min(1.0F, from + dash_px / std::max(length_px, 1.0F));
    list.AddLine({a.x + (b.x - a.x) * from, a.y + (b.y - a.y) * from},
                 {a.x + (b.x - a.x) * to, a.y + (b.y - a.y) * to}, colour, width_px);
  }
}

struct SceneLabel {
  ImVec2 anchor_px;
  std::string text;
  Rgb colour;
  float weight = 0;  ///< SideLabel
  bool kept = false;
};

// of the names in a body's cut, if there is no room for all
constexpr float kOfHazard = 1, kOfMet = 2;

// Names at one side of the picture, wrapped, with lines to what they name.
void drawColumn(ImDrawList& list, std::vector<SceneLabel> labels, float edge_px, bool at_left, float wide_px,
                float from_px, float to_px) {
  const float text_px = ImGui::GetFontSize(), chip_px = text_px * 0.62F;
  const float wrap_px = wide_px - chip_px - 6;
  std::stable_sort(labels.begin(), labels.end(),
                   [](const SceneLabel& a, const SceneLabel& b) { return a.anchor_px.y < b.anchor_px.y; });
  std::vector<SideLabel> sides;
  for (const SceneLabel& label : labels)
    sides.push_back(
        {label.anchor_px.y, wrappedSize(label.text, wrap_px).y + text_px * 0.22F, label.weight, label.kept});
  const std::vector<float> tops_px = placeLabels(sides, from_px, to_px);
  for (std::size_t i = 0; i < labels.size(); ++i) {
    if (tops_px[i] < 0) continue;
    const SceneLabel& label = labels[i];
    const ImVec2 size_px = wrappedSize(label.text, wrap_px);
    const float y_px = tops_px[i] + 0.5F * sides[i].height_px, half_px = 0.5F * size_px.y;
    const float left_px = at_left ? edge_px : edge_px - size_px.x - chip_px - 6;
    const float end_px = at_left ? left_px + chip_px + 6 + size_px.x + 5 : left_px - 5;
    const float knee_px =
        at_left ? std::min(label.anchor_px.x, end_px + 14) : std::max(label.anchor_px.x, end_px - 14);
    const ImU32 line = packed(mixed(label.colour, kWhite, 0.35F), 0.75F);
    list.AddLine({end_px, y_px}, {knee_px, y_px}, line, 1.3F);
    list.AddLine({knee_px, y_px}, label.anchor_px, line, 1.3F);
    list.AddCircleFilled(label.anchor_px, 3.2F, packed(kBlack, 0.7F), 10);
    list.AddCircleFilled(label.anchor_px, 2.2F, packed(kWhite), 10);
    list.AddRectFilled({left_px - 4, y_px - half_px - text_px * 0.08F},
                       {left_px + chip_px + 6 + size_px.x + 4, y_px + half_px + text_px * 0.12F},
                       packed(kBlack, 0.5F), 4);
    const ImVec2 chip{left_px, y_px - chip_px * 0.5F}, chip_end{left_px + chip_px, y_px + chip_px * 0.5F};
    list.AddRectFilled(chip, chip_end, packed(label.colour), 2);
    list.AddRect(chip, chip_end, packed(kBlack, 0.6F), 2);
    shadowedText(list, {left_px + chip_px + 6, y_px - half_px}, packed(kText), label.text, wrap_px);
  }
}

// Returns a layer's middle in the cut, below a skin point left of the focus.
Vec3 layerAnchor(const SceneView& scene, const LayerView& layer, const OrbitCamera& camera) {
  const Vec3 up = scene.focus_normal_W, right = camera.right_W();
  const Vec3 level = normalized(right - up * dot(up, right));
  const Vec3 beside = scene.focus_W_m - level * (0.5 * scene.extent_m) - up * (0.3 * scene.extent_m);
  const Vec3 out = surfaceNormal(scene.limb_W, beside, -up);
  const Vec3 skin = beside + out * depthAt(scene, beside);
  return skin - out * (0.5 * (layer.top_m + std::min(layer.bottom_m, layer.top_m + 0.25 * scene.extent_m)));
}

Vec3 hazardAnchor(const SceneView& scene, const HazardView& hazard) {
  const Vec3 along = hazard.b_W_m - hazard.a_W_m;
  const double squared = normSquared(along);
  if (!(squared > 0)) return hazard.a_W_m;
  return hazard.a_W_m + along * std::clamp(dot(scene.focus_W_m - hazard.a_W_m, along) / squared, 0.0, 1.0);
}

std::optional<ImVec2> PictureFrame::at(Vec3 p_W_m) const {
  const auto point = camera->project(p_W_m, static_cast<double>(size_px.x), static_cast<double>(size_px.y));
  if (!point) return std::nullopt;
  return ImVec2{corner_px.x + static_cast<float>(point->x_px), corner_px.y + static_cast<float>(point->y_px)};
}

std::optional<std::pair<ImVec2, ImVec2>> PictureFrame::partOf(Vec3 a_W_m, Vec3 b_W_m) const {
  const auto part =
      camera->projectSegment(a_W_m, b_W_m, static_cast<double>(size_px.x), static_cast<double>(size_px.y));
  if (!part) return std::nullopt;
  const auto on = [&](const PicturePoint& p) {
    return ImVec2{corner_px.x + static_cast<float>(p.x_px), corner_px.y + static_cast<float>(p.y_px)};
  };
  return std::pair{on(part->from), on(part->to)};
}

bool PictureFrame::holds(ImVec2 p) const {
  return p.x > corner_px.x && p.y > corner_px.y && p.x < corner_px.x + size_px.x &&
         p.y < corner_px.y + size_px.y;
}

void drawGuideLines(ImDrawList& list, const PictureFrame& picture, const SceneView& scene,
                    const SceneFrame& frame) {
  if (!frame.show_needle || !frame.aids.has(pb::Exercise::GUIDES)) return;
  const Moment& moment = frame.moment;
  if (moment.inside) {
    const double done_m = std::max(0.0, dot(moment.p_WT_m - moment.p_entry_W_m, moment.u_W));
    const double reach_m = std::max(done_m, lineReach_m(scene, moment.p_entry_W_m, moment.u_W));
    const Vec3 now_W_m = moment.p_entry_W_m + moment.u_W * done_m,
               end_W_m = moment.p_entry_W_m + moment.u_W * reach_m;
    if (const auto done = picture.partOf(moment.p_entry_W_m, now_W_m))
      list.AddLine(done->first, done->second, packed(kYellow, 0.85F), 2);
    if (const auto rest = picture.partOf(now_W_m, end_W_m))
      dashedLine(list, rest->first, rest->second, packed(kYellow, 0.9F), 2, 6);
    if (const auto entry = picture.at(moment.p_entry_W_m)) list.AddCircle(*entry, 5, packed(kYellow), 16, 2);
    return;
  }
  // the needle's path straight ahead
  const Vec3 axis_W = normalized(zAxis(moment.q_WT));
  const double to_skin_m = std::max(0.0, -depthAt(scene, moment.p_WT_m));
  const Vec3 skin_W_m = moment.p_WT_m + axis_W * to_skin_m;
  const Vec3 end_W_m = skin_W_m + axis_W * lineReach_m(scene, skin_W_m, axis_W);
  if (const auto path = picture.partOf(moment.p_WT_m, end_W_m))
    dashedLine(list, path->first, path->second, packed(kYellow, 0.55F), 1.6F, 5);
}

bool showsPlan(const SceneFrame& frame) {
  return frame.plan_W && frame.aids.has(pb::Exercise::PLANNED_LINE);
}

// Thinner than the needle's own line; a dark outline keeps it visible on every tissue.
void drawPlan(ImDrawList& list, const PictureFrame& picture, const SceneFrame& frame) {
  if (!showsPlan(frame)) return;
  const PlanView& plan = *frame.plan_W;
  std::vector<ImVec2> ring;
  for (const Vec3 corner_W_m : plan.ring_W_m)
    if (const auto at = picture.at(corner_W_m)) ring.push_back(*at);
  const bool whole = ring.size() == plan.ring_W_m.size();  // otherwise partly behind the eye
  const auto line = picture.partOf(plan.from_W_m, plan.to_W_m);
  for (const auto& [colour, width_px] :
       {std::pair{packed(kBlack, 0.55F), 3.5F}, std::pair{packed(kPlanColour), 1.5F}}) {
    if (line) dashedLine(list, line->first, line->second, colour, width_px, 4);
    if (whole)
      list.AddPolyline(ring.data(), static_cast<int>(ring.size()), colour, ImDrawFlags_Closed, width_px);
  }
}

void drawTrails(ImDrawList& list, const PictureFrame& picture, const SceneFrame& frame) {
  for (const TipTrail& trail : frame.trails) {
    std::vector<ImVec2> points;
    points.reserve(trail.points_W_m.size());
    for (const Vec3 p_W_m : trail.points_W_m) {
      const auto at = picture.at(p_W_m);
      // merge points that share a pixel
      if (at && (points.empty() || std::hypot(at->x - points.back().x, at->y - points.back().y) > 0.7F))
        points.push_back(*at);
    }
    if (points.size() > 1)
      list.AddPolyline(points.data(), static_cast<int>(points.size()), packed(trail.colour, 0.9F), 0, 2);
  }
}

// In a body, of bones, tendons, nerves, vessels and hazards: the layers beside the needle stand beside the
// picture. `above_px`, `below_px`: what else is at the upper and the lower edge.
void drawNames(ImDrawList& list, const PictureFrame& picture, const SceneRenderer& renderer,
               const SceneFrame& frame, const std::vector<int>* met, float above_px, float below_px) {
  const SceneView& scene = *renderer.scene();
  WithFont font(Letters::kBody);
  const float margin_px = space() * 1.2F;
  std::vector<SceneLabel> layers, anatomy;
  if (scene.body) {
    for (const BodySection::Name& name : renderer.cutNames()) {
      const LayerView& structure = scene.layers[name.structure];
      const StructureShape shape = structureKind(structure.kind).shape;
      const HazardView* const hazard = hazardAt(scene, name.place_W_m);
      const bool is_met = met != nullptr && std::ranges::count(*met, int{name.structure}) > 0;
      if (!hazard && (met != nullptr ? !is_met : shape == StructureShape::kSoft)) continue;
      if (isTarget(scene, name.structure)) continue;  // its mark has the name
      const bool hidden =
          (hazard || shape == StructureShape::kLine) && !frame.aids.has(pb::Exercise::ANATOMY);
      const auto at = picture.at(name.place_W_m);
      if (!at || !picture.holds(*at) || hidden) continue;
      // at the side that is nearer, so that leaders do not cross the picture
      (at->x > picture.corner_px.x + 0.5F * picture.size_px.x ? anatomy : layers)
          .push_back({*at, hazard ? hazard->name : structure.name,
                      hazard ? hazardColour(hazard->kind) : structure.colour,
                      is_met   ? kOfMet
                      : hazard ? kOfHazard
                               : 0});
    }
  } else if (frame.aids.has(pb::Exercise::TISSUES) && frame.cut_open) {
    for (const LayerView& layer : scene.layers) {
      const auto at = picture.at(layerAnchor(scene, layer, *picture.camera));
      if (at && picture.holds(*at)) layers.push_back({*at, layer.name, layer.colour});
    }
  }
  if (frame.aids.has(pb::Exercise::ANATOMY)) {
    for (const TargetView& target : scene.targets) {
      const auto at = picture.at(scene.body ? target.center_W_m : target.middle_W_m);
      if (at && picture.holds(*at)) anatomy.push_back({*at, "◎ " + target.name, kTargetColour, 0, true});
    }
    const bool cut = frame.cut_open && frame.aids.has(pb::Exercise::TISSUES);
    const PicturePlane plane = insertionPlaneOf(scene, *picture.camera);
    for (const HazardView& hazard : scene.hazards) {
      if (hazard.structure) continue;  // named where the cut shows it
      const auto at = picture.at(hazardAnchor(scene, hazard));
      if (at && picture.holds(*at))
        anatomy.push_back({*at, hazardLabel(hazard, cut ? offPlane_m(hazard, plane) : 0),
                           hazardColour(hazard.kind), kOfHazard});
    }
  }
  // drawDirections has words at all edges
  const float row_px = ImGui::GetFontSize(), words_px = scene.body ? 2 * row_px : 0;
  const float from_px = picture.corner_px.y + margin_px + above_px + (scene.directions.empty() ? 0 : row_px);
  const float to_px = picture.corner_px.y + picture.size_px.y - words_px;
  const float wide_px = 0.5F * picture.size_px.x - margin_px - 10;
  drawColumn(list, std::move(layers), picture.corner_px.x + margin_px, true, wide_px, from_px,
             to_px - 3.5F * margin_px);
  drawColumn(list, std::move(anatomy), picture.corner_px.x + picture.size_px.x - margin_px, false, wide_px,
             from_px, to_px - std::max(scene.body ? 3.5F * margin_px : margin_px, below_px));
}

// Returns its height, from the picture's lower edge.
float drawLegend(ImDrawList& list, const PictureFrame& picture, const SceneFrame& frame) {
  const Moment& moment = frame.moment;
  const bool arrows = frame.show_needle && frame.aids.has(pb::Exercise::ARROWS) && moment.inside;
  if (!arrows && !showsPlan(frame)) return 0;
  WithFont font(Letters::kSmall);
  const float text_px = ImGui::GetFontSize(), row_px = text_px * 1.25F, pad_px = text_px * 0.5F;
  constexpr double kLeast = 0.005;
  struct Row {
    Rgb colour;
    std::string word, value;
    bool dashed = false;  ///< a line instead of an arrow
  };
  std::vector<Row> rows;
  if (showsPlan(frame)) rows.push_back({kPlanColour, "planned line", {}, true});
  if (arrows) {
    for (const EffectEntry* effect : effectsAsShown()) {
      const double size = std::fabs(termOf(*effect, moment));
      if (size < kLeast) continue;
      rows.push_back({colourOf(*effect), std::string(effect->term), momentText(size, effect->unit)});
    }
    rows.push_back({kWhite, "on the hand", momentText(forceOf(moment), "N")});
  }
  float word_px = 0, value_px = 0;
  for (const Row& row : rows) {
    word_px = std::max(word_px, sizeOfLabel(row.word).x);
    value_px = std::max(value_px, sizeOfLabel(row.value).x);
  }
  const float width_px = word_px + value_px + 3.6F * text_px;
  const ImVec2 end{picture.corner_px.x + picture.size_px.x - space(),
                   picture.corner_px.y + picture.size_px.y - space()};
  const ImVec2 at{end.x - width_px, end.y - row_px * static_cast<float>(rows.size()) - 2 * pad_px};
  list.AddRectFilled(at, end, packed(kBlack, 0.55F), 6);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const float y_px = at.y + pad_px + row_px * static_cast<float>(i);
    const float middle_px = y_px + text_px * 0.5F;
    const ImU32 colour = packed(rows[i].colour);
    const float x_px = at.x + pad_px;
    if (rows[i].dashed) {
      dashedLine(list, {x_px, middle_px}, {x_px + text_px * 1.25F, middle_px}, colour, 1.5F, text_px * 0.25F);
    } else {
      list.AddLine({x_px, middle_px}, {x_px + text_px * 0.8F, middle_px}, colour, 3);
      list.AddTriangleFilled({x_px + text_px * 1.25F, middle_px},
                             {x_px + text_px * 0.7F, middle_px - text_px * 0.3F},
                             {x_px + text_px * 0.7F, middle_px + text_px * 0.3F}, colour);
    }
    list.AddText({x_px + text_px * 1.6F, y_px}, packed(kText), rows[i].word.c_str());
    list.AddText({end.x - pad_px - sizeOfLabel(rows[i].value).x, y_px}, packed(kText), rows[i].value.c_str());
  }
  return picture.corner_px.y + picture.size_px.y - at.y + space();
}

void drawScaleBar(ImDrawList& list, const PictureFrame& picture) {
  const double m_per_px = picture.camera->metresPerPixel(static_cast<double>(picture.size_px.y));
  // about a tenth of the picture
  const AxisTicks ticks =
      axisTicks(0, m_per_px * static_cast<double>(picture.size_px.x) * 0.16 * 1000, 2, false);
  const auto length_px = static_cast<float>(ticks.step / 1000 / m_per_px);
  WithFont font(Letters::kSmall);
  const std::string text = tickText(ticks.step, ticks.decimals) + " mm";
  const ImVec2 at{picture.corner_px.x + space() * 1.2F,
                  picture.corner_px.y + picture.size_px.y - space() * 1.6F};
  list.AddLine(at, {at.x + length_px, at.y}, packed(kText, 0.85F), 2);
  for (const float x_px : {at.x, at.x + length_px})
    list.AddLine({x_px, at.y - 5}, {x_px, at.y + 5}, packed(kText, 0.85F), 2);
  shadowedText(list, {at.x + length_px + 8, at.y - ImGui::GetFontSize() * 0.5F}, packed(kText, 0.9F), text);
}

/// Which way the patient lies: at each edge the profile's words for the direction that points there most.
void drawDirections(ImDrawList& list, const PictureFrame& picture, const SceneView& scene, float above_px,
                    float free_below_px) {
  constexpr double kTowards = 0.71;  // of its length: so a direction has one edge
  WithFont font(Letters::kSmall);
  const float row_px = ImGui::GetFontSize(), pad_px = space() * 1.2F;
  const ImVec2 from = picture.corner_px, size = picture.size_px;
  struct Edge {
    Vec3 way_W;
    const char* sign;
    ImVec2 at;    // of the words' corner
    float share;  // of the words' width that is left of it
  };
  const Vec3 right_W = picture.camera->right_W(), up_W = picture.camera->upward_W();
  const float low_px = from.y + size.y - 1.5F * row_px;
  const std::array<Edge, 4> edges = {
      {{right_W, "▶ ", {from.x + size.x - pad_px, low_px - std::max(pad_px, free_below_px)}, 1},
       {-right_W, "◀ ", {from.x + pad_px, low_px - 3 * pad_px}, 0},
       {up_W, "▲ ", {from.x + 0.5F * size.x, from.y + 0.5F * pad_px + above_px}, 0.5F},
       {-up_W, "▼ ", {from.x + 0.5F * size.x, low_px - 1.6F * row_px - space()}, 0.5F}}};
  for (const Edge& edge : edges) {
    const DirectionView* best = nullptr;
    for (const DirectionView& one : scene.directions)
      if (dot(one.way_W, edge.way_W) > (best != nullptr ? dot(best->way_W, edge.way_W) : kTowards))
        best = &one;
    if (best == nullptr) continue;
    const std::string text = edge.sign + best->words;
    const ImVec2 wide = sizeOfLabel(text), at{edge.at.x - edge.share * wide.x, edge.at.y};
    list.AddRectFilled({at.x - 4, at.y - 1}, {at.x + wide.x + 4, at.y + wide.y + 1}, packed(kBlack, 0.5F), 4);
    shadowedText(list, at, packed(kText), text);
  }
}

bool moveCamera(OrbitCamera& camera, const SceneView& scene, ImVec2 size_px) {
  const ImGuiIO& io = ImGui::GetIO();
  const OrbitCamera before = camera;
  const auto height_px = static_cast<double>(size_px.y);
  const auto dx = static_cast<double>(io.MouseDelta.x), dy = static_cast<double>(io.MouseDelta.y);
  if (ImGui::IsItemActive()) {
    if (ImGui::IsMouseDown(0) && !io.KeyShift)
      camera.orbit(dx, dy, height_px);
    else if (ImGui::IsMouseDown(0) || ImGui::IsMouseDown(1) || ImGui::IsMouseDown(2))
      camera.pan(dx, dy, height_px);
  }
  if (ImGui::IsItemHovered()) {
    if (io.MouseWheel != 0) camera.zoom(static_cast<double>(io.MouseWheel));
    if (ImGui::IsMouseDoubleClicked(0)) camera = initialView(scene);
  }
  return !(camera == before);
}

// Returns its height, from the picture's upper edge.
float drawDoubt(ImDrawList& list, const PictureFrame& picture, const SceneFrame& frame) {
  if (!frame.show_needle || !frame.moment.approximate) return 0;
  WithFont font(Letters::kSmall);
  static const std::string kWords =
      "≈ this view cannot follow until the needle is outside: entry and line may be off, forces by effect "
      "are not shown";
  const float wrap_px = picture.size_px.x - 2 * space();
  const ImVec2 size_px = wrappedSize(kWords, wrap_px);
  const ImVec2 at{picture.corner_px.x + (picture.size_px.x - size_px.x) * 0.5F,
                  picture.corner_px.y + space() * 0.6F};
  list.AddRectFilled({at.x - 6, at.y - 2}, {at.x + size_px.x + 6, at.y + size_px.y + 4}, packed(kBlack, 0.6F),
                     4);
  list.AddText(ImGui::GetFont(), ImGui::GetFontSize(), at, packed(kOrange), kWords.c_str(), nullptr, wrap_px);
  return size_px.y + space();
}

/// Switches between the cut and the skin as glass.
void cutSwitch(const char* id, const PictureFrame& picture, SceneFrame& frame) {
  WithFont font(Letters::kSmall);
  const char* const words = frame.cut_open ? "skin as glass" : "cut open";
  const ImVec2 padding = ImGui::GetStyle().FramePadding;
  const float width_px = ImGui::CalcTextSize(words).x + 2 * padding.x;
  const ImVec2 before = ImGui::GetCursorScreenPos();
  // at the bottom's middle: names are at the sides, the scale and the legend in the corners
  ImGui::SetCursorScreenPos({picture.corner_px.x + 0.5F * (picture.size_px.x - width_px),
                             picture.corner_px.y + picture.size_px.y - ImGui::GetFontSize() - space()});
  ImGui::PushID(id);
  if (ImGui::SmallButton(words)) frame.cut_open = !frame.cut_open;
  ImGui::PopID();
  ImGui::SetCursorScreenPos(before);
}

}  // namespace

SceneWidgetResult sceneWidget(const char* id, SceneRenderer& renderer, SceneFrame& frame, ImVec2 size_px,
                              const SceneWidgetOptions& options) {
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  if (size_px.x <= 0) size_px.x = rest.x;
  if (size_px.y <= 0) size_px.y = rest.y;
  SceneWidgetResult result;
  result.corner_px = ImGui::GetCursorScreenPos();
  result.size_px = size_px = {std::max(size_px.x, 16.0F), std::max(size_px.y, 16.0F)};
  const SceneView* scene = renderer.scene();
  if (scene == nullptr) {
    ImGui::Dummy(size_px);
    return result;
  }
  ImGui::InvisibleButton(id, size_px,
                         ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                             ImGuiButtonFlags_MouseButtonMiddle);
  result.hovered = ImGui::IsItemHovered();
  const bool switches = scene->body && options.labels && frame.aids.has(pb::Exercise::TISSUES);
  if (switches) ImGui::SetItemAllowOverlap();
  if (options.mouse_moves_camera) result.camera_moved = moveCamera(frame.camera, *scene, size_px);
  renderer.draw(frame, static_cast<int>(size_px.x), static_cast<int>(size_px.y));

  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 end{result.corner_px.x + size_px.x, result.corner_px.y + size_px.y};
  ImGui::PushClipRect(result.corner_px, end, true);
  renderer.show(list, result.corner_px);
  const PictureFrame picture{result.corner_px, size_px, &frame.camera};
  drawTrails(list, picture, frame);
  drawPlan(list, picture, frame);
  drawGuideLines(list, picture, *scene, frame);
  const float legend_px = options.legend ? drawLegend(list, picture, frame) : 0;
  const float doubt_px = drawDoubt(list, picture, frame);
  if (options.labels) drawNames(list, picture, renderer, frame, options.met, doubt_px, legend_px);
  if (options.labels && scene->body) drawDirections(list, picture, *scene, doubt_px, legend_px);
  if (options.labels) drawScaleBar(list, picture);
  if (switches) cutSwitch(id, picture, frame);
  ImGui::PopClipRect();
  return result;
}

}  // namespace needlelab
