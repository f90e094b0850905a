#include "client/view/model/screen_actions.h"

#include <gtest/gtest.h>

#include <vector>

namespace needlelab {
namespace {

TEST(ScreenActions, aKeyMeansTheActionThatIsPossible) {
  const std::vector<ScreenAction> actions = {{1, "Begin", ActionKey::kEnter, "begin", true},
                                             {2, "Check again", ActionKey::kNone, "", true},
                                             {3, "Other", ActionKey::kO, "", false}};
  EXPECT_EQ(actionOf(actions, ActionKey::kEnter), 1);
  EXPECT_EQ(actionOf(actions, ActionKey::kEscape), std::nullopt);
  EXPECT_EQ(actionOf(actions, ActionKey::kNone), std::nullopt) << "no key is not a key of any action";
  EXPECT_EQ(actionOf(actions, ActionKey::kO), std::nullopt) << "not now";
  EXPECT_TRUE(actions[0].isDefault());
  EXPECT_FALSE(actions[1].isDefault());
}

TEST(ScreenActions, aQuestionsDefaultHasEnterAndEscape) {
  const std::vector<ScreenAction> answers = {{1, "Continue", ActionKey::kEnterOrEscape, "", true},
                                             {2, "End lesson", ActionKey::kDelete, "", true}};
  EXPECT_EQ(actionOf(answers, ActionKey::kEnter), 1);
  EXPECT_EQ(actionOf(answers, ActionKey::kEscape), 1);
  EXPECT_EQ(actionOf(answers, ActionKey::kDelete), 2);
  EXPECT_TRUE(answers[0].isDefault());
  EXPECT_FALSE(answers[1].isDefault());
}

TEST(ScreenActions, aQuestionNamesItsKeys) {
  EXPECT_EQ(labelWithKey({1, "Acknowledge", ActionKey::kEnter, "", true}), "Acknowledge (Enter)");
  EXPECT_EQ(labelWithKey({1, "Continue", ActionKey::kEnterOrEscape, "", true}), "Continue (Enter, Esc)");
  EXPECT_EQ(labelWithKey({1, "End lesson", ActionKey::kDelete, "", true}), "End lesson (Del)");
  EXPECT_EQ(labelWithKey({1, "Quit", ActionKey::kNone, "", true}), "Quit");
}

}  // namespace
}  // namespace needlelab
