#include "client/station/window/screens/insertion_replay.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/view/model/palette.h"
#include "client/view/model/plot.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

bool isInTissue(const Moment& moment) {
  return moment.layer >= 0 && !isCapped(moment);
}

// The hand may have brought its own tip further: into bone, or on when the hub rests on the skin.
Vec3 tipIn(const Moment& moment) {
  if (!moment.inside) return moment.p_WT_m;
  const double way_m = dot(moment.u_W, moment.p_WT_m - moment.p_entry_W_m);
  return isHeldBack(way_m, moment.insertion_m) ? moment.p_WT_m - (way_m - moment.insertion_m) * moment.u_W
                                               : moment.p_WT_m;
}

constexpr Rgb kPathColour = kSkyBlue, kOpeningColour = kOrange, kBoneColour = kVermillion;

void bigSign(ImDrawList& list, ImVec2 at, Rgb colour, const char* sign) {
  const WithFont heading(Letters::kHeading);
  const ImVec2 size = ImGui::CalcTextSize(sign);
  const ImVec2 from{at.x - 0.5F * size.x, at.y - 0.5F * size.y};
  list.AddText({from.x + 1.5F, from.y + 1.5F}, packed(kBlack), sign);
  list.AddText(from, packed(colour), sign);
}

}  // namespace

void InsertionReplay::step(int steps) {
  at_s = std::clamp(at_s + kStep_s * steps, from_s, to_s);
}

std::optional<InsertionReplay> insertionReplay(const GestureTrace& trace, const SceneView& scene,
                                               std::span<const TickSpan> injections, double rate_hz) {
  const std::vector<Moment> moments = trace.between(trace.firstTime_s(), trace.lastTime_s());
  const double injected_s = injections.empty() ? -1 : static_cast<double>(injections.back().begin) / rate_hz;
  const bool injects = injected_s >= trace.firstTime_s();
  const auto begin = moments.begin();
  // its last moment, then its first one
  auto end = injects
                 ? std::find_if(begin, moments.end(), [&](const Moment& m) { return m.time_s > injected_s; })
                 : moments.end();
  while (end != begin && !isInTissue(*std::prev(end))) --end;
  if (end == begin) return std::nullopt;
  auto first = std::prev(end);
  while (first != begin && isInTissue(*std::prev(first))) --first;
  while (end != moments.end() && isInTissue(*end)) ++end;

  InsertionReplay replay;
  replay.from_s = first->time_s;
  replay.to_s = std::prev(end)->time_s;
  const auto furthest = std::max_element(
      first, end, [](const Moment& a, const Moment& b) { return a.insertion_m < b.insertion_m; });
  replay.at_s = injects ? std::clamp(injected_s, replay.from_s, replay.to_s) : furthest->time_s;
  const double injected_to_s = injects ? static_cast<double>(injections.back().end) / rate_hz : -1;
  for (auto at = first; at != end; ++at) {
    replay.path_W_m.push_back(tipIn(*at));
    if (std::ranges::count(replay.met, at->layer) == 0) replay.met.push_back(at->layer);
    if (injects && at->time_s >= injected_s && at->time_s <= injected_to_s)
      replay.opening_W_m.push_back(openingOf(scene, tipIn(*at), at->q_WT));
  }
  for (const TraceEvent& event : trace.events())
    if (event.kind == TraceEvent::Kind::kBoneContact && event.time_s >= replay.from_s &&
        event.time_s <= replay.to_s)
      replay.bone_W_m.push_back(tipIn(trace.at(event.time_s)));
  return replay;
}

std::string replayText(const InsertionReplay& replay, const Moment& now, const SceneView& scene) {
  return fmt::format("Last insertion, {:.2f} s of {:.2f} s: {}, in {}", replay.at_s - replay.from_s,
                     replay.to_s - replay.from_s, momentText(forceOf(now), "N"), layerName(scene, now.layer));
}

OrbitCamera viewOfInsertion(const SceneView& scene, const InsertionReplay& replay) {
  constexpr double kLeastHeight_m = 0.06;
  OrbitCamera camera = initialView(scene);
  const Vec3 entry_W_m = replay.path_W_m.front();
  const Vec3 furthest_W_m = *std::max_element(
      replay.path_W_m.begin(), replay.path_W_m.end(),
      [&](Vec3 a, Vec3 b) { return normSquared(a - entry_W_m) < normSquared(b - entry_W_m); });
  camera.focus_W_m = 0.5 * (entry_W_m + furthest_W_m);
  const double height_m = std::max(kLeastHeight_m, 3 * norm(furthest_W_m - entry_W_m));
  camera.distance_m = height_m / (2 * std::tan(0.5 * camera.field_of_view_rad));
  return camera;
}

void insertionPicture(const InsertionReplay& replay, const Moment& now, SceneRenderer& renderer,
                      SceneFrame& frame, ImVec2 size_px) {
  frame.moment = now;
  frame.moment.p_WT_m = tipIn(now);
  frame.aids = {};
  for (const auto aid : {pb::Exercise::TISSUES, pb::Exercise::ANATOMY, pb::Exercise::PLANNED_LINE})
    frame.aids.set(aid, true);
  frame.trails = {{replay.path_W_m, kPathColour}, {replay.opening_W_m, kOpeningColour}};
  SceneWidgetOptions options;
  options.legend = false;  // insertionLegend
  options.met = &replay.met;
  const SceneWidgetResult result = sceneWidget("insertion", renderer, frame, size_px, options);
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 end{result.corner_px.x + result.size_px.x, result.corner_px.y + result.size_px.y};
  list.PushClipRect(result.corner_px, end, true);
  const auto mark = [&](Vec3 place_W_m, Rgb colour, const char* sign) {
    const auto at = frame.camera.project(place_W_m, static_cast<double>(result.size_px.x),
                                         static_cast<double>(result.size_px.y));
    if (!at) return;
    bigSign(list,
            {result.corner_px.x + static_cast<float>(at->x_px),
             result.corner_px.y + static_cast<float>(at->y_px)},
            colour, sign);
  };
  for (const Vec3 place_W_m : replay.bone_W_m) mark(place_W_m, kBoneColour, "✗");
  if (!replay.opening_W_m.empty()) mark(replay.opening_W_m.front(), kOpeningColour, "○");
  list.PopClipRect();
}

void insertionLegend(const InsertionReplay& replay, bool plan) {
  const float end_px = ImGui::GetCursorScreenPos().x + ImGui::GetContentRegionAvail().x;
  const auto row = [&](Rgb colour, const char* words) {
    const float gap_px = ImGui::GetStyle().ItemSpacing.x, wide_px = ImGui::CalcTextSize(words).x;
    if (colour != kPathColour && ImGui::GetItemRectMax().x + gap_px + wide_px < end_px) ImGui::SameLine();
    const WithTextColour coloured(colour);
    ImGui::TextUnformatted(words);
  };
  row(kPathColour, "— the tip's way");
  if (!replay.opening_W_m.empty()) row(kOpeningColour, "○ opening, injection");
  if (!replay.bone_W_m.empty()) row(kBoneColour, "✗ bone met");
  if (plan) row(kPlanColour, "- - planned line");
}

}  // namespace needlelab
