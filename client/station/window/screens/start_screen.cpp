#include "client/station/window/screens/start_screen.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <imgui/imgui.h>
#include <imgui/imgui_internal.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "client/station/run/lesson/trainee_code.h"
#include "client/station/run/lesson_requests.h"
#include "client/station/window/screens/station_actions.h"
#include "client/view/action_bar.h"
#include "client/view/input_queue.h"
#include "client/view/theme.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

// dates come nearer without any input; also the time before the same standing is requested again
constexpr std::int64_t kDateRefresh_ns = 30'000'000'000;

// a row of a list, wrapped
bool wrappedRow(const std::string& text, bool selected) {
  const float wrap_px = ImGui::GetContentRegionAvail().x;
  const float height_px = ImGui::CalcTextSize(text.c_str(), nullptr, false, wrap_px).y;
  const ImVec2 at = ImGui::GetCursorPos();
  const bool pressed = ImGui::Selectable("##row", selected, 0, {0, height_px});
  const ImVec2 after = ImGui::GetCursorPos();
  ImGui::SetCursorPos(at);
  textBlock(text);
  ImGui::SetCursorPos(after);
  return pressed;
}

// without the last letter, which may have several bytes
void dropLastLetter(std::string& text) {
  while (!text.empty() && (static_cast<unsigned char>(text.back()) & 0xC0U) == 0x80U) text.pop_back();
  if (!text.empty()) text.pop_back();
}

Rgb colourOfRow(const ExerciseRow& row) {
  if (!row.usable) return kDimText;
  if (row.state == StepState::kDone) return styleOf(Condition::kGood).colour;
  return kText;
}

Rgb colourOfNote(const ExerciseRow& row) {
  if (row.due == DueState::kOver) return styleOf(Condition::kTrouble).colour;
  if (row.state == StepState::kDone) return styleOf(Condition::kGood).colour;
  const bool calls =
      row.state == StepState::kNext || row.state == StepState::kUnknown || row.due == DueState::kSoon;
  return row.usable && calls ? kYellow : kDimText;
}

}  // namespace

bool StartScreen::show(const BoardState& state, bool changed, bool keys, bool may_quit, LessonBoard& board) {
  const std::int64_t now_unix_ns = wallNowNs();
  if (changed || fresh_ || now_unix_ns - updated_unix_ns_ > kDateRefresh_ns) {
    choice_.update(state, now_unix_ns);
    updated_unix_ns_ = now_unix_ns;
    if (fresh_ || (!typing_ && !ImGui::GetIO().WantTextInput)) typed_ = choice_.shown(choice_.trainee());
    fresh_ = false;
  }
  const std::pair chosen_before(choice_.trainee(), choice_.exercise());
  beginScreen("start");
  {
    const WithFont heading(Letters::kHeading);
    ImGui::TextUnformatted("Needle injection: new lesson");
  }
  const float width = ImGui::GetContentRegionAvail().x;
  const float foot = 4.2F * space();
  const float height = ImGui::GetContentRegionAvail().y - foot;
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  beginPanel("who", "Trainee", 0.25F * width - gap, height);
  showTrainees();
  endPanel();
  ImGui::SameLine();
  beginPanel("what", "Exercise", 0.43F * width - gap, height);
  showExercises();
  endPanel();
  ImGui::SameLine();
  beginPanel("station", "This station", 0, height);
  auto chosen = showStation(state, may_quit);
  endPanel();

  keyHint("Letters", "name");
  ImGui::SameLine();
  keyHint("Left/Right", "trainee");
  ImGui::SameLine();
  keyHint("Up/Down", "exercise");
  ImGui::SameLine();
  const auto actions = startActions(canBegin(), may_quit);
  actionHints(actions);
  endScreen();

  // A field for a name or code that was just entered is active one frame before ImGui reports it. The code's
  // field is entered automatically; while it is empty, the arrows still move the choice.
  if (keys && (in_empty_code_ || (!ImGui::GetIO().WantTextInput && !ImGui::IsAnyItemActive()))) {
    if (ImGui::IsKeyPressed(GLFW_KEY_DOWN)) choice_.step(1);
    if (ImGui::IsKeyPressed(GLFW_KEY_UP)) choice_.step(-1);
    for (const auto& [key, by] : {std::pair(GLFW_KEY_LEFT, -1), std::pair(GLFW_KEY_RIGHT, 1)})
      if (ImGui::IsKeyPressed(key)) {
        choice_.stepTrainee(by);
        typed_ = choice_.shown(choice_.trainee());
        typing_ = false;
      }
    // the code's field gets the keys a moment after the question came
    if (typing_ || choice_.codeQuestion() == nullptr) typeName();
    requestStanding(board);
  }
  // what was refused is not for the next trainee
  if (!state.trouble.empty() && chosen_before != std::pair(choice_.trainee(), choice_.exercise()))
    board.change([](BoardState& now) { now.trouble.clear(); });
  // a text that may be a badge is not left on the screen
  if (keys && choice_.mayBeBadge() && actionByKey(startActions(true, may_quit)) == kActBegin) {
    typed_.clear();
    choice_.typeTrainee(typed_, true);
  }
  // a question over the screen gets the keys
  if (keys && !chosen) chosen = actionByKey(actions);
  act(chosen, board);
  return chosen == kActQuit;
}

