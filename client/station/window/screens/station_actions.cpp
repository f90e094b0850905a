#include "client/station/window/screens/station_actions.h"

#include "client/station/window/lessons/start_choice.h"

namespace needlelab {

std::vector<ScreenAction> startActions(bool can_begin, bool may_quit) {
  std::vector<ScreenAction> actions = {{kActBegin, "Begin", ActionKey::kEnter, "begin", can_begin},
                                       {kActLook, "Look again", ActionKey::kNone, "", true}};
  if (may_quit) actions.push_back({kActQuit, "Quit", ActionKey::kNone, "", true});
  return actions;
}

std::vector<ScreenAction> endActions(const BoardState& state, bool may_quit) {
  std::vector<ScreenAction> actions;
  if (state.next)
    actions.push_back(
        {kActNext, "Next: " + exerciseName(state.lists, state.next->exercise) + " (" + state.next->from + ")",
         ActionKey::kEnter, "the next exercise", true});
  actions.push_back({kActAgain, "Next try", state.next ? ActionKey::kNone : ActionKey::kEnter,
                     state.next ? "" : "next try", true});
  actions.push_back({kActOther, "Other exercise", ActionKey::kO, "other exercise", true});
  if (may_quit) actions.push_back({kActQuit, "Quit", ActionKey::kNone, "", true});
  return actions;
}

int endActionByKey(int action, bool characters_typed) {
  const bool begins = action == kActNext || action == kActAgain;
  return characters_typed && begins ? kActOther : action;
}

std::vector<ScreenAction> failedActions(bool may_quit) {
  if (!may_quit) return {};
  return {{kActQuit, "Quit", ActionKey::kEnter, "", true}};
}

std::vector<ScreenAction> faultActions() {
  return {{kActSeen, "I have seen it", ActionKey::kEnter, "", true}};
}

std::vector<ScreenAction> endLessonActions() {
  return {{kActNo, "Go on", ActionKey::kEnterOrEscape, "", true},
          {kActYes, "End it", ActionKey::kDelete, "", true}};
}

std::vector<ScreenAction> quitActions() {
  return {{kActNo, "Stay", ActionKey::kEnterOrEscape, "", true},
          {kActYes, "Quit", ActionKey::kDelete, "", true}};
}

std::string quitText(const BoardState& state) {
  switch (state.stage) {
    case Stage::kLesson:
      return "The lesson ends now. Everything up to here is kept and scored.";
    case Stage::kPreparing:
      return "The lesson that is being prepared does not begin.";
    case Stage::kConcluding:
    case Stage::kEnd:
      if (state.outcome && !state.outcome->stored.ok())
        return "The lesson is over. " + state.outcome->stored.error().message;
      return "The lesson is over. Its recording is kept.";
    case Stage::kOpening:
    case Stage::kStart:
    case Stage::kClosing:
    case Stage::kFailed:
      break;
  }
  return "No lesson is running.";
}

}  // namespace needlelab
