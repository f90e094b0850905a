/// How large letters must be on a screen that is read from a distance.
#pragma once

namespace needlelab {

inline constexpr double kInch_m = 0.0254;

/// Size and distance of a screen: a setting of the station.
struct Viewing {
  double diagonal_m = 24 * kInch_m;  ///< of the visible area; kMinDiagonal_m to kMaxDiagonal_m
  double distance_m = 2;             ///< from the eyes; kMinDistance_m to kMaxDistance_m
};
inline constexpr double kMinDiagonal_m = 10 * kInch_m, kMaxDiagonal_m = 120 * kInch_m;
inline constexpr double kMinDistance_m = 0.3, kMaxDistance_m = 6;

/// Font sizes in pixels as in Dear ImGui: ascent plus descent. The defaults are for a desk, in a window of
/// 720 pixels.
struct LetterSizes {
  double body_px = 18, small_px = 15, heading_px = 24, figure_px = 44;
  friend bool operator==(const LetterSizes&, const LetterSizes&) = default;
};

/// Height of a capital H relative to the font size: 1493 of 1901 + 483 units in DejaVu Sans, regular and
/// bold.
inline constexpr double kCapitalHeight = 1493.0 / (1901 + 483);

/// Minimum heights of a capital letter without accent, in minutes of arc (character height of ISO
/// 9241-303:2011: at least 16, preferably 20 to 22; less only for text incidental to the task).
inline constexpr double kFigureArcmin = 20;   ///< Letters::kFigure: force, insertion
inline constexpr double kHeadingArcmin = 16;  ///< Letters::kHeading: state, time, alarm, message, verdict
inline constexpr double kBodyArcmin = 10.5;   ///< Letters::kBody: the rest …
inline constexpr double kSmallArcmin = 10;    ///< Letters::kSmall: … and captions

/// Angle of one pixel in the middle of a screen with this resolution, in minutes of arc. Pixels are square.
double arcminPerPixel(const Viewing& viewing, int width_px, int height_px);

/// The smallest integer sizes with these angles in a window of this size that fills the monitor, times
/// `scale` (the user's choice); never a smaller fraction of the window's height than on a desk.
LetterSizes letterSizes(const Viewing& viewing, int width_px, int height_px, double scale = 1);

/// The fraction of the window's height taken by headings on a 16:9 monitor; screens are laid out for at most
/// kMaxHeadingShare.
double headingShare(const Viewing& viewing);
inline constexpr double kMaxHeadingShare = 0.053;

}  // namespace needlelab
