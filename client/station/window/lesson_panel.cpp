// The side panel of a lesson. Each figure and plot stands there only with its aid.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "client/station/window/layer_ladder.h"
#include "client/station/window/lesson_screen.h"
#include "client/view/model/aids.h"
#include "client/view/model/palette.h"
#include "client/view/plots.h"
#include "client/view/theme.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr double kPlotSpan_s = 20;

std::string mm(double metres, int decimals = 1) {
  return formatted("%.*f", decimals, 1e3 * metres);
}

void showFigures(const LessonFollow& lesson, const AidSet& aids, float width) {
  const Moment& now = lesson.now();
  std::vector<std::pair<int, std::string>> shown;  // which, value
  if (aids.has(pb::Exercise::FORCE)) shown.emplace_back(0, formatted("%.1f", forceOf(now)));
  if (aids.has(pb::Exercise::DEPTH)) shown.emplace_back(1, now.inside ? mm(now.insertion_m) : "–");
  if (shown.empty()) return;
  const float each = width / static_cast<float>(shown.size());
  const float left = ImGui::GetCursorPosX();
  for (std::size_t i = 0; i < shown.size(); ++i) {
    if (i > 0) ImGui::SameLine(left + each * static_cast<float>(i));
    ImGui::BeginGroup();
    if (shown[i].first == 0)
      figure(shown[i].second, "N", "force on the hand");
    else
      figure(shown[i].second, "mm", "inserted");
    ImGui::EndGroup();
  }
}

void showPhase(const LessonFollow& lesson, const AidSet& aids) {
  const Moment& now = lesson.now();
  std::string text;
  if (aids.has(pb::Exercise::PHASE)) text = phaseWord(now.phase);
  if (aids.has(pb::Exercise::LAYER) && now.inside)
    text += (text.empty() ? "" : ", in ") + layerName(*lesson.scene(), now.layer);
  if (text.empty()) return;
  const WithFont heading(Letters::kHeading);
  const WithTextColour colour(aids.has(pb::Exercise::PHASE) ? phaseColour(now.phase) : kText);
  textLine(text);
}

void showAlignment(const LessonFollow& lesson) {
  const Moment& now = lesson.now();
  const auto cell = [](const std::string& caption, const std::string& value) {
    ImGui::TableNextColumn();
    {
      const WithFont small(Letters::kSmall);
      const WithTextColour dim(kDimText);
      ImGui::TextUnformatted(caption.c_str());
    }
    ImGui::TextUnformatted(value.c_str());
  };
  const auto degrees = [](double rad) { return formatted("%.0f°", rad * 180 / 3.14159265358979); };
  if (!ImGui::BeginTable("alignment", 4, ImGuiTableFlags_SizingStretchSame)) return;
  cell("beside line", now.inside ? mm(now.lateral_error_m) + " mm" : "–");
  cell("tilt", now.inside ? degrees(now.tilt_rad) : "–");
  cell("limit α", degrees(now.alpha_rad));
  cell("speed", now.inside ? formatted("%.0f mm/s", 1e3 * std::abs(now.speed_mps)) : "–");
  ImGui::EndTable();
}

void showPlunger(const LessonFollow& lesson) {
  const double plunger = lesson.now().plunger;
  levelBar(plunger, formatted("plunger %.0f %%", 100 * plunger), kSkyBlue, ImGui::GetContentRegionAvail().x);
}

