/// The letters of every window. Private to this folder.
#pragma once

namespace needlelab {

/// Fills the present ImGui context's atlas with the fonts of `Letters`, in that order, at this scale; what
/// was in it is gone. DejaVu's letters (package fonts-dejavu-core) hold Greek, Cyrillic, arrows, mathematical
/// signs; without them ImGui's own, which have Latin only.
void loadFonts(double font_scale);

}  // namespace needlelab
