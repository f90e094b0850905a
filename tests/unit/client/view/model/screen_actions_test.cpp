#include "client/view/model/screen_actions.h"

#include <gtest/gtest.h>

#include <vector>

namespace needlelab {
namespace {

TEST(ScreenActions, aKeyMeansTheActionThatIsPossible) {
  const std::vector<ScreenAction> actions = {{1, "Begin", ActionKey::kEnter, "begin", true},
                                             {2, "Look again", ActionKey::kNone, "", true},
                                             {3, "Other", ActionKey::kO, "", false}};
  EXPECT_EQ(actionOf(actions, ActionKey::kEnter), 1);
  EXPECT_EQ(actionOf(actions, ActionKey::kEscape), std::nullopt);
  EXPECT_EQ(actionOf(actions, ActionKey::kNone), std::nullopt) << "no key is no key of any action";
  EXPECT_EQ(actionOf(actions, ActionKey::kO), std::nullopt) << "not now";
  EXPECT_TRUE(actions[0].isDefault());
  EXPECT_FALSE(actions[1].isDefault());
}

TEST(ScreenActions, aQuestionNamesItsKeys) {
  EXPECT_EQ(labelWithKey({1, "End it", ActionKey::kEnter, "", true}), "End it (Enter)");
  EXPECT_EQ(labelWithKey({1, "Go on", ActionKey::kEscape, "", true}), "Go on (Esc)");
  EXPECT_EQ(labelWithKey({1, "Quit", ActionKey::kNone, "", true}), "Quit");
}

}  // namespace
}  // namespace needlelab
