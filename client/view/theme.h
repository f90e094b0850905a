/// The look of every window: dark, high contrast, letters sized for the viewing distance.
#pragma once

#include <string_view>

#include <imgui/imgui.h>

#include "client/view/model/letters.h"
#include "client/view/model/palette.h"

namespace needlelab {

inline ImVec4 colourOf(Rgb colour, float opacity = 1) {
  return {colour.red, colour.green, colour.blue, opacity};
}
inline ImU32 packed(Rgb colour, float opacity = 1) {
  return ImGui::ColorConvertFloat4ToU32(colourOf(colour, opacity));
}

/// Sizes: LetterSizes; minimum angles on a station: kBodyArcmin … (model/letters.h). Text that a trainee must
/// read while holding the handle (state, time, alarm, message, verdict) uses kHeading or kFigure; kFigure
/// only has digits, signs and Latin letters.
enum class Letters : int { kBody, kSmall, kHeading, kFigure };
/// Returns a font of the current ImGui context, loaded by `Surface`.
ImFont* fontOf(Letters letters);
/// Pushes on construction, pops on destruction.
class WithFont {
 public:
  explicit WithFont(Letters letters) { ImGui::PushFont(fontOf(letters)); }
  ~WithFont() { ImGui::PopFont(); }
  WithFont(const WithFont&) = delete;
  WithFont& operator=(const WithFont&) = delete;
};
class WithTextColour {
 public:
  explicit WithTextColour(Rgb colour, float opacity = 1) {
    ImGui::PushStyleColor(ImGuiCol_Text, colourOf(colour, opacity));
  }
  ~WithTextColour() { ImGui::PopStyleColor(); }
  WithTextColour(const WithTextColour&) = delete;
  WithTextColour& operator=(const WithTextColour&) = delete;
};

/// Draws an opaque filled rectangle with sharp corners, for large areas (with llvmpipe a full screen costs
/// 0.5 ms instead of 6 ms). Later items of the list are drawn over it.
void solidRect(ImDrawList& list, ImVec2 from_px, ImVec2 to_px, Rgb colour);

/// One unit of space: half the body font's size. Use it for layout, so that font scaling keeps the
/// proportions.
float space();

/// Returns the text in the current font, cut with "…" if wider than `width_px`.
std::string fittedText(std::string_view text, float width_px);
/// Shows unformatted text; cuts it with "…" at `width_px` (0: the rest of the line) and then shows all of it
/// in a tooltip.
void textLine(std::string_view text, float width_px = 0);
/// Wrapped at the panel's edge.
void textBlock(std::string_view text);
/// Shows the sign and the text in the condition's colour: "▲ the device rests".
void conditionLine(Condition condition, std::string_view words);
/// Shows a big figure with a small unit and a caption below, legible from a distance.
void figure(std::string_view value, std::string_view unit, std::string_view caption, Rgb colour = kText);
/// Shows a key and its meaning, for the bottom of a window: "[Space] pause".
void keyHint(std::string_view key, std::string_view meaning);
/// A large button; `primary`: the most likely choice.
bool bigButton(const char* label, bool primary = false, float width_px = 0, bool enabled = true);
/// Draws a bar for 0-1 with text over it; above 1 it is full, in the trouble colour with its sign.
void levelBar(double share, std::string_view text, Rgb colour, float width_px = 0);

/// Covers the whole surface, as the root of a screen. Use ImGui as usual between beginScreen and endScreen.
void beginScreen(const char* id);
void endScreen();
/// A panel with a frame and heading; width/height in pixels, 0: the rest. Always call endPanel.
void beginPanel(const char* id, std::string_view heading, float width_px = 0, float height_px = 0);
void endPanel();

/// Sets ImGui's style, with spacing proportional to the body font. Called by `Surface`.
void applyTheme(const LetterSizes& sizes);

/// Loads the fonts of `Letters`, in that order, into the atlas of the current ImGui context. Called by
/// `Surface`. Uses DejaVu (package fonts-dejavu-core), with Greek, Cyrillic, arrows and mathematical signs;
/// without it, ImGui's own font, which only has Latin letters.
void loadFonts(const LetterSizes& sizes);

}  // namespace needlelab
