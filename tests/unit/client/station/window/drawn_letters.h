/// The text of a frame, letter by letter, with the font of each, recovered from the letters' positions in the
/// fonts' texture. Blanks are not drawn; letters that are cut off at a panel's edge do not count.
#pragma once

#include <imgui/imgui.h>

#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "client/view/theme.h"

namespace needlelab::test {

/// Of the last frame.
class DrawnLetters {
 public:
  DrawnLetters() {
    std::map<std::pair<float, float>, std::pair<Letters, const ImFontGlyph*>> places;
    for (const Letters letters : {Letters::kBody, Letters::kSmall, Letters::kHeading, Letters::kFigure})
      for (const ImFontGlyph& glyph : fontOf(letters)->Glyphs)
        if (glyph.Visible) places[{glyph.U0, glyph.V0}] = {letters, &glyph};
    const ImDrawData& data = *ImGui::GetDrawData();
    for (int i = 0; i < data.CmdListsCount; ++i) {
      const ImVector<ImDrawVert>& corners = data.CmdLists[i]->VtxBuffer;
      std::vector<ImVec4> clip(static_cast<std::size_t>(corners.Size));
      for (const ImDrawCmd& command : data.CmdLists[i]->CmdBuffer)
        for (unsigned e = command.IdxOffset; e < command.IdxOffset + command.ElemCount; ++e)
          clip[command.VtxOffset + data.CmdLists[i]->IdxBuffer[static_cast<int>(e)]] = command.ClipRect;
      for (int k = 0; k + 3 < corners.Size; ++k) {
        const auto found = places.find({corners[k].uv.x, corners[k].uv.y});
        if (found == places.end()) continue;
        const auto& [letters, glyph] = found->second;
        if (corners[k + 2].uv.x != glyph->U1 || corners[k + 2].uv.y != glyph->V1) continue;
        const ImVec4& seen = clip[static_cast<std::size_t>(k)];
        const ImVec2 low = corners[k].pos, high = corners[k + 2].pos;
        if (low.y < seen.y - 1 || high.y > seen.w + 1 || low.x < seen.x - 1 || high.x > seen.z + 1) {
          k += 3;
          continue;
        }
        const float height_px = corners[k + 2].pos.y - corners[k].pos.y;
        scaled_ = scaled_ || std::fabs(height_px - (glyph->Y1 - glyph->Y0)) > 0.01F;
        text_[letters] += letterOf(glyph->Codepoint);
        all_ += letterOf(glyph->Codepoint);
        k += 3;
      }
    }
  }

  /// All text drawn in these letters, without blanks, in the order of drawing.
  [[nodiscard]] std::string in(Letters letters) const {
    const auto found = text_.find(letters);
    return found == text_.end() ? "" : found->second;
  }
  [[nodiscard]] const std::string& all() const { return all_; }
  /// Whether a letter was drawn in a size other than its font's.
  [[nodiscard]] bool scaled() const { return scaled_; }

 private:
  static std::string letterOf(unsigned codepoint) {
    if (codepoint < 0x80) return {static_cast<char>(codepoint)};
    if (codepoint < 0x800)
      return {static_cast<char>(0xC0 | codepoint >> 6), static_cast<char>(0x80 | (codepoint & 0x3F))};
    return {static_cast<char>(0xE0 | codepoint >> 12), static_cast<char>(0x80 | (codepoint >> 6 & 0x3F)),
            static_cast<char>(0x80 | (codepoint & 0x3F))};
  }

  std::map<Letters, std::string> text_;
  std::string all_;
  bool scaled_ = false;
};

/// Upper bound of the height of a capital H over the font's size, from the font's outline drawn 1000 pixels
/// large; a partial pixel counts as one.
inline double capitalHeight(const char* font_file) {
  constexpr float kLarge_px = 1000;
  constexpr ImWchar kOnlyH[] = {'H', 'H', 0};
  ImFontAtlas atlas;
  atlas.TexDesiredWidth = 4096;  // room for so large a letter
  const ImFont* const font = atlas.AddFontFromFileTTF(font_file, kLarge_px, nullptr, kOnlyH);
  atlas.Build();
  const ImFontGlyph* const glyph = font->FindGlyph('H');
  return static_cast<double>((glyph->Y1 - glyph->Y0) / kLarge_px);
}

}  // namespace needlelab::test
