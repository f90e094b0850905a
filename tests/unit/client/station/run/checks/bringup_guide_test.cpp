/// Checks deploy/BRINGUP.md against the program's messages and options.

#include <gmock/gmock.h>

#include <algorithm>
#include <set>

#include "client/station/run/checks/self_test.h"
#include "client/station/run/io/options.h"
#include "common/base/files/files.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

std::string guide() {
  auto text = readWholeFile(NEEDLELAB_GUIDE);
  EXPECT_TRUE(text.ok());
  return text.ok() ? *text : std::string();
}

TEST(BringupGuide, everyFaultIsInItsTableInTheProgramsWords) {
  const std::string text = guide();
  int faults = 0;
  for (int value = 1; value < 256; ++value) {
    const std::string words = faultText(static_cast<Fault>(value));
    if (words == "unknown fault") break;
    EXPECT_THAT(text, HasSubstr("\n| " + words + " | ")) << "fault " << value;
    ++faults;
  }
  EXPECT_GE(faults, 11);
}

TEST(BringupGuide, everyDeviceConditionIsInItsTable) {
  const std::string text = guide();
  std::uint32_t seen = 0;
  for (const ConditionText& words : conditionTexts()) {
    EXPECT_THAT(text, HasSubstr("\n| " + std::string(words.found) + " | "));
    seen |= words.flag;
  }
  EXPECT_EQ(seen, kDeviceFlags);
}

TEST(BringupGuide, namesNoOptionThatDoesNotExist) {
  testing::internal::CaptureStdout();
  const char* arguments[] = {"needlelab-station", "--help"};
  static_cast<void>(parseStationOptions(2, arguments));
  const std::string help = testing::internal::GetCapturedStdout();
  // options of other programs in the same text
  const std::set<std::string> others = {"--preset", "--build", "--remove", "--demo", "--role"};
  const std::string text = guide();
  constexpr const char* kLetters = "abcdefghijklmnopqrstuvwxyz";
  std::set<std::string> named;
  for (auto at = text.find("--"); at != std::string::npos; at = text.find("--", at + 2)) {
    const std::size_t end =
        std::min(text.size(), text.find_first_not_of(std::string(kLetters) + "-", at + 2));
    if (end > at + 3 && text[at + 2] != '-') named.insert(text.substr(at, end - at));
  }
  EXPECT_GE(named.size(), 10u);
  for (const std::string& name : named)
    if (!others.contains(name)) {
      EXPECT_THAT(help, HasSubstr(name + " "));
    }
}

}  // namespace
}  // namespace needlelab
