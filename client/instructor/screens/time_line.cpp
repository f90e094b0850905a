#include "client/instructor/screens/time_line.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "client/view/model/axis_ticks.h"
#include "client/view/theme.h"
#include "common/base/text.h"
#include "common/scoring/syringe_events.h"

namespace needlelab {
namespace {

struct LineMark {
  double at_s;
  std::string sign, words;
  Rgb colour;
};

std::vector<LineMark> marksOf(const StoredGesture& gesture, const std::vector<pb::Annotation>& remarks) {
  std::vector<LineMark> marks;
  for (const TraceEvent& event : gesture.trace.events()) {
    if (event.kind == TraceEvent::Kind::kRemark || event.kind == TraceEvent::Kind::kLayerChange ||
        event.kind == TraceEvent::Kind::kTurn || event.kind == TraceEvent::Kind::kStop)
      continue;
    const bool bad = event.kind == TraceEvent::Kind::kFault || event.kind == TraceEvent::Kind::kGap;
    marks.push_back({event.time_s, std::string(signOf(event.kind)), std::string(wordOf(event.kind)),
                     bad ? kVermillion : kDimText});
  }
  for (const pb::SyringeEvent& event : gesture.events)
    marks.push_back({gesture.timeOfTick(event.begin_tick()),
                     event.kind() == pb::SyringeEvent::INJECTION ? "▼" : "△", eventText(event),
                     kBluishGreen});
  for (const pb::Annotation& remark : remarks)
    marks.push_back({gesture.timeOfTick(remark.tick()), "✎",
                     printable(remark.author()) + ": " + printable(remark.text()), kYellow});
  return marks;
}

}  // namespace

void timeLine(ReplayPlayer& player, const StoredGesture& gesture, const std::vector<pb::Annotation>& remarks,
              float height_px) {
  const ImVec2 low = ImGui::GetCursorScreenPos();
  const float width = ImGui::GetContentRegionAvail().x;
  ImGui::InvisibleButton("time line", {width, height_px});
  const bool hovered = ImGui::IsItemHovered(), active = ImGui::IsItemActive();
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const double length_s = std::max(1e-3, player.last_s() - player.first_s());
  const auto x = [&](double at_s) {
    return low.x + static_cast<float>((at_s - player.first_s()) / length_s) * width;
  };
  const auto timeAt = [&](float px) {
    return player.first_s() + static_cast<double>((px - low.x) / width) * length_s;
  };
  // the line, the part that is looped, ticks
  const float middle = low.y + height_px * 0.55F;
  list.AddRectFilled({low.x, low.y}, {low.x + width, low.y + height_px}, packed(kPanelGrey), 4);
  if (player.loop())
    list.AddRectFilled({x(player.loop()->from_s), low.y}, {x(player.loop()->to_s), low.y + height_px},
                       packed(kSkyBlue, 0.28F));
  list.AddLine({low.x, middle}, {low.x + width, middle}, packed(kLineGrey), 2);
  const AxisTicks ticks = axisTicks(0, length_s, std::max(2, static_cast<int>(width / 90)), false);
  for (const double at : ticks.at) {
    const float px = x(player.first_s() + at);
    list.AddLine({px, middle - 3}, {px, middle + 3}, packed(kDimText));
    if (px + 5 * space() > low.x + width) continue;  // no room for its number
    list.AddText(fontOf(Letters::kSmall), fontOf(Letters::kSmall)->FontSize, {px + 3, middle + 4},
                 packed(kDimText), clockText(at, length_s < 20 ? 1 : 0).c_str());
  }
  // marks; the nearest one's words
  const float mouse = ImGui::GetIO().MousePos.x;
  const LineMark* near = nullptr;
  float least = 8;
  const auto marks = marksOf(gesture, remarks);
  for (const LineMark& mark : marks) {
    const float px = x(mark.at_s);
    list.AddText({px - 5, low.y + 1}, packed(mark.colour), mark.sign.c_str());
    if (hovered && std::abs(px - mouse) < least) {
      least = std::abs(px - mouse);
      near = &mark;
    }
  }
  if (near != nullptr) ImGui::SetTooltip("%s  %s", clockText(near->at_s, 1).c_str(), near->words.c_str());
  const float here = x(player.at_s());
  list.AddLine({here, low.y}, {here, low.y + height_px}, packed(kWhite), 2);
  list.AddTriangleFilled({here - 6, low.y}, {here + 6, low.y}, {here, low.y + 8}, packed(kWhite));
  if (!active) return;
  if (!ImGui::GetIO().KeyShift) return player.seek(timeAt(mouse));
  const double begun = timeAt(ImGui::GetIO().MouseClickedPos[0].x), now = timeAt(mouse);
  player.setLoop(ReplayLoop{std::min(begun, now), std::max(begun, now)});
}

}  // namespace needlelab
