#include "client/station/window/screens/lesson_steps.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <fmt/core.h>
#include <imgui/imgui.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "client/view/theme.h"
#include "common/scoring/anatomy/structure_region.h"

namespace needlelab {
namespace {

constexpr double kNear_m = 8e-3;       // slowly from here on
constexpr double kOver_m = 3e-3;       // over the landmark
constexpr double kNotOver_m = 7e-3;    // no longer
constexpr double kOff_m = 2.5e-3;      // beside the planned line, outside
constexpr double kOffInside_m = 6e-3;  // and in tissue
constexpr double kOff_rad = 0.06, kOffInside_rad = 0.2;
constexpr double kClear_m = 2e-3;  // off the skin
constexpr double kFirm_N = 2.5;    // as firm as a device renders, on bone or not
constexpr double kDrawn = 0.02, kEmpty = 0.98;

float bodyLine_px() {
  return fontOf(Letters::kBody)->FontSize;
}

bool isOff(const StepFacts& facts) {
  return facts.inside ? facts.off_line_m > kOffInside_m || facts.off_line_rad > kOffInside_rad
                      : facts.off_line_m > kOff_m || facts.off_line_rad > kOff_rad;
}

}  // namespace

LessonStep LessonSteps::say(int number, const char* title, std::vector<std::string> keys,
                            const std::string& by_keys, const std::string& by_hand) const {
  if (!by_keys_) return {number, title, by_hand, {}};
  return {number, title, by_keys, std::move(keys)};
}

LessonStep LessonSteps::next(const StepFacts& facts) {
  if (facts.capped) return feel(facts);
  // a quick hand leaves as soon as the syringe is empty
  if (arrived_ && drew_back_ && facts.plunger >= kEmpty) goes_out_ = true;
  if (!goes_out_ && (!arrived_ || !facts.in_target)) return goIn(facts);
  return inject(facts);
}

LessonStep LessonSteps::feel(const StepFacts& facts) {
  arrived_ = drew_back_ = goes_out_ = done_ = false;
  const std::string bone = landmark_.empty() ? "the bone" : "the " + landmark_;
  const auto line = [&](std::vector<std::string> keys, const std::string& by_keys,
                        const std::string& by_hand) {
    return say(1, "Feel", std::move(keys), by_keys, by_hand);
  };
  const bool is_clear = facts.above_skin_m > kClear_m;
  if (!felt_ && facts.landmark_right_m && facts.landmark_away_m) {
    const double right_m = *facts.landmark_right_m, away_m = *facts.landmark_away_m;
    const double farther_m = std::max(std::fabs(right_m), std::fabs(away_m));
    if (is_clear || farther_m > kNotOver_m)
      over_landmark_ = farther_m < (over_landmark_ ? kNotOver_m : kOver_m);
    if (!over_landmark_) {
      const bool sideways = std::fabs(right_m) >= std::fabs(away_m);
      const char* const key = sideways ? (right_m > 0 ? "→" : "←") : (away_m > 0 ? "↑" : "↓");
      const bool slowly = farther_m < kNear_m;
      if (!is_clear && farther_m > kNotOver_m)
        return line({"S"}, "Hold S until the needle is off the skin.", "Lift the needle off the skin.");
      return line(
          slowly ? std::vector<std::string>{"Shift", key} : std::vector<std::string>{key},
          fmt::format("Hold {}{} until the needle is over {}.", slowly ? "Shift and " : "", key, bone),
          "Move the needle over " + bone + ".");
    }
    felt_ = !is_clear && (facts.feels_bone || facts.force_N > kFirm_N);
    if (!felt_)
      return line({"W"}, "Hold W until bone stops the needle.", "Press gently until bone stops the needle.");
  }
  if (!is_clear)
    return line({"S"}, "Hold S until the needle is off the skin.", "Lift the needle off the skin.");
  return line({"C"}, "Press C: the cap comes off.", "Press the third button: the cap comes off.");
}

LessonStep LessonSteps::goIn(const StepFacts& facts) {
  const std::string target = target_.empty() ? "the target" : "the " + target_;
  const auto line = [&](std::vector<std::string> keys, const std::string& by_keys,
                        const std::string& by_hand) {
    return say(2, "Go in", std::move(keys), by_keys, by_hand);
  };
  arrived_ = goes_out_ = false;
  if (facts.inside && (facts.on_bone || isOff(facts)))
    return line({"S"}, "Hold S until the needle is out of the skin.", "Pull the needle out of the skin.");
  if (!facts.inside && isOff(facts))
    return line({"L"}, "Press L: the needle lines up with the planned line.",
                "Line the needle up with the planned line.");
  if (facts.in_target) {
    arrived_ = true;
    return inject(facts);
  }
  if (facts.inside && facts.short_m < 0)
    return line({"Shift", "S"}, fmt::format("Hold Shift and S until the tip is back in {}.", target),
                fmt::format("Draw the needle back slowly, until the tip is in {}.", target));
  if (facts.inside && facts.short_m < kNear_m)
    return line({"Shift", "W"}, fmt::format("Hold Shift and W until the tip is in {}.", target),
                fmt::format("Go on slowly, until the tip is in {}.", target));
  return line({"W"}, fmt::format("Hold W until the tip is near {}.", target),
              fmt::format("Push the needle in along the line, until the tip is near {}.", target));
}

LessonStep LessonSteps::inject(const StepFacts& facts) {
  const auto line = [&](std::vector<std::string> keys, const std::string& by_keys,
                        const std::string& by_hand) {
    return say(3, injects_ ? "Inject" : "Come out", std::move(keys), by_keys, by_hand);
  };
  if (injects_ && !goes_out_) {
    drew_back_ = drew_back_ || facts.plunger <= kDrawn;
    if (!drew_back_) return line({"X"}, "Hold X until the plunger is drawn back.", "Draw the plunger back.");
    return line({"Space"}, "Hold Space until the syringe is empty.",
                "Press the plunger until the syringe is empty.");
  }
  goes_out_ = true;
  done_ = done_ || facts.above_skin_m > kClear_m;
  if (!done_)
    return line({"S"}, "Hold S until the needle is out of the skin.", "Pull the needle out of the skin.");
  // Esc and Delete end a lesson with any device
  return {3, "Done", "Press Esc, then Delete: the lesson ends, and your score comes.", {"Esc", "Delete"}};
}

StepFacts stepFactsOf(const LessonFollow& lesson, const LessonStatus& status, const PlannedInsertion& way,
                      const Anatomy& anatomy, const SteerView& view) {
  const Moment& now = lesson.now();
  const SceneView& scene = *lesson.scene();
  StepFacts facts;
  facts.capped = isCapped(now);
  facts.inside = now.inside;
  facts.force_N = forceOf(now);
  facts.plunger = now.plunger;
  facts.above_skin_m = -now.depth_m - (facts.capped ? scene.cap_radius_m : 0);
  facts.on_bone = std::ranges::any_of(status.alarms,
                                      [](const ActiveAlarm& alarm) { return alarm.alarm == Alarm::kBone; });
  const Vec3 axis_W = zAxis(now.q_WT);
  if (way.landmark_W_m) {
    const auto [right_W, away_W] = directionsAcross(axis_W, view);
    facts.landmark_right_m = dot(*way.landmark_W_m - now.p_WT_m, right_W);
    facts.landmark_away_m = dot(*way.landmark_W_m - now.p_WT_m, away_W);
    facts.feels_bone =
        norm(*way.landmark_W_m - now.p_WT_m) < scene.cap_radius_m + 0.5 * kOver_m ||
        (anatomy.landmark && anatomy.landmark->distance(now.p_WT_m) < scene.cap_radius_m + 1e-3);
  }
  const Vec3 from_entry_m = now.p_WT_m - way.entry_W_m;
  facts.off_line_m = norm(cross(from_entry_m, way.direction_W));
  facts.off_line_rad = std::atan2(norm(cross(axis_W, way.direction_W)), dot(axis_W, way.direction_W));
  facts.short_m = way.depth_m - dot(from_entry_m, way.direction_W);
  if (!anatomy.targets.empty()) {
    const Target& target = anatomy.targets.front();
    const auto holds = [&](Vec3 p_W_m) { return distanceTo(anatomy, target, p_W_m) < 0; };
    facts.in_target = now.inside && holds(now.p_WT_m) &&
                      (holds(openingOf(scene, now.p_WT_m, now.q_WT)) || std::fabs(facts.short_m) < 5e-4);
  } else {
    facts.in_target = now.inside && std::fabs(facts.short_m) < 1e-3;
  }
  return facts;
}

void stepStrip(const LessonStep& step) {
  struct Key {
    const char* name;
    int key;
  };
  constexpr Key kKeys[] = {{"W", GLFW_KEY_W},    {"S", GLFW_KEY_S},        {"X", GLFW_KEY_X},
                           {"C", GLFW_KEY_C},    {"L", GLFW_KEY_L},        {"Space", GLFW_KEY_SPACE},
                           {"←", GLFW_KEY_LEFT}, {"→", GLFW_KEY_RIGHT},    {"↑", GLFW_KEY_UP},
                           {"↓", GLFW_KEY_DOWN}, {"Esc", GLFW_KEY_ESCAPE}, {"Delete", GLFW_KEY_DELETE}};
  const auto isDown = [&](const std::string& name) {
    if (name == "Shift") return ImGui::GetIO().KeyShift;
    return std::any_of(std::begin(kKeys), std::end(kKeys),
                       [&](const Key& key) { return name == key.name && ImGui::IsKeyDown(key.key); });
  };
  const WithFont heading(Letters::kHeading);
  const float pad = space(), line = ImGui::GetTextLineHeight(), side = line + pad;
  float keys_px = pad;
  std::vector<float> wide_px;
  for (const std::string& name : step.keys) {
    wide_px.push_back(std::max(side, ImGui::CalcTextSize(name.c_str()).x + 1.4F * pad));
    keys_px += wide_px.back() + pad;
  }
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const float width = ImGui::GetContentRegionAvail().x, wrap = width - keys_px - pad;
  const float words = ImGui::CalcTextSize(step.sentence.c_str(), nullptr, false, wrap).y + bodyLine_px();
  const ImVec2 size{width, std::max(side, words) + 1.5F * pad};
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  draw.AddRectFilled(at, {at.x + size.x, at.y + size.y}, packed(kPanelGrey), 4);
  draw.AddRect(at, {at.x + size.x, at.y + size.y}, packed(kSkyBlue), 4);
  float x = at.x + pad;
  for (std::size_t i = 0; i < step.keys.size(); ++i) {
    const char* const name = step.keys[i].c_str();
    const bool down = isDown(step.keys[i]);
    const float top = at.y + 0.5F * (size.y - side) + (down ? 2.0F : 0.0F);
    draw.AddRectFilled({x, top + 4}, {x + wide_px[i], top + side + 4}, packed(kBlack), 6);
    draw.AddRectFilled({x, top}, {x + wide_px[i], top + side}, packed(down ? kYellow : kWhite), 6);
    draw.AddText({x + 0.5F * (wide_px[i] - ImGui::CalcTextSize(name).x), top + 0.5F * (side - line)},
                 packed(kBlack), name);
    x += wide_px[i] + pad;
  }
  float y = at.y + 0.5F * (size.y - words);
  {
    const WithFont body(Letters::kBody);
    draw.AddText({x, y}, packed(kSkyBlue), fmt::format("Step {} of 3: {}", step.number, step.title).c_str());
  }
  y += bodyLine_px();
  draw.AddText(ImGui::GetFont(), ImGui::GetFontSize(), {x, y}, packed(kWhite), step.sentence.c_str(), nullptr,
               wrap);
  ImGui::Dummy(size);
}

}  // namespace needlelab
