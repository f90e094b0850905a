#include "client/view/input_queue.h"

#include <imgui/imgui.h>

#include <algorithm>
#include <utility>

namespace needlelab {
namespace {

using Kind = InputEvent::Kind;

/// Whether it can answer something: what goes up or moves ends or points only.
bool isPress(const InputEvent& event) {
  return event.kind == Kind::kCharacter ||
         (event.down && (event.kind == Kind::kKey || event.kind == Kind::kButton));
}

/// Whether a frame that saw `before` may see `next`, too. A click takes the keyboard from the field that it
/// leaves, so what was written there has its frame before.
bool goTogether(const InputEvent& before, const InputEvent& next) {
  if (before.kind == Kind::kButton) return false;
  if (next.kind == Kind::kButton) return !isPress(before);
  if (before.kind != Kind::kKey || next.kind != Kind::kKey) return true;
  return before.code != next.code && !(before.down && next.down);
}

}  // namespace

std::vector<InputEvent> InputQueue::take() {
  std::vector<InputEvent> seen;
  if (std::exchange(pauses_, false)) return seen;
  for (; !waiting_.empty(); waiting_.pop_front()) {
    const Waiting& next = waiting_.front();
    if (isPress(next.event) && next.saw < dropped_before_) continue;
    const auto has_room = [&](const InputEvent& before) { return goTogether(before, next.event); };
    if (!std::all_of(seen.begin(), seen.end(), has_room)) break;
    seen.push_back(next.event);
  }
  return seen;
}

namespace {

InputQueue& queueNow() {
  return *static_cast<InputQueue*>(ImGui::GetIO().UserData);
}

}  // namespace

void dropInputBefore(int frame) {
  queueNow().dropBefore(frame);
}

void focusNextField() {
  ImGui::SetKeyboardFocusHere();
  queueNow().pause();
}

}  // namespace needlelab
