/// One colour *and* one word or sign for each tissue, effect, hazard and state, the same in all windows,
/// plots and reports. Based on Okabe and Ito's colours, which colour-blind people can distinguish; colour
/// alone never conveys meaning.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/sim_state.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// sRGB, 0-1 each.
struct Rgb {
  float red = 0, green = 0, blue = 0;
  friend constexpr bool operator==(const Rgb&, const Rgb&) = default;
};
/// From 0xRRGGBB.
constexpr Rgb rgbOf(std::uint32_t hex) {
  return {static_cast<float>((hex >> 16) & 255u) / 255.0F, static_cast<float>((hex >> 8) & 255u) / 255.0F,
          static_cast<float>(hex & 255u) / 255.0F};
}
/// "#rrggbb", for HTML and SVG.
std::string hexText(Rgb colour);
/// Mixes `share` (0-1) of `b` into `a`.
constexpr Rgb mixed(Rgb a, Rgb b, float share) {
  return {a.red + (b.red - a.red) * share, a.green + (b.green - a.green) * share,
          a.blue + (b.blue - a.blue) * share};
}
/// WCAG's relative luminance, 0 (black) to 1 (white); contrast is (L1 + 0.05)/(L2 + 0.05).
double relativeLuminance(Rgb colour);

// Okabe and Ito (2008)
inline constexpr Rgb kOrange = rgbOf(0xE69F00), kSkyBlue = rgbOf(0x56B4E9), kBluishGreen = rgbOf(0x009E73),
                     kYellow = rgbOf(0xF0E442), kBlue = rgbOf(0x0072B2), kVermillion = rgbOf(0xD55E00),
                     kReddishPurple = rgbOf(0xCC79A7), kWhite = rgbOf(0xFFFFFF), kBlack = rgbOf(0x000000);
// the dark theme's greys
inline constexpr Rgb kWindowGrey = rgbOf(0x14171C), kPanelGrey = rgbOf(0x1D2128), kLineGrey = rgbOf(0x3A414C),
                     kDimText = rgbOf(0xA7B0BD), kText = rgbOf(0xF2F4F7);

/// Colour of a layer or structure in the section; a body's muscles have several (layerColours). Neighbours
/// differ in lightness as well as hue.
Rgb kindColour(pb::Volume::Structure::Kind kind);

Rgb hazardColour(pb::Hazard::Kind kind);
/// "bone", "nerve", "vessel", "structure".
std::string_view hazardWord(pb::Hazard::Kind kind);

/// Colour of an effect's term, in every plot and picture.
inline Rgb colourOf(const EffectEntry& effect) {
  return rgbOf(effect.colour);
}

/// A condition, from calm to urgent.
enum class Condition : std::uint8_t { kUnknown, kGood, kAttention, kTrouble };
struct ConditionStyle {
  Rgb colour;
  std::string_view sign;  ///< UTF-8, one glyph with a distinct shape: ○ ● ▲ ■
  std::string_view word;  ///< "unknown", "good", "attention", "trouble"
};
const ConditionStyle& styleOf(Condition condition);

Rgb phaseColour(Phase phase);

/// Colours of the world's axes x y z, in plots of places and of the orientation mark.
inline constexpr std::array<Rgb, 3> kAxisColours = {kVermillion, kBluishGreen, kSkyBlue};
/// Colours of the tip, the wall, the target, and two compared gestures.
inline constexpr Rgb kTipColour = kWhite, kWallColour = kYellow, kTargetColour = kBluishGreen,
                     kFirstGesture = kSkyBlue, kSecondGesture = kOrange;
/// Colour of the planned line; not used for anything else.
inline constexpr Rgb kPlanColour = rgbOf(0x7C6CFF);

}  // namespace needlelab
