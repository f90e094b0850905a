#include "client/instructor/screens/screens.h"

#include <vector>

#include "client/view/plots.h"
#include "client/view/theme.h"
#include "common/base/text/text.h"
#include "common/haptics/axial_model.h"

namespace needlelab {

void RerunScreen::showChoice(LabState& lab) {
  {
    WithFont font(Letters::kHeading);
    ImGui::TextUnformatted("What would it have felt like?");
  }
  ImGui::SameLine(0, 2 * space());
  WithTextColour dim(kDimText);
  textLine(lab.analysis.first()->title());
}

void RerunScreen::showForces(LabState& lab) {
  const StoredGesture& gesture = *lab.analysis.first();
  const Rerun& run = *lab.analysis.rerunResult();
  const double from_s = gesture.first_s(), to_s = gesture.last_s();
  const auto plotOf = [&](TraceChannel channel, const std::string& title) {
    Plot plot;
    plot.title = title;
    plot.unit = std::string(infoOf(channel).unit);
    plot.from = from_s;
    plot.to = to_s > from_s ? to_s : from_s + 1;
    plot.cursor = lab.analysis.player.at_s();
    plot.series.push_back({"as recorded", kFirstGesture, gesture.trace.source(channel), false, false});
    plot.series.push_back({run.what, kSecondGesture, run.trace.source(channel), true, false});
    return plot;
  };
  // an effect such as bone has a plot if the session or the re-run has it
  const auto isAsked = [&](const EffectEntry& effect) {
    const auto isLive = [&](const SessionScene& scene) {
      return scene.model && scene.model->isLive(effect.effect);
    };
    return isPlaced(effect.effect) || isLive(gesture.scene) || isLive(run.scene);
  };
  std::vector<Plot> plots;
  plots.push_back(plotOf(TraceChannel::kForce, "force on the hand"));
  plots.back().share = 1.8F;
  // the attracted force is small compared with the others: no separate plot here
  for (const EffectEntry* effect : effectsAsShown())
    if (effect->unit == "N" && effect->effect != Effect::kAttracted && isAsked(*effect))
      plots.push_back(plotOf(channelOf(effect->effect), std::string(effect->term)));
  const auto result = plotStack("rerun", plots, {0, 0});
  if (result.clicked_x) lab.analysis.player.seek(*result.clicked_x);
}

void RerunScreen::show(LabState& lab) {
  showWork(lab);
  if (!lab.analysis.first()) {
    if (lab.analysis.busy()) return;
    if (showEmpty("No session is loaded", "Load the recording to run again.", "To the sessions"))
      lab.screen = WindowScreen::kSessions;
    return;
  }
  showChoice(lab);
  ImGui::SetNextItemWidth(34 * space());
  std::string patient = profile == "own" ? "the session's own" : profile;
  for (const ProfileChoice& choice : lab.profiles())
    if (choice.id == profile) patient = choice.name;
  if (ImGui::BeginCombo("patient", patient.c_str())) {
    if (ImGui::Selectable("the session's own", profile == "own")) profile = "own";
    for (const ProfileChoice& choice : lab.profiles())
      if (ImGui::Selectable((choice.name + "##" + choice.id).c_str(), choice.id == profile))
        profile = choice.id;
    ImGui::EndCombo();
  }
  ImGui::SameLine(0, 2 * space());
  ImGui::SetNextItemWidth(34 * space());
  if (ImGui::BeginCombo("force model", model.empty() ? "the profile's own" : wordsOfName(model).c_str())) {
    if (ImGui::Selectable("the profile's own", model.empty())) model.clear();
    for (const std::string_view name : kAxialModelNames)
      if (ImGui::Selectable(wordsOfName(name).c_str(), name == model)) model = name;
    ImGui::EndCombo();
  }
  ImGui::SameLine(0, 2 * space());
  if (ImGui::Button("Run")) lab.analysis.rerun(profile, model);
  if (!lab.analysis.rerunResult()) {
    if (lab.analysis.busy()) return;
    const std::string trouble = lab.analysis.troubleOf(AnalysisJob::kRerun);
    showEmpty(trouble.empty() ? "Choose a patient or a model, then run" : "The re-run failed",
              trouble.empty()
                  ? "The engine follows the recorded hand and shows its forces beside those that were felt."
                  : trouble);
    return;
  }
  for (const std::string& line : lab.analysis.rerunResult()->sentences) textLine(line);
  showForces(lab);
}

}  // namespace needlelab
