#include "client/view/fonts.h"

#include <imgui/imgui.h>

#include <filesystem>

#include "client/view/theme.h"

namespace needlelab {
namespace {

constexpr const char* kFontFolder = "/usr/share/fonts/truetype/dejavu/";

// names of people and of tissues in Europe's letters, and all the signs that the windows use
constexpr ImWchar kTextRanges[] = {0x0020, 0x024F, 0x0370, 0x03FF, 0x0400, 0x045F, 0x2010, 0x2027, 0x2030,
                                   0x205E, 0x2070, 0x209C, 0x20AC, 0x20AC, 0x2190, 0x21FF, 0x2200, 0x22FF,
                                   0x23E9, 0x23FA, 0x25A0, 0x25FF, 0x2600, 0x26FF, 0x2700, 0x27BF, 0};
// the largest letters are few: figures and units
constexpr ImWchar kFigureRanges[] = {0x0020, 0x00FF, 0x03B1, 0x03C9, 0x2010, 0x2026, 0x2190,
                                     0x2193, 0x2212, 0x2212, 0x221E, 0x221E, 0x25A0, 0x25CF,
                                     0x26A0, 0x26A0, 0x2713, 0x2718, 0};

void addFont(const char* file, float size_px, const ImWchar* ranges) {
  ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  ImFontConfig config;
  // two pixels across are enough for letters of this size, and halve the atlas
  config.OversampleH = size_px > 30 ? 1 : 2;
  config.OversampleV = 1;
  config.PixelSnapH = true;
  const std::filesystem::path path = std::filesystem::path(kFontFolder) / file;
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored) ||
      atlas.AddFontFromFileTTF(path.c_str(), size_px, &config, ranges) == nullptr) {
    ImFontConfig own;
    own.SizePixels = size_px;
    atlas.AddFontDefault(&own);
  }
}

}  // namespace

void loadFonts(double font_scale) {
  ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  atlas.Clear();
  atlas.Flags |= ImFontAtlasFlags_NoPowerOfTwoHeight;
  atlas.TexDesiredWidth = 4096;
  const auto scale = static_cast<float>(font_scale);
  addFont("DejaVuSans.ttf", 18 * scale, kTextRanges);
  addFont("DejaVuSans.ttf", 15 * scale, kTextRanges);
  addFont("DejaVuSans-Bold.ttf", 24 * scale, kTextRanges);
  addFont("DejaVuSans-Bold.ttf", 44 * scale, kFigureRanges);
}

ImFont* fontOf(Letters letters) {
  ImVector<ImFont*>& fonts = ImGui::GetIO().Fonts->Fonts;
  const int index = static_cast<int>(letters);
  return index < fonts.Size ? fonts[index] : ImGui::GetFont();
}

}  // namespace needlelab
