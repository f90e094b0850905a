// The needle's section of a profile.

#include <gmock/gmock.h>

#include "common/profile/profile.h"
#include "tests/unit/common/profile/good_profile.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

Result<pb::Profile> withNeedle(const std::string& needle) {
  auto tree = nlohmann::json::parse(kGoodProfile);
  tree["needle"] = nlohmann::json::parse(needle);
  return parseProfile(tree.dump(), "p.json");
}

TEST(NeedleSection, isReadAsWritten) {
  const auto profile =
      withNeedle(R"({"length_m": 0.09, "gauge": 18, "outer_diameter_m": 0.00127, "tip": "TUOHY",
                     "bevel_angle_rad": 0.4})");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const NeedleSpec needle = needleOf(profile->needle());
  EXPECT_EQ(needle.length_m, 0.09);
  EXPECT_EQ(needle.outer_diameter_m, 0.00127) << "the measured one counts";
  EXPECT_EQ(needle.tip, NeedleTip::kTuohy);
  EXPECT_EQ(needle.bevel_angle_rad, 0.4);
  EXPECT_THAT(profileJson(*profile), HasSubstr("\"needle\": {\"length_m\": 0.09, \"gauge\": 18, "
                                               "\"outer_diameter_m\": 0.00127, \"tip\": \"TUOHY\", "
                                               "\"bevel_angle_rad\": 0.4}"));
  const auto again = parseProfile(profileJson(*profile), "again");
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(profileJson(*again), profileJson(*profile));
}

TEST(NeedleSection, ofAnOlderProfileIsWrittenAsBefore) {
  const auto profile = withNeedle(R"({"length_m": 0.06})");
  ASSERT_TRUE(profile.ok());
  EXPECT_THAT(profileJson(*profile), HasSubstr("\"needle\": {\"length_m\": 0.06},"));
  EXPECT_EQ(needleOf(profile->needle()).outer_diameter_m, 0);
  EXPECT_EQ(openingBehindTip_m(needleOf(profile->needle())), 0);
  EXPECT_EQ(sceneSpecOf(*profile)->needle_diameter_m, 0);
}

TEST(NeedleSection, aGaugeGivesTheDiameter) {
  const auto profile = withNeedle(R"({"length_m": 0.06, "gauge": 22})");
  ASSERT_TRUE(profile.ok());
  EXPECT_EQ(needleOf(profile->needle()).outer_diameter_m, 0.0007);
  EXPECT_EQ(sceneSpecOf(*profile)->needle_diameter_m, 0.0007);
}

TEST(NeedleSection, whatContradictsItselfIsRefusedWithTheNumbers) {
  const struct {
    const char *needle, *expected;
  } cases[] = {
      {R"({"length_m": 0.06, "gauge": 22, "outer_diameter_m": 0.0012})",
       "needle.outer_diameter_m: 0.0012 contradicts gauge 22, which is 7e-04 (allowed is 0.000644 to "
       "0.000756)"},
      {R"({"length_m": 0.06, "gauge": 9})", "needle.gauge: 9 is out of range [10, 34]"},
      {R"({"length_m": 0.06, "gauge": 22.5})", "needle.gauge"},
      {R"({"length_m": 0.06, "outer_diameter_m": 0.02})", "needle.outer_diameter_m: 0.02 is out of range"},
      {R"({"length_m": 0.06, "tip": "BLUNT"})", "needle.tip"},
      {R"({"length_m": 0.06, "tip": "TIP_UNSPECIFIED"})", "needle.tip"},
      {R"({"length_m": 0.06, "bevel_angle_rad": 0})", "needle.bevel_angle_rad: 0 is out of range"},
      {R"({"length_m": 0.06, "bevel_angle_rad": 1.6})", "needle.bevel_angle_rad: 1.6 is out of range"},
      {R"({"length_m": 0.02, "gauge": 10, "bevel_angle_rad": 0.1})",
       "needle.bevel_angle_rad: at 0.1 rad a tip of 3.4 mm diameter is 33.9 mm long, the whole needle 20 mm"},
  };
  for (const auto& c : cases) {
    const auto profile = withNeedle(c.needle);
    ASSERT_FALSE(profile.ok()) << c.needle;
    EXPECT_EQ(profile.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(profile.error().message, HasSubstr(c.expected));
  }
}

TEST(NeedleSection, realTubesOfAGaugeAreTaken) {
  // outer diameters as makers state them, by wire gauge, beside the metric sizes of ISO 9626
  const struct {
    int gauge;
    const char* diameter_m;
  } tubes[] = {{16, "0.001651"},  {17, "0.001473"},  {18, "0.00127"},   {19, "0.001067"},
               {20, "0.0009081"}, {21, "0.0008192"}, {22, "0.0007176"}, {23, "0.0006414"},
               {25, "0.0005144"}, {27, "0.0004128"}, {30, "0.0003112"}};
  for (const auto& tube : tubes) {
    const auto profile = withNeedle("{\"length_m\": 0.06, \"gauge\": " + std::to_string(tube.gauge) +
                                    ", \"outer_diameter_m\": " + tube.diameter_m + "}");
    EXPECT_TRUE(profile.ok()) << profile.error().message;
  }
}

TEST(NeedleSection, aTipOfUnknownSizeIsTold) {
  const auto told = withNeedle(R"({"length_m": 0.06, "tip": "QUINCKE"})");
  ASSERT_TRUE(told.ok());
  const auto plain = withNeedle(R"({"length_m": 0.06, "tip": "QUINCKE", "gauge": 22})");
  ASSERT_TRUE(plain.ok());
  EXPECT_EQ(profileWarnings(*told).size(), profileWarnings(*plain).size() + 1);
  EXPECT_THAT(profileWarnings(*told).front(), HasSubstr("neither gauge nor outer_diameter_m"));
}

}  // namespace
}  // namespace needlelab