// loop, recording, server: calm unless there is something to say
void showHealth(const BoardState& state, const LessonFollow& lesson) {
  const WithFont small(Letters::kSmall);
  const LessonStanding& s = state.standing;
  const double missed_share =
      s.time_s > 0 ? static_cast<double>(s.missed_ticks) / (s.time_s * lesson.beginning().rate_hz) : 0;
  conditionLine(missed_share > 0.01    ? Condition::kTrouble
                : missed_share > 0.001 ? Condition::kAttention
                                       : Condition::kGood,
                formatted("loop %.0f Hz: 99 %% within %.0f µs, %llu missed", lesson.beginning().rate_hz,
                          1e-3 * static_cast<double>(s.wakeup.p99_ns),
                          static_cast<unsigned long long>(s.missed_ticks)));
  const bool recording = s.spool == "recording";
  std::string stored = s.spool.empty() ? "recording" : s.spool;
  if (!s.server.empty()) stored += "; " + s.server;
  conditionLine(!s.spool.empty() && !recording                                        ? Condition::kTrouble
                : s.server.starts_with("server away") || s.server == "server refuses" ? Condition::kAttention
                                                                                      : Condition::kGood,
                stored);
  if (!s.room.empty()) conditionLine(Condition::kTrouble, s.room);
  if (lesson.dropped() > 0)
    conditionLine(Condition::kAttention,
                  formatted("this picture left out %llu samples; the recording has them",
                            static_cast<unsigned long long>(lesson.dropped())));
  if (!state.aids_by.empty()) conditionLine(Condition::kAttention, state.aids_by + " chose what is shown");
  for (const std::string& note : lesson.beginning().device_notes) {
    const WithTextColour dim(kDimText);
    textLine(note);
  }
}

}  // namespace

void lessonPanel(const BoardState& state, const LessonFollow& lesson, const AidSet& aids,
                 UltrasoundView& ultrasound, ImVec2 size_px) {
  beginPanel("figures", "", size_px.x, size_px.y);
  const float width = ImGui::GetContentRegionAvail().x;
  showPhase(lesson, aids);
  showFigures(lesson, aids, width);
  if (aids.has(pb::Exercise::ALIGNMENT)) showAlignment(lesson);
  showPlunger(lesson);

  // what is left is shared by ladder, slice and plot
  const float health =
      ImGui::GetTextLineHeightWithSpacing() * 2.4F +
      (state.aids_by.empty() ? 0 : ImGui::GetTextLineHeightWithSpacing()) +
      (lesson.dropped() > 0 ? ImGui::GetTextLineHeightWithSpacing() : 0) +
      static_cast<float>(lesson.beginning().device_notes.size()) * ImGui::GetTextLineHeightWithSpacing();
  const float rest = std::max(8 * space(), ImGui::GetContentRegionAvail().y - health);
  const bool ladder = aids.has(pb::Exercise::LAYER) || aids.has(pb::Exercise::DEPTH);
  const bool slice = aids.has(pb::Exercise::ULTRASOUND);
  // a plot without height tells nothing: large letters in a small window leave it away
  const bool plot = aids.has(pb::Exercise::FORCE) && (!(ladder || slice) || rest > 26 * space());
  const float upper = (ladder || slice) ? (plot ? 0.52F * rest : rest) : 0;
  if (ladder) {
    layerLadder(*lesson.scene(), lesson.now(), aids,
                {slice ? 0.42F * width : width, upper - ImGui::GetStyle().ItemSpacing.y});
    if (slice) ImGui::SameLine();
  }
  if (slice)
    ultrasound.show("ultrasound", *lesson.scene(), lesson.now(),
                    {0, upper - ImGui::GetStyle().ItemSpacing.y});
  if (plot) {
    const double now_s = std::max(lesson.trace().lastTime_s(), kPlotSpan_s);
    std::vector<StackedPlot> plots;
    plots.push_back(
        gesturePlot(GesturePlot::kForces, lesson.trace(), lesson.scene().get(), now_s - kPlotSpan_s, now_s));
    plotStack("forces", plots, {width, rest - upper});
  } else if (upper == 0 && !aids.has(pb::Exercise::PHASE) && !aids.has(pb::Exercise::ALIGNMENT)) {
    const WithTextColour dim(kDimText);
    textBlock("This exercise is done by feel.");
  }
  showHealth(state, lesson);
  endPanel();
}

}  // namespace needlelab
