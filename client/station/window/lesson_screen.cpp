#include "client/station/window/lesson_screen.h"

#include <algorithm>
#include <string>

#include "client/station/window/keys.h"
#include "client/station/window/overlay_words.h"
#include "client/station/window/start_choice.h"
#include "client/view/model/axis_ticks.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

int held(int plus, int minus) {
  return (ImGui::IsKeyDown(plus) ? 1 : 0) - (ImGui::IsKeyDown(minus) ? 1 : 0);
}

// one lesson has no exercise where it has a profile only
std::string titleOf(const LessonFollow& lesson) {
  const auto& exercise = lesson.beginning().lesson.exercise;
  return exercise ? exercise->name() : lesson.beginning().lesson.profile.name();
}

void showHead(const BoardState& state, const LessonFollow& lesson) {
  const LessonBeginning& beginning = lesson.beginning();
  const double limit = beginning.time_limit_s, now = state.standing.time_s;
  {
    const WithFont heading(Letters::kHeading);
    const std::string clock = limit > 0 ? clockText(std::max(0.0, limit - now)) + " left" : clockText(now);
    const float wide = ImGui::CalcTextSize(clock.c_str()).x;
    const float x = ImGui::GetContentRegionAvail().x;
    textLine(titleOf(lesson), x - wide - 3 * space());
    ImGui::SameLine(x - wide + ImGui::GetStyle().WindowPadding.x);
    const WithTextColour colour(limit > 0 && limit - now < 10 ? kOrange : kText);
    ImGui::TextUnformatted(clock.c_str());
  }
  std::string who = beginning.trainee;
  if (beginning.lesson.attempt > 0) who += ", attempt " + std::to_string(beginning.lesson.attempt);
  if (beginning.lesson.attempts_left)
    who += " (" + std::to_string(*beginning.lesson.attempts_left) + " left, this one included)";
  if (beginning.lesson.exercise && !beginning.lesson.exercise->description().empty())
    who += ": " + beginning.lesson.exercise->description();
  const WithTextColour dim(kDimText);
  textLine(who);
}

}  // namespace

void LessonScreen::begin(const LessonFollow& lesson) {
  renderer_.setScene(lesson.scene());
  frame_ = SceneFrame{};
  frame_.camera = firstLook(*lesson.scene());
  steering_.reset();
  if (lesson.beginning().steering)
    steering_.emplace(
        SteeringWish{lesson.beginning().hand_start.X_WT, lesson.beginning().hand_start.plunger});
  held_across_ = held_tilt_ = asks_for_end_ = false;
}

void LessonScreen::show(const BoardState& state, const LessonFollow& lesson, LessonRequests& requests) {
  beginScreen("lesson");
  showHead(state, lesson);
  const float foot = 3.4F * space();
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  // large letters need a wider panel, but the picture stays the larger part
  const float panel = std::max(0.34F * rest.x, std::min(0.46F * rest.x, 42 * space()));
  const ImVec2 picture{rest.x - panel - gap, rest.y - foot};
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::BeginGroup();
  showScene(state, lesson, picture);
  ImGui::EndGroup();
  ImGui::SameLine();
  ImGui::BeginGroup();
  lessonPanel(state, lesson, AidSet(state.aids), ultrasound_, {panel, picture.y});
  ImGui::EndGroup();
  if (steering_) {
    keyHint("W S / wheel", "in, out");
    ImGui::SameLine();
    keyHint("arrows / drag", "across");
    ImGui::SameLine();
    keyHint("Ctrl+arrows / right drag", "tilt");
    ImGui::SameLine();
    keyHint("Space / X", "plunger in, out");
    ImGui::SameLine();
    keyHint("Shift", "slowly");
    ImGui::SameLine();
  }
  keyHint("1 2 3", "views");
  ImGui::SameLine();
  keyHint("Esc", "end");
  lessonMessages(state, corner, picture);
  lessonOverlay(state.standing, requests, corner, picture);
  askForEnd(requests);
  endScreen();
}

void LessonScreen::showScene(const BoardState& state, const LessonFollow& lesson, ImVec2 size_px) {
  chooseView(lesson);
  frame_.moment = lesson.now();
  frame_.show_needle = lesson.begun();
  frame_.aids = AidSet(state.aids);
  SceneWidgetOptions options;
  // a hand that is steered needs the mouse; with Alt held it turns the picture there, too
  options.mouse_moves_camera = !steering_ || ImGui::GetIO().KeyAlt;
  const SceneWidgetResult result = sceneWidget("scene", renderer_, frame_, size_px, options);
  if (steering_) steer(lesson, result.hovered);
}

