#include "client/instructor/model/live/notices.h"

#include <gmock/gmock.h>

#include <string>
#include <vector>

namespace needlelab {
namespace {

std::vector<std::string> textsOf(const Notices& notices) {
  std::vector<std::string> texts;
  for (const Notice& notice : notices.all()) texts.push_back(notice.text);
  return texts;
}

TEST(Notices, goAfterTheirTimeEachByItself) {
  Notices notices;
  notices.tick(10);
  notices.trouble("no way to the server");
  notices.good("sent");
  notices.tick(15.9);
  EXPECT_THAT(textsOf(notices), testing::ElementsAre("no way to the server", "sent"));
  notices.tick(16.1);
  EXPECT_THAT(textsOf(notices), testing::ElementsAre("no way to the server")) << "trouble stays longer";
  notices.tick(30.1);
  EXPECT_TRUE(notices.all().empty());
}

TEST(Notices, theSameAgainIsOneThatStaysLonger) {
  Notices notices;
  notices.tick(0);
  notices.good("sent");
  notices.tick(5);
  notices.good("sent");
  EXPECT_EQ(notices.all().size(), 1u);
  notices.tick(10);
  EXPECT_EQ(notices.all().size(), 1u);
  notices.tick(11.1);
  EXPECT_TRUE(notices.all().empty());
}

TEST(Notices, theNewestThreeAreKept) {
  Notices notices;
  for (const char* text : {"a", "b", "c", "d"}) notices.good(text);
  EXPECT_THAT(textsOf(notices), testing::ElementsAre("b", "c", "d"));
  notices.dismiss();
  EXPECT_TRUE(notices.all().empty());
}

}  // namespace
}  // namespace needlelab
