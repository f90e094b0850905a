#include "client/instructor/screens/gesture_pane.h"

#include <array>
#include <utility>

#include "client/view/theme.h"

namespace needlelab {
namespace {

constexpr std::array<std::pair<Look, const char*>, 4> kLooks = {{{Look::kTrainee, "As the trainee"},
                                                                 {Look::kAbove, "From above"},
                                                                 {Look::kSide, "From the side"},
                                                                 {Look::kFree, "Free (drag)"}}};
constexpr std::array<std::pair<PlotSet, const char*>, 3> kSets = {
    {{PlotSet::kForces, "Forces"}, {PlotSet::kMotion, "Motion"}, {PlotSet::kWallAndTip, "Wall and tip"}}};

/// A row of buttons with one selected. Returns true if the selection changed.
template <typename Choice, std::size_t n>
bool chooseOne(const std::array<std::pair<Choice, const char*>, n>& choices, Choice& chosen) {
  bool changed = false;
  for (const auto& [choice, word] : choices) {
    const bool here = choice == chosen;
    ImGui::PushStyleColor(ImGuiCol_Button,
                          here ? colourOf(kBlue) : ImGui::GetStyleColorVec4(ImGuiCol_Button));
    if (ImGui::Button(here ? (std::string("● ") + word).c_str() : word)) {
      chosen = choice;
      changed = true;
    }
    ImGui::PopStyleColor();
    ImGui::SameLine();
  }
  ImGui::NewLine();
  return changed;
}

}  // namespace

Result<ScenePane> ScenePane::make() {
  ASSIGN_OR_RETURN(auto renderer, SceneRenderer::make());
  return ScenePane(std::move(renderer));
}

void ScenePane::look(Look look) {
  look_ = look;
  aim();
}

void ScenePane::aim() {
  if (!scene_) return;
  switch (look_) {
    case Look::kTrainee:
      frame_.camera = initialView(*scene_);
      break;
    case Look::kAbove:
      frame_.camera = viewFromAbove(*scene_);
      break;
    case Look::kSide:
      frame_.camera = viewFromSide(*scene_);
      break;
    case Look::kFree:
      break;
  }
}

void ScenePane::showLooks() {
  if (chooseOne(kLooks, look_)) aim();
}

void ScenePane::show(const char* id, const std::shared_ptr<const SceneView>& scene, const Moment& moment,
                     const std::optional<PlanView>& plan_W, const AidSet& aids, ImVec2 size_px,
                     const std::optional<Moment>& second, std::vector<TipTrail> trails) {
  ImGui::BeginChild(
      id, size_px, false,
      ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse | ImGuiWindowFlags_NoBackground);
  showLooks();
  if (scene != scene_) {
    scene_ = scene;
    if (scene_) renderer_->setScene(scene_);
    aim();
  }
  if (!scene_) {
    ImGui::TextUnformatted("The scene is not known yet.");
    ImGui::EndChild();
    return;
  }
  frame_.moment = moment;
  frame_.show_needle = true;
  frame_.plan_W = plan_W;
  frame_.aids = aids;
  frame_.second = second;
  frame_.trails = std::move(trails);
  const auto result = sceneWidget("scene", *renderer_, frame_, {0, 0});
  if (result.camera_moved) look_ = Look::kFree;
  ImGui::EndChild();
}

void choosePlots(PlotSet& set) {
  chooseOne(kSets, set);
}

PlotResult gesturePlots(const char* id, PlotSet set, const GestureTrace& trace, const SceneView* scene,
                        double from_s, double to_s, std::optional<double> cursor_s, ImVec2 size_px,
                        std::span<const PlotRequirement> requirements) {
  std::vector<GesturePlot> which;
  switch (set) {
    case PlotSet::kForces:
      which = {GesturePlot::kForces, GesturePlot::kDepth, GesturePlot::kSpeed};
      break;
    case PlotSet::kMotion:
      which = {GesturePlot::kSpeed, GesturePlot::kAlignment, GesturePlot::kAngles, GesturePlot::kDepth};
      break;
    case PlotSet::kWallAndTip:
      which = {GesturePlot::kPlaces, GesturePlot::kForces};
      break;
  }
  std::vector<Plot> plots;
  for (const GesturePlot one : which) {
    plots.push_back(gesturePlot(one, trace, scene, from_s, to_s));
    addLimits(plots.back(), one, requirements);
    plots.back().cursor = cursor_s;
  }
  return plotStack(id, plots, size_px);
}

TipTrail trailOf(const GestureTrace& trace, double until_s, double seconds, Rgb colour) {
  TipTrail trail;
  trail.colour = colour;
  for (const Moment& moment : trace.between(until_s - seconds, until_s))
    trail.points_W_m.push_back(moment.p_WT_m);
  return trail;
}

}  // namespace needlelab
