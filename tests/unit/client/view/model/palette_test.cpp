#include "client/view/model/palette.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/phase_words.h"

namespace needlelab {
namespace {

double contrast(Rgb a, Rgb b) {
  const double la = relativeLuminance(a), lb = relativeLuminance(b);
  return (std::max(la, lb) + 0.05) / (std::min(la, lb) + 0.05);
}

// Simulates a dichromat's view: Viénot, Brettel and Mollon 1999, in linear light.
Rgb seenBy(Rgb colour, bool protanope) {
  const auto linear = [](float v) { return std::pow(static_cast<double>(v), 2.2); };
  const double r = linear(colour.red), g = linear(colour.green), b = linear(colour.blue);
  const double red = protanope ? 0.112 * r + 0.888 * g : 0.293 * r + 0.707 * g;
  const double green = protanope ? 0.112 * r + 0.888 * g : 0.293 * r + 0.707 * g;
  const double blue = protanope ? 0.004 * r - 0.004 * g + b : -0.021 * r + 0.021 * g + b;
  const auto back = [](double v) { return static_cast<float>(std::pow(std::clamp(v, 0.0, 1.0), 1 / 2.2)); };
  return {back(red), back(green), back(blue)};
}

double distance(Rgb a, Rgb b) {
  return std::hypot(static_cast<double>(a.red - b.red), static_cast<double>(a.green - b.green),
                    static_cast<double>(a.blue - b.blue));
}

TEST(Palette, hexAndLuminanceAreThoseOfTheStandard) {
  EXPECT_EQ(hexText(kVermillion), "#d55e00");
  EXPECT_EQ(hexText({2, -1, 0.5F}), "#ff0080");
  EXPECT_DOUBLE_EQ(relativeLuminance(kBlack), 0);
  EXPECT_NEAR(relativeLuminance(kWhite), 1, 1e-12);
  EXPECT_NEAR(relativeLuminance(rgbOf(0x808080)), 0.2159, 1e-4);  // WCAG's own value for mid-grey
}

TEST(Palette, lettersStandOutFromTheirGround) {
  for (const Rgb ground : {kWindowGrey, kPanelGrey}) {
    EXPECT_GT(contrast(kText, ground), 12);
    EXPECT_GT(contrast(kDimText, ground), 7);  // WCAG AAA
    for (const Condition condition :
         {Condition::kUnknown, Condition::kGood, Condition::kAttention, Condition::kTrouble})
      EXPECT_GT(contrast(styleOf(condition).colour, ground), 4.5);
    for (const EffectEntry* effect : effectsAsShown())
      EXPECT_GT(contrast(colourOf(*effect), ground), 3) << effect->name;
  }
}

TEST(Palette, dichromatsCanTellForcePartsApart) {
  for (const bool protanope : {false, true})
    for (const EffectEntry* one : effectsAsShown())
      for (const EffectEntry* other : effectsAsShown()) {
        if (one->place >= other->place) continue;
        EXPECT_GT(distance(seenBy(colourOf(*one), protanope), seenBy(colourOf(*other), protanope)), 0.1)
            << one->name << " and " << other->name;
      }
}

TEST(Palette, thePlannedLineHasItsOwnColour) {
  std::vector<Rgb> others = {kYellow,
                             kBluishGreen,
                             kReddishPurple,
                             kSkyBlue,
                             kOrange,
                             kTipColour,
                             kWallColour,
                             kTargetColour,
                             kPanelGrey,
                             kWindowGrey,
                             kFirstGesture,
                             kSecondGesture,
                             styleOf(Condition::kAttention).colour};
  for (const EffectEntry* effect : effectsAsShown()) others.push_back(colourOf(*effect));
  for (const auto kind : {pb::Hazard::OTHER, pb::Hazard::BONE, pb::Hazard::NERVE, pb::Hazard::VESSEL})
    others.push_back(hazardColour(kind));
  for (const Rgb other : others) {
    EXPECT_GT(distance(kPlanColour, other), 0.2) << hexText(other);
    for (const bool protanope : {false, true})
      EXPECT_GT(distance(seenBy(kPlanColour, protanope), seenBy(other, protanope)), 0.2) << hexText(other);
  }
  EXPECT_GT(contrast(kPlanColour, kPanelGrey), 3);
}

TEST(Palette, nothingIsConveyedByColourAlone) {
  std::set<std::string_view> signs, words;
  for (const Condition condition :
       {Condition::kUnknown, Condition::kGood, Condition::kAttention, Condition::kTrouble}) {
    signs.insert(styleOf(condition).sign);
    words.insert(styleOf(condition).word);
  }
  EXPECT_EQ(signs.size(), 4u);
  EXPECT_EQ(words.size(), 4u);
  std::set<std::string_view> phases;
  for (const Phase phase : {Phase::kFree, Phase::kInserting, Phase::kStopped, Phase::kWithdrawing})
    phases.insert(phaseWord(phase));
  EXPECT_EQ(phases.size(), 4u);
  EXPECT_EQ(hazardWord(pb::Hazard::NERVE), "nerve");
}

TEST(Palette, neighbouringTissuesOfTheSamplesDifferInLightness) {
  using Structure = pb::Volume::Structure;
  const Structure::Kind pairs[][2] = {
      {Structure::SKIN, Structure::FAT},         {Structure::FAT, Structure::MUSCLE},
      {Structure::MUSCLE, Structure::BURSA},     {Structure::BURSA, Structure::TENDON},
      {Structure::TENDON, Structure::CARTILAGE}, {Structure::CARTILAGE, Structure::BONE},
      {Structure::MUSCLE, Structure::CAPSULE},   {Structure::OTHER, Structure::BONE}};
  for (const auto& pair : pairs)
    EXPECT_GT(contrast(kindColour(pair[0]), kindColour(pair[1])), 1.25)
        << Structure::Kind_Name(pair[0]) << " and " << Structure::Kind_Name(pair[1]);
}

}  // namespace
}  // namespace needlelab
