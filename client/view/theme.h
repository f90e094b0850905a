/// The look of every window: dark, high contrast, letters as large as the person is far away.
#pragma once

#include <string_view>

#include <imgui/imgui.h>

#include "client/view/model/palette.h"
#include "client/view/model/viewing.h"

namespace needlelab {

inline ImVec4 colourOf(Rgb colour, float opacity = 1) {
  return {colour.red, colour.green, colour.blue, opacity};
}
inline ImU32 packed(Rgb colour, float opacity = 1) {
  return ImGui::ColorConvertFloat4ToU32(colourOf(colour, opacity));
}

/// Their sizes: LetterSizes; their least angles on a station: kBodyArcmin … (model/viewing.h). What a trainee
/// must read from the handle (state, time, alarm, message, verdict) is kHeading or kFigure; that has digits,
/// signs and Latin letters only.
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

/// Draws an opaque filled rectangle with sharp corners, for large areas (a full screen costs 0.5 ms instead
/// of 6 ms with llvmpipe). Later items of the list lie over it.
void solidRect(ImDrawList& list, ImVec2 from_px, ImVec2 to_px, Rgb colour);

/// One unit of space: half of the body font's size. Lay out in these units, so that font scaling keeps the
/// layout.
float space();

/// The text in the current font, cut off with "…" where it is wider than `width_px`.
std::string fittedText(std::string_view text, float width_px);
/// Shows unformatted text; cuts it off with "…" at `width_px` (0: the rest of the line) and then shows all of
/// it in a tooltip.
void textLine(std::string_view text, float width_px = 0);
/// Wrapped at the panel's edge.
void textBlock(std::string_view text);
/// Shows the sign and the text in the condition's colour: "▲ the device rests".
void conditionLine(Condition condition, std::string_view words);
/// Shows a big figure with a small unit and a caption under it, legible from afar.
void figure(std::string_view value, std::string_view unit, std::string_view caption, Rgb colour = kText);
/// Shows a key and its meaning, for the foot of a window: "[Space] pause".
void keyHint(std::string_view key, std::string_view meaning);
/// A large button; `primary`: the most likely choice.
bool bigButton(const char* label, bool primary = false, float width_px = 0, bool enabled = true);
/// Draws a bar 0-1 with text over it; above 1 it is full, in the trouble colour with its sign.
void levelBar(double share, std::string_view text, Rgb colour, float width_px = 0);

/// Covers the whole surface: the root of a screen. Between beginScreen and endScreen use ImGui as usual.
void beginScreen(const char* id);
void endScreen();
/// A panel with a frame and heading; width/height in pixels, 0: the rest. Always call endPanel.
void beginPanel(const char* id, std::string_view heading, float width_px = 0, float height_px = 0);
void endPanel();

/// Sets ImGui's style, its spaces in proportion to the body font; called by `Surface`.
void applyTheme(const LetterSizes& sizes);

/// Fills the atlas of the current ImGui context with the fonts of `Letters`, in that order; called by
/// `Surface`. Uses DejaVu (package fonts-dejavu-core), with Greek, Cyrillic, arrows and
/// mathematical signs; without it, ImGui's own font, which has only Latin letters.
void loadFonts(const LetterSizes& sizes);

}  // namespace needlelab
