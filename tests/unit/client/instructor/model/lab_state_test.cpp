#include "client/instructor/model/lab_state.h"

#include <gtest/gtest.h>

#include <sys/stat.h>

#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

TEST(LabActions, theHighlightedButtonIsEnterAndWaitsWhileTheProgramConnects) {
  const auto ready = loginActions(false), busy = loginActions(true);
  ASSERT_EQ(ready.size(), 1u);
  EXPECT_TRUE(ready[0].isDefault());
  EXPECT_EQ(actionOf(ready, ActionKey::kEnter), kActLogIn);
  EXPECT_EQ(actionOf(busy, ActionKey::kEnter), std::nullopt) << "it is under way";
  EXPECT_TRUE(adviceAction("To the lab").isDefault());
}

TEST(LabActions, enterOpensTheSearchUnlessAnEmptyScreenOverridesIt) {
  EXPECT_EQ(actionOf(searchActions(false), ActionKey::kEnter), kActSearch);
  EXPECT_EQ(actionOf(searchActions(true), ActionKey::kEnter), std::nullopt);
}

TEST(LabActions, stoppingALessonNeedsConfirmationByKey) {
  const auto before = stopActions(false), question = stopActions(true);
  ASSERT_EQ(before.size(), 1u);
  EXPECT_EQ(before[0].key, ActionKey::kNone) << "no single key stops somebody's lesson";
  EXPECT_EQ(actionOf(question, ActionKey::kEnter), kActGoOn);
  EXPECT_EQ(actionOf(question, ActionKey::kEscape), kActGoOn);
  EXPECT_EQ(actionOf(question, ActionKey::kDelete), kActStopNow);
}

TEST(StopQuestion, isAboutJustTheseLessonsAndEndsWithThem) {
  const std::vector<Addressee> asked = {{"bench-1", "s1"}, {"bench-2", "s2"}};
  const std::vector<Addressee> others[] = {{{"bench-1", "s3"}, {"bench-2", "s2"}},
                                           {{"bench-1", "s1"}},
                                           {{"bench-1", "s1"}, {"bench-2", "s2"}, {"bench-3", "s4"}},
                                           {}};
  StopQuestion question;
  EXPECT_FALSE(question.asking());
  for (const std::vector<Addressee>& other : others) {
    question.ask(asked);
    question.reason = "too deep";
    question.keepOnlyFor(asked);
    ASSERT_TRUE(question.asking()) << "nothing has changed";
    EXPECT_EQ(question.reason, "too deep");
    question.keepOnlyFor(other);
    EXPECT_FALSE(question.asking()) << "the answer would stop somebody else";
    EXPECT_EQ(question.reason, "") << "a reason is not somebody else's";
    question.keepOnlyFor(asked);
    EXPECT_FALSE(question.asking()) << "it does not come back by itself";
  }
}

TEST(LabState, aStopQuestionIsDroppedOnStationChangeOrLogOut) {
  LabState lab;
  lab.open("bench-1");
  lab.stop_question.ask({{"bench-1", "s1"}});
  lab.open("bench-1");
  EXPECT_TRUE(lab.stop_question.asking()) << "the same station";
  lab.open("bench-2");
  EXPECT_FALSE(lab.stop_question.asking());
  lab.stop_question.ask({{"bench-2", "s1"}});
  lab.logOut();
  EXPECT_FALSE(lab.stop_question.asking()) << "Esc would be the answer to a question that no one sees";
}

TEST(LabState, aCommandReachesTheChosenStationsThatAreThere) {
  LabState lab;
  lab.screen = WindowScreen::kLab;
  for (const char* station : {"bench-10", "bench-2", "bench-3"}) {
    pb::StationStatus status;
    status.set_station(station);
    status.set_online(true);
    if (station != std::string("bench-2")) status.set_session_id(std::string("lesson at ") + station);
    lab.overview.onStatus(status, 0);
  }
  EXPECT_TRUE(lab.commanded().empty());
  lab.chosen = {"bench-10", "bench-2", "gone"};
  const std::vector<Addressee> both = {{"bench-2", ""}, {"bench-10", "lesson at bench-10"}};
  EXPECT_EQ(lab.commanded(), both);
  EXPECT_EQ(lessonsOf(lab.commanded()), std::vector<Addressee>{both[1]})
      << "there is nothing to stop at bench-2";
  EXPECT_FALSE(stopActions(false, 0)[0].enabled);
  EXPECT_EQ(stopActions(false, 2)[0].label, "Stop 2 lessons …");
}

TEST(LabActions, theBannerOfTheConnectionTakesNoKeyFromTheScreen) {
  EXPECT_TRUE(linkActions(LinkPhase::kOnline).empty());
  EXPECT_TRUE(linkActions(LinkPhase::kConnecting).empty());
  for (const LinkPhase phase : {LinkPhase::kAway, LinkPhase::kRefused}) {
    ASSERT_EQ(linkActions(phase).size(), 1u);
    EXPECT_EQ(linkActions(phase)[0].id, kActReconnect);
    EXPECT_EQ(linkActions(phase)[0].key, ActionKey::kNone);
  }
  EXPECT_NE(linkActions(LinkPhase::kAway)[0].label, linkActions(LinkPhase::kRefused)[0].label);
}

TEST(LoginMemory, everythingButThePasswordComesBack) {
  const test::TempFolder folder;
  const auto file = folder.path() / "login.json";
  LoginForm form{"lab:7750, two:7750", "/keys/ca.crt", "anna", "secret"};
  ASSERT_TRUE(rememberLogin(file, form).ok());
  EXPECT_EQ(readWholeFile(file)->find("secret"), std::string::npos);
  struct stat facts {};
  ASSERT_EQ(::stat(file.c_str(), &facts), 0);
  EXPECT_EQ(facts.st_mode & 0777, 0600u);
  LoginForm again;
  recallLogin(file, again);
  EXPECT_EQ(again.server, "lab:7750, two:7750");
  EXPECT_EQ(again.ca_file, "/keys/ca.crt");
  EXPECT_EQ(again.user, "anna");
  EXPECT_TRUE(again.password.empty());
}

TEST(LoginMemory, whatCannotBeReadChangesNothing) {
  const test::TempFolder folder;
  for (const char* text : {"", "[", "[1]", "{\"server\": 3}", "{\"user\": null}"}) {
    LoginForm form;
    recallLogin(folder.write("login.json", text), form);
    EXPECT_EQ(form.server, LoginForm{}.server) << text;
    EXPECT_TRUE(form.user.empty());
  }
  LoginForm form;
  recallLogin(folder.path() / "none", form);
  EXPECT_EQ(form.server, LoginForm{}.server);
}

}  // namespace
}  // namespace needlelab
