#include "client/view/model/palette.h"

#include <fmt/core.h>

#include <cmath>

#include "common/profile/structure_kinds.h"

namespace needlelab {
namespace {

unsigned byteOf(float share) {
  return static_cast<unsigned>(std::lround(std::fmin(std::fmax(share, 0.0F), 1.0F) * 255.0F));
}

// sRGB to linear light (IEC 61966-2-1)
double linearLight(double share) {
  return share <= 0.04045 ? share / 12.92 : std::pow((share + 0.055) / 1.055, 2.4);
}

}  // namespace

std::string hexText(Rgb colour) {
  return fmt::format("#{:02x}{:02x}{:02x}", byteOf(colour.red), byteOf(colour.green), byteOf(colour.blue));
}

double relativeLuminance(Rgb colour) {
  return 0.2126 * linearLight(static_cast<double>(colour.red)) +
         0.7152 * linearLight(static_cast<double>(colour.green)) +
         0.0722 * linearLight(static_cast<double>(colour.blue));
}

Rgb kindColour(pb::Volume::Structure::Kind kind) {
  return rgbOf(structureKind(kind).colour);
}

Rgb hazardColour(pb::Hazard::Kind kind) {
  switch (kind) {
    case pb::Hazard::BONE:
      return rgbOf(0xD8D2C2);
    case pb::Hazard::NERVE:
      return kYellow;
    case pb::Hazard::VESSEL:
      return kVermillion;
    default:
      return kReddishPurple;
  }
}

std::string_view hazardWord(pb::Hazard::Kind kind) {
  switch (kind) {
    case pb::Hazard::BONE:
      return "bone";
    case pb::Hazard::NERVE:
      return "nerve";
    case pb::Hazard::VESSEL:
      return "vessel";
    default:
      return "structure";
  }
}

const ConditionStyle& styleOf(Condition condition) {
  static constexpr std::array<ConditionStyle, 4> kStyles = {{
      {rgbOf(0xA7B0BD), "○", "unknown"},
      {rgbOf(0x2FBF94), "●", "good"},
      {kOrange, "▲", "attention"},
      {rgbOf(0xFF7A33), "■", "trouble"},
  }};
  return kStyles[static_cast<std::size_t>(condition)];
}

Rgb phaseColour(Phase phase) {
  switch (phase) {
    case Phase::kInserting:
      return kOrange;
    case Phase::kStopped:
      return kYellow;
    case Phase::kWithdrawing:
      return kSkyBlue;
    default:
      return kDimText;
  }
}

}  // namespace needlelab
