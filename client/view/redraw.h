/// Whether a frame has to be drawn at all. Private to this folder.
#pragma once

#include <cstdint>

namespace needlelab {

/// A texture that frames may show has other pixels now. Thread: the surface's.
void noteTextureChange();
/// How often that happened.
std::uint64_t textureChanges();

/// Something of the frame under way that ImGui's lists do not hold, such as what a callback draws.
void noteContent(std::uint64_t word);
/// All that was noted since the last call, as one number.
std::uint64_t takeContent();

}  // namespace needlelab
