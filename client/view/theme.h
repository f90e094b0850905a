/// The look of every window: dark, high contrast, letters that can be read from two metres.
#pragma once

#include <string_view>

#include <imgui/imgui.h>

#include "client/view/model/palette.h"

namespace needlelab {

inline ImVec4 colourOf(Rgb colour, float opacity = 1) {
  return {colour.red, colour.green, colour.blue, opacity};
}
inline ImU32 packed(Rgb colour, float opacity = 1) {
  return ImGui::ColorConvertFloat4ToU32(colourOf(colour, opacity));
}

/// Sizes at font scale 1, in pixels of a 720-pixel window: body 18, small 15, heading 24, figure 44 (digits,
/// signs and Latin letters only).
enum class Letters : int { kBody, kSmall, kHeading, kFigure };
/// Of the present ImGui context, as `Surface` loaded them.
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

/// A filled rectangle with sharp corners, opaque: for large areas (a full screen costs 0.5 ms in place of 6
/// with llvmpipe). What the list draws later lies over it.
void solidRect(ImDrawList& list, ImVec2 from_px, ImVec2 to_px, Rgb colour);

/// One unit of space: half of the body font's size. Lay out in these, so that font scaling keeps its shape.
float space();

/// Text without printf, cut off with "…" where it is wider than `width_px` (0: the rest of the line); then
/// the whole is a tooltip.
void textLine(std::string_view text, float width_px = 0);
/// Wrapped at the panel's edge.
void textBlock(std::string_view text);
/// The sign and the text in the condition's colour: "▲ the device rests".
void conditionLine(Condition condition, std::string_view words);
/// A big figure with a small unit and a caption under it, to be read from afar.
void figure(std::string_view value, std::string_view unit, std::string_view caption, Rgb colour = kText);
/// A key and its meaning, for the foot of a window: "[Space] pause".
void keyHint(std::string_view key, std::string_view meaning);
/// A large button; `primary`: the one that most people want now.
bool bigButton(const char* label, bool primary = false, float width_px = 0, bool enabled = true);
/// A bar 0-1 with text over it; beyond 1 it is full and in the trouble colour with its sign.
void levelBar(double share, std::string_view text, Rgb colour, float width_px = 0);

/// Covers the whole surface: the root of a screen. Between beginScreen and endScreen use ImGui as usual.
void beginScreen(const char* id);
void endScreen();
/// A panel with a frame and heading; width/height in pixels, 0: the rest. Always end it.
void beginPanel(const char* id, std::string_view heading, float width_px = 0, float height_px = 0);
void endPanel();

/// Sets ImGui's style; called by `Surface`.
void applyTheme(double font_scale);

/// Fills the atlas of the current ImGui context with the fonts of `Letters`, in that order, at this scale;
/// called by `Surface`. The fonts are DejaVu's (package fonts-dejavu-core), with Greek, Cyrillic, arrows and
/// mathematical signs; without them ImGui's own font, which has Latin letters only.
void loadFonts(double font_scale);

}  // namespace needlelab
