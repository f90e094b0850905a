#include "client/instructor/screens/rerun_screen.h"

#include <vector>

#include "client/instructor/screens/desk_frame.h"
#include "client/view/plots.h"
#include "client/view/theme.h"
#include "common/haptics/axial_model.h"

namespace needlelab {

void RerunScreen::showChoice(Desk& desk) {
  {
    WithFont font(Letters::kHeading);
    ImGui::TextUnformatted("What would it have felt like?");
  }
  ImGui::SameLine(0, 2 * space());
  WithTextColour dim(kDimText);
  textLine(desk.bench.first()->title());
}

void RerunScreen::showForces(Desk& desk) {
  const StoredGesture& gesture = *desk.bench.first();
  const Rerun& run = *desk.bench.rerunResult();
  const double from_s = gesture.first_s(), to_s = gesture.last_s();
  const auto plotOf = [&](TraceChannel channel, const std::string& title) {
    StackedPlot plot;
    plot.spec.title = title;
    plot.spec.unit = std::string(infoOf(channel).unit);
    plot.spec.from = from_s;
    plot.spec.to = to_s > from_s ? to_s : from_s + 1;
    plot.spec.show_x_axis = false;
    plot.spec.cursor = desk.bench.player.at_s();
    plot.series.push_back({"as recorded", kFirstGesture, gesture.trace.source(channel), false, false});
    plot.series.push_back({run.what, kSecondGesture, run.trace.source(channel), true, false});
    return plot;
  };
  std::vector<StackedPlot> plots;
  plots.push_back(plotOf(TraceChannel::kForce, "force on the hand"));
  plots.back().share = 1.8F;
  for (const EffectEntry* effect : effectsAsShown())
    if (effect->unit == "N") plots.push_back(plotOf(channelOf(effect->effect), std::string(effect->term)));
  plots.back().spec.show_x_axis = true;
  const auto result = plotStack("rerun", plots, {0, 0});
  if (result.clicked_x) desk.bench.player.seek(*result.clicked_x);
}

void RerunScreen::show(Desk& desk) {
  showWork(desk);
  if (!desk.bench.first()) {
    if (desk.bench.busy()) return;
    if (showEmpty("No session is loaded", "Load the recording that is to be felt again.", "To the sessions"))
      desk.screen = DeskScreen::kSessions;
    return;
  }
  showChoice(desk);
  ImGui::SetNextItemWidth(34 * space());
  if (ImGui::BeginCombo("patient", profile == "own" ? "the session's own" : profile.c_str())) {
    if (ImGui::Selectable("the session's own", profile == "own")) profile = "own";
    for (const std::string& id : desk.profiles())
      if (ImGui::Selectable(id.c_str(), id == profile)) profile = id;
    ImGui::EndCombo();
  }
  ImGui::SameLine(0, 2 * space());
  ImGui::SetNextItemWidth(34 * space());
  if (ImGui::BeginCombo("force model", model.empty() ? "the profile's own" : model.c_str())) {
    if (ImGui::Selectable("the profile's own", model.empty())) model.clear();
    for (const std::string_view name : kAxialModelNames)
      if (ImGui::Selectable(std::string(name).c_str(), name == model)) model = name;
    ImGui::EndCombo();
  }
  ImGui::SameLine(0, 2 * space());
  if (ImGui::Button("Run")) desk.bench.rerun(profile, model);
  if (!desk.bench.rerunResult()) {
    if (desk.bench.busy()) return;
    showEmpty(
        desk.bench.trouble().empty() ? "Choose a patient or a model, then run" : "That does not run",
        desk.bench.trouble().empty()
            ? "The engine steps along the recorded hand and shows the forces beside those that were felt."
            : desk.bench.trouble());
    return;
  }
  for (const std::string& line : desk.bench.rerunResult()->words) textLine(line);
  showForces(desk);
}

}  // namespace needlelab
