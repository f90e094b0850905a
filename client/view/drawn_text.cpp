#include "client/view/drawn_text.h"

#include <imgui/imgui.h>

#include <cmath>
#include <map>
#include <utility>

namespace needlelab {
namespace {

constexpr float kBlank = 0.5F, kFarther = 3;  // of a blank's width: there is one; another text begins

void append(std::string& text, unsigned codepoint) {
  const auto byte = [&](unsigned value) { text += static_cast<char>(value); };
  if (codepoint < 0x80) return byte(codepoint);
  if (codepoint < 0x800) {
    byte(0xC0 | codepoint >> 6);
  } else {
    byte(0xE0 | codepoint >> 12);
    byte(0x80 | (codepoint >> 6 & 0x3F));
  }
  byte(0x80 | (codepoint & 0x3F));
}

}  // namespace

std::vector<DrawnLine> drawnText() {
  struct Place {
    Letters letters;
    const ImFontGlyph* glyph;
    float blank_px;
  };
  std::map<std::pair<float, float>, Place> places;  // in the fonts' texture
  for (const Letters letters : {Letters::kBody, Letters::kSmall, Letters::kHeading, Letters::kFigure}) {
    const ImFont& font = *fontOf(letters);
    const ImFontGlyph* const blank = font.FindGlyph(' ');
    for (const ImFontGlyph& glyph : font.Glyphs)
      if (glyph.Visible) places[{glyph.U0, glyph.V0}] = {letters, &glyph, blank->AdvanceX};
  }
  std::vector<DrawnLine> lines;
  const ImDrawData& data = *ImGui::GetDrawData();
  for (int i = 0; i < data.CmdListsCount; ++i) {
    float end_px = 0, top_px = 0;
    bool follows = false;
    const ImDrawList& list = *data.CmdLists[i];
    const ImVector<ImDrawVert>& corners = list.VtxBuffer;
    std::vector<ImVec4> clip(static_cast<std::size_t>(corners.Size));
    for (const ImDrawCmd& command : list.CmdBuffer)
      for (unsigned e = command.IdxOffset; e < command.IdxOffset + command.ElemCount; ++e)
        clip[command.VtxOffset + list.IdxBuffer[static_cast<int>(e)]] = command.ClipRect;
    for (int k = 0; k + 3 < corners.Size; ++k) {
      const auto found = places.find({corners[k].uv.x, corners[k].uv.y});
      if (found == places.end()) continue;
      const auto& [letters, glyph, blank_px] = found->second;
      if (corners[k + 2].uv.x != glyph->U1 || corners[k + 2].uv.y != glyph->V1) continue;
      const ImVec2 low = corners[k].pos, high = corners[k + 2].pos;
      const ImVec4& seen = clip[static_cast<std::size_t>(k)];
      k += 3;
      // a pixel may stick out
      if (low.y < seen.y - 1 || high.y > seen.w + 1 || low.x < seen.x - 1 || high.x > seen.z + 1) continue;
      const float x_px = low.x - glyph->X0, y_px = low.y - glyph->Y0;
      const float gap_px = x_px - end_px;
      if (!follows || lines.back().letters != letters || std::fabs(y_px - top_px) > 1 || gap_px < -blank_px ||
          gap_px > kFarther * blank_px)
        lines.push_back({letters, "", false});
      else if (gap_px > kBlank * blank_px)
        lines.back().text += ' ';
      append(lines.back().text, glyph->Codepoint);
      const float height_px = high.y - low.y;
      lines.back().scaled = lines.back().scaled || std::fabs(height_px - (glyph->Y1 - glyph->Y0)) > 0.01F;
      end_px = x_px + glyph->AdvanceX, top_px = y_px, follows = true;
    }
  }
  return lines;
}

}  // namespace needlelab
