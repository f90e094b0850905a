/// The text of a frame without its blanks, by font.
#pragma once

#include <imgui/imgui.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <string>

#include "client/view/drawn_text.h"

namespace needlelab::test {

/// Of the last frame.
class DrawnLetters {
 public:
  DrawnLetters() {
    for (const DrawnLine& line : drawnText()) {
      std::string letters;
      std::ranges::copy_if(line.text, std::back_inserter(letters), [](char c) { return c != ' '; });
      text_[line.letters] += letters;
      all_ += letters;
      scaled_ = scaled_ || line.scaled;
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