void LessonScreen::chooseView(const LessonFollow& lesson) {
  if (ImGui::IsKeyPressed(GLFW_KEY_1, false)) frame_.camera = firstLook(*lesson.scene());
  if (ImGui::IsKeyPressed(GLFW_KEY_2, false)) frame_.camera = lookFromTheSide(*lesson.scene());
  if (ImGui::IsKeyPressed(GLFW_KEY_3, false)) frame_.camera = lookFromAbove(*lesson.scene());
}

// mouse and keys of this frame, on their way to the hand
void LessonScreen::steer(const LessonFollow& lesson, bool hovered) {
  const ImGuiIO& io = ImGui::GetIO();
  const bool mouse = !io.KeyAlt && !asks_for_end_;
  // what began in the picture goes on beyond its edge
  if (!ImGui::IsMouseDown(ImGuiMouseButton_Left)) held_across_ = false;
  if (!ImGui::IsMouseDown(ImGuiMouseButton_Right)) held_tilt_ = false;
  if (hovered && mouse && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) held_across_ = true;
  if (hovered && mouse && ImGui::IsMouseClicked(ImGuiMouseButton_Right)) held_tilt_ = true;

  SteerInput input;
  input.dt_s = static_cast<double>(io.DeltaTime);
  input.fine = io.KeyShift;
  if (held_across_)
    input.across_right_px = static_cast<double>(io.MouseDelta.x),
    input.across_up_px = -static_cast<double>(io.MouseDelta.y);
  if (held_tilt_)
    input.tilt_right_px = static_cast<double>(io.MouseDelta.x),
    input.tilt_up_px = -static_cast<double>(io.MouseDelta.y);
  if (hovered && mouse) input.wheel = static_cast<double>(io.MouseWheel);
  if (!io.WantTextInput && !asks_for_end_) {
    input.advance = held(GLFW_KEY_W, GLFW_KEY_S);
    const int right = held(GLFW_KEY_RIGHT, GLFW_KEY_LEFT), up = held(GLFW_KEY_UP, GLFW_KEY_DOWN);
    (io.KeyCtrl ? input.tilt_right : input.across_right) = right;
    (io.KeyCtrl ? input.tilt_up : input.across_up) = up;
    input.press = ImGui::IsKeyDown(GLFW_KEY_SPACE);
    input.draw = ImGui::IsKeyDown(GLFW_KEY_X);
  }
  const SteerView view{frame_.camera.right_W(), frame_.camera.upward_W()};
  const Vec3 tip = lesson.begun() ? lesson.now().p_WT_m : lesson.beginning().hand_start.X_WT.p;
  lesson.beginning().steering->wish(steering_->update(input, view, tip));
}

// one key would end a lesson by mistake
void LessonScreen::askForEnd(LessonRequests& requests) {
  constexpr const char* kQuestion = "End this lesson?";
  if (ImGui::IsKeyPressed(GLFW_KEY_ESCAPE, false) && !asks_for_end_) {
    asks_for_end_ = true;
    ImGui::OpenPopup(kQuestion);
    return;
  }
  const ImVec2 middle{0.5F * ImGui::GetIO().DisplaySize.x, 0.5F * ImGui::GetIO().DisplaySize.y};
  ImGui::SetNextWindowPos(middle, ImGuiCond_Always, {0.5F, 0.5F});
  if (!ImGui::BeginPopupModal(kQuestion, nullptr,
                              ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove)) {
    asks_for_end_ = false;
    return;
  }
  ImGui::TextUnformatted("Everything up to here is kept and scored.");
  ImGui::Spacing();
  const bool enter = enterPressed();
  if (bigButton("End it (Enter)", true) || enter) {
    requests.stop({});
    ImGui::CloseCurrentPopup();
  }
  ImGui::SameLine();
  if (bigButton("Go on (Esc)") || ImGui::IsKeyPressed(GLFW_KEY_ESCAPE, false)) ImGui::CloseCurrentPopup();
  ImGui::EndPopup();
}

}  // namespace needlelab