// does not ask while a name is being typed
void StartScreen::requestStanding(LessonBoard& board) {
  const std::string trainee = choice_.standingWanted();
  const bool again = trainee == asked_for_ && updated_unix_ns_ - asked_unix_ns_ < kDateRefresh_ns;
  if (trainee.empty() || again) return;
  asked_for_ = trainee;
  asked_unix_ns_ = updated_unix_ns_;
  board.ask({BoardRequest::Kind::kTrainee, {trainee, "", false}});
}

void StartScreen::showTrainees() {
  constexpr std::size_t kFieldBytes = 4 * kMaxNameBytes;  // a full name with the account's
  std::array<char, kFieldBytes + 1> text{};
  std::memcpy(text.data(), typed_.data(), std::min(typed_.size(), kFieldBytes));
  ImGui::SetNextItemWidth(-1);
  if (ImGui::InputTextWithHint("##name", "name", text.data(), text.size())) {
    typed_ = text.data();
    choice_.typeTrainee(typed_, false);
  }
  if (ImGui::IsItemActivated()) typing_ = false;
  const bool in_field = ImGui::IsItemActive();
  showTypedName();
  showCode(in_field || typing_);
  ImGui::Spacing();
  std::optional<std::string> pressed;
  for (const std::string& name : choice_.trainees()) {
    ImGui::PushID(name.c_str());
    if (wrappedRow(choice_.shown(name), name == choice_.trainee())) pressed = name;
    ImGui::PopID();
  }
  if (pressed) {
    choice_.chooseTrainee(*pressed);
    typed_ = choice_.shown(*pressed);
    typing_ = false;
  }
  if (choice_.trainees().empty() && choice_.typedName().empty()) {
    const WithTextColour dim(kDimText);
    textBlock("Trainees with assignments are listed here.");
  }
}

// shows the text that is being typed, and how to correct it
void StartScreen::showTypedName() {
  const WithFont small(Letters::kSmall);
  const WithTextColour dim(kDimText);
  const std::string& typed = choice_.typedName();
  if (typed.empty()) return textBlock("Type a name: the list follows.");
  const auto& fit = choice_.trainees();
  std::string words = typing_ ? "Typing \"" + typed + "\": Backspace corrects."
                              : "Names with \"" + typed + "\". Backspace shows all.";
  if (fit.empty())
    words += " No name here has this in it.";
  else if (std::find(fit.begin(), fit.end(), choice_.trainee()) == fit.end())
    words += " Right takes " + choice_.shown(fit.front()) + ".";
  textBlock(words);
}

// The screen itself takes letters, so that a name needs no click. The first one begins a new name.
void StartScreen::typeName() {
  std::string name = typing_ ? typed_ : std::string();
  for (const ImWchar letter : ImGui::GetIO().InputQueueCharacters) {
    if (name.empty() && letter == ' ') continue;
    std::array<char, 5> bytes{};
    name += ImTextCharToUtf8(bytes.data(), letter);
  }
  if (ImGui::IsKeyPressed(GLFW_KEY_BACKSPACE)) {
    if (!typing_) return choice_.showAllTrainees();
    dropLastLetter(name);
  } else if (name == (typing_ ? typed_ : std::string())) {
    return;
  }
  typing_ = true;
  typed_ = std::move(name);
  choice_.typeTrainee(typed_, true);
}

