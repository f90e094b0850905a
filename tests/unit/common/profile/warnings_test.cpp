#include <gmock/gmock.h>

#include "common/profile/profile.h"
#include "tests/unit/common/profile/good_profile.h"

namespace needlelab {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::string> warningsWith(const std::vector<std::pair<std::string, std::string>>& changes) {
  std::string text = kGoodProfile;
  for (const auto& [pointer, value] : changes) text = mutated(text, pointer, value);
  const auto profile = parseProfile(text, "p");
  EXPECT_TRUE(profile.ok()) << (profile.ok() ? "" : profile.error().message);
  return profile.ok() ? profileWarnings(*profile) : std::vector<std::string>{"not valid"};
}

TEST(Fidelity, isTheShareOfTheLayerWithTheRightForce) {
  // 0 to 1 N at 500 N/m: within 10 % of 1 N after 0.9 N / 500 N/m = 1.8 mm, of a layer of 3.6 mm half is left
  EXPECT_DOUBLE_EQ(fidelity(0, 1, 500, 0.0036), 0.5);
  EXPECT_DOUBLE_EQ(fidelity(0, 1, 500, 0.018), 0.9);
  // 1 to 2 N: within 0.2 N of 2 N after 0.8 N
  EXPECT_DOUBLE_EQ(fidelity(1, 2, 500, 0.0032), 0.5);
  EXPECT_EQ(fidelity(0, 1, 500, 0.0018), 0);
  EXPECT_EQ(fidelity(0, 1, 500, 0.0001), 0) << "never negative";
  EXPECT_EQ(fidelity(2, 1, 500, 0.0001), 1) << "a falling force needs no way";
  EXPECT_EQ(fidelity(1, 1.05, 500, 0.0001), 1) << "a rise that nobody notices";
  EXPECT_EQ(fidelity(0, 0, 500, 0.0001), 1);
}

TEST(ProfileWarnings, aThinLayerIsToldWithItsNumbers) {
  // the skin of 3 mm has fidelity 1 − 0.9/1.5 = 0.4
  EXPECT_THAT(warningsWith({}),
              ElementsAre(AllOf(HasSubstr("layers[0] (SKIN, 3 mm)"), HasSubstr("fidelity 0.4"),
                                HasSubstr("from 0 to 1 N"), HasSubstr("500 N/m needs 2 mm"))));
  EXPECT_THAT(warningsWith({{"/layers/0/thickness_m", "0.0036"}}), IsEmpty()) << "0.5 is enough";
  EXPECT_THAT(warningsWith({{"/layers/0/thickness_m", "0.0035"}}), ElementsAre(HasSubstr("layers[0]")));
}

TEST(ProfileWarnings, aFallingStepMayBeThin) {
  EXPECT_THAT(warningsWith({{"/layers/0/thickness_m", "0.004"},
                            {"/layers/1/cutting_force_n", "0.5"},
                            {"/layers/1/thickness_m", "0.0001"}}),
              IsEmpty());
}

TEST(ProfileWarnings, withoutCuttingNoLayerIsTooThin) {
  EXPECT_THAT(warningsWith({{"/effects", R"(["PUNCTURE"])"}}), IsEmpty());
}

TEST(ProfileWarnings, aMembraneThatRupturesBelowItsLayerIsTold) {
  const std::pair<std::string, std::string> thick{"/layers/0/thickness_m", "0.004"};
  // 100 N/m alone reaches 0.6 N at 6 mm, in a layer of 4 mm
  const std::pair<std::string, std::string> soft{
      "/layers/0/puncture", R"({"linear_n_per_m": 100, "quadratic_n_per_m2": 0, "force_n": 0.6})"};
  EXPECT_THAT(warningsWith({thick, soft}), ElementsAre(AllOf(HasSubstr("layers[0] (SKIN, 4 mm)"),
                                                             HasSubstr("0.6 N"), HasSubstr("6 mm deep"))));
  // 100 z + 12500 z² = 0.6 at exactly 4 mm: not deeper than the layer, thickened by a hair
  const std::pair<std::string, std::string> just{
      "/layers/0/puncture", R"({"linear_n_per_m": 100, "quadratic_n_per_m2": 12500, "force_n": 0.6})"};
  EXPECT_THAT(warningsWith({{"/layers/0/thickness_m", "0.00400001"}, just}), IsEmpty());
  EXPECT_THAT(warningsWith({{"/layers/0/thickness_m", "0.00399999"}, just}),
              ElementsAre(HasSubstr("4 mm deep")));
  // not listed, not told
  EXPECT_THAT(warningsWith({thick, soft, {"/effects", R"(["CUTTING"])"}}), IsEmpty());
}

}  // namespace
}  // namespace needlelab