// A badge reader types as a US keyboard does, whatever layout this computer has: the digit on the key counts,
// not the sign beside it (& on a French 1). Frames see one key press and the text of it.
int digitOnTheKey(ImGuiInputTextCallbackData* typed) {
  if (ImGui::GetIO().KeyShift) return 0;
  for (int key = GLFW_KEY_0; key <= GLFW_KEY_9; ++key)
    if (ImGui::IsKeyPressed(key, false)) typed->EventChar = static_cast<ImWchar>('0' + (key - GLFW_KEY_0));
  return 0;
}

// Only while there is a question for the chosen trainee's code. Enter begins, as everywhere on this screen.
// `writes_name`: the person is still in the name's field, and may type a longer name.
void StartScreen::showCode(bool writes_name) {
  const CodeQuestion* const question = choice_.codeQuestion();
  in_empty_code_ = false;
  if (question == nullptr) {
    code_question_ = 0;
    return;
  }
  ImGui::Spacing();
  {
    const WithTextColour dim(kDimText);
    ImGui::TextUnformatted("Code");
  }
  // one byte more than the longest code, so that a longer one is seen and refused, not cut off
  std::array<char, kMaxCodeBytes + 2> text{};
  std::memcpy(text.data(), choice_.typedCode().data(),
              std::min(choice_.typedCode().size(), kMaxCodeBytes + 1));
  // a new question empties the field that the person may still be in
  ImGui::PushID(static_cast<int>(question->number));
  if (!writes_name && std::exchange(code_question_, question->number) != question->number) focusNextField();
  ImGui::SetNextItemWidth(-1);
  if (ImGui::InputTextWithHint("##code", "PIN or badge", text.data(), text.size(),
                               ImGuiInputTextFlags_Password | ImGuiInputTextFlags_CallbackCharFilter,
                               digitOnTheKey))
    choice_.typeCode(text.data());
  in_empty_code_ = ImGui::IsItemActive() && choice_.typedCode().empty();
  // Enter leaves the field, but too short a code begins nothing: return to the field
  const bool entered = ImGui::IsKeyPressed(GLFW_KEY_ENTER) || ImGui::IsKeyPressed(GLFW_KEY_KP_ENTER);
  if (ImGui::IsItemDeactivated() && entered && !checkCode(choice_.typedCode()).ok()) code_question_ = 0;
  ImGui::PopID();
  ::explicit_bzero(text.data(), text.size());
  const WithFont small(Letters::kSmall);
  const WithTextColour colour(question->wrong ? styleOf(Condition::kTrouble).colour : kText);
  textBlock(question->text);
}

void StartScreen::showExercises() {
  const int chosen = choice_.exercise();
  int index = 0, pressed = -1;
  if (const std::string as_of = choice_.asOf(); !as_of.empty())
    conditionLine(Condition::kAttention, as_of + ": it may have changed since");
  for (const ExerciseRow& exercise : choice_.exercises()) {
    const float top_px = ImGui::GetCursorScreenPos().y;
    ImGui::PushID(index);
    if (!exercise.heading.empty()) {
      if (index > 0) ImGui::Spacing();
      const WithTextColour dim(kDimText);
      textBlock(exercise.heading);
      ImGui::Separator();
    }
    {
      const WithTextColour colour(colourOfRow(exercise));
      const std::string number = exercise.number > 0 ? std::to_string(exercise.number) + ". " : "";
      pressed = wrappedRow(number + exercise.name, index == chosen) ? index : pressed;
    }
    if (!exercise.note.empty()) {
      const WithFont small(Letters::kSmall);
      const WithTextColour colour(colourOfNote(exercise));
      ImGui::Indent();
      textBlock(exercise.note);
      ImGui::Unindent();
    }
    if (index == chosen && !exercise.description.empty()) {
      const WithFont small(Letters::kSmall);
      ImGui::Indent();
      textBlock(exercise.description);
      ImGui::Unindent();
    }
    ImGui::PopID();
    // What Enter begins is on the screen, with its whole description. A scroll bar that comes wraps it again.
    const float list_px = ImGui::GetWindowPos().y, end_px = ImGui::GetCursorScreenPos().y;
    const float place_px = end_px - list_px + ImGui::GetScrollY();
    if (index == chosen && (scrolled_to_ != exercise.choice || std::abs(scrolled_px_ - place_px) > 1)) {
      scrolled_to_ = exercise.choice;
      scrolled_px_ = place_px;
      if (end_px > list_px + ImGui::GetWindowHeight()) ImGui::SetScrollHereY(1);
      if (top_px < list_px) ImGui::SetScrollFromPosY(top_px - list_px, 0);
    }
    ++index;
  }
  if (pressed >= 0) choice_.chooseExercise(pressed);
}

std::optional<int> StartScreen::showStation(const BoardState& state, bool may_quit) {
  const DeviceReadiness& device = state.device;
  conditionLine(!device.is_checked ? Condition::kUnknown
                : device.ready     ? Condition::kGood
                                   : Condition::kTrouble,
                device.is_checked ? device.name : "checking the device …");
  if (device.is_checked) {
    const WithFont small(Letters::kSmall);
    textBlock(device.state);
  }
  ImGui::Spacing();
  const StationFact server = serverFact(state.server);
  if (state.server.empty())
    conditionLine(Condition::kUnknown, "without a server: recordings stay here");
  else if (state.server_away)
    conditionLine(Condition::kAttention,
                  "The server is unreachable: lessons still work, recordings wait here");
  else
    conditionLine(server.condition, server.condition == Condition::kGood
                                        ? "connected to the server"
                                        : "The server accepts no recordings now: they wait here");
  // the uplink's own words, for a technician
  if (!state.server.empty() && ImGui::TreeNodeEx("more", ImGuiTreeNodeFlags_NoTreePushOnOpen))
    textBlock(state.server);
  if (state.next) {
    ImGui::Spacing();
    conditionLine(Condition::kAttention,
                  "Next: " + exerciseName(state.lists, state.next->exercise) + " (" + state.next->from + ")");
  }
  if (!state.trouble.empty()) {
    ImGui::Spacing();
    const WithTextColour colour(styleOf(Condition::kTrouble).colour);
    textBlock("The lesson did not start: " + state.trouble);
  }
  ImGui::Spacing();
  const std::string missing = choice_.missing();
  if (!missing.empty()) {
    const WithTextColour dim(kDimText);
    textBlock(missing);
  }
  return actionButtons(startActions(missing.empty(), may_quit), -1);
}

void StartScreen::act(std::optional<int> action, LessonBoard& board) {
  if (action == kActLook) board.ask({BoardRequest::Kind::kLook, {choice_.trainee(), "", false}});
  if (action != kActBegin) return;
  typing_ = false;
  choice_.showAllTrainees();
  if (const auto choice = choice_.choice())
    board.ask({BoardRequest::Kind::kBegin, *choice, choice_.takeCode()});
}

namespace {

// begins a panel in the middle of an otherwise empty screen
void beginNotice(const char* id, const std::string& heading) {
  beginScreen(id);
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  const ImVec2 corner = ImGui::GetCursorPos();
  const ImVec2 size{std::max(0.6F * rest.x, 40 * space()), std::max(0.34F * rest.y, 16 * space())};
  ImGui::SetCursorPos({corner.x + 0.5F * (rest.x - size.x), corner.y + 0.3F * (rest.y - size.y)});
  beginPanel(id, heading, size.x, size.y);
}

void endNotice() {
  endPanel();
  endScreen();
}

}  // namespace

void showPreparing(const BoardState& state, LessonRequests& requests) {
  const std::string name = exerciseName(state.lists, state.choice.exercise);
  beginNotice("preparing", name.empty() ? "needlelab" : name);
  textBlock((state.preparing.empty() ? std::string("preparing") : state.preparing) + " …");
  ImGui::Spacing();
  if (state.stage == Stage::kPreparing && bigButton("Cancel")) requests.stop({});
  endNotice();
}

bool showFailed(const BoardState& state, bool keys, bool may_quit) {
  beginNotice("failed", "This station cannot run lessons");
  textBlock(state.trouble);
  ImGui::Spacing();
  const auto actions = failedActions(may_quit);
  auto chosen = actionButtons(actions);
  endNotice();
  if (keys && !chosen) chosen = actionByKey(actions);
  return chosen == kActQuit;
}

}  // namespace needlelab
