/// A picture on the graphics side that can be drawn into. Private to this folder.
#pragma once

#include <cstdint>

#include "client/view/model/image.h"

namespace needlelab {

/// Pixels of a picture, counted from its lower left corner as OpenGL does; empty where width or height is not
/// positive.
struct PixelRect {
  int x = 0, y = 0, width = 0, height = 0;
  [[nodiscard]] bool empty() const { return width <= 0 || height <= 0; }
};
/// The smallest that holds both.
PixelRect joined(PixelRect a, PixelRect b);

/// Colour (RGBA8) and depth, with several samples a pixel if wished; `resolve` makes one of them. Needs the
/// context for its whole life.
class FrameBuffer {
 public:
  explicit FrameBuffer(int samples = 1) : samples_(samples) {}
  ~FrameBuffer();
  FrameBuffer(const FrameBuffer&) = delete;
  FrameBuffer& operator=(const FrameBuffer&) = delete;

  /// Bound for drawing, with its viewport; made anew where the size is another.
  void bind(int width, int height);
  /// Takes colour and depth of a part of `other`, which has the same size and samples.
  void copyFrom(const FrameBuffer& other, PixelRect part);
  /// After drawing: the texture holds the picture, or the part of it that was drawn.
  void resolve();
  void resolve(PixelRect part);
  /// Onto whatever is bound for drawing, lower left corner at x, y; what is scissored is kept.
  void showAt(int x, int y) const;
  [[nodiscard]] PixelRect whole() const { return {0, 0, width_, height_}; }
  [[nodiscard]] unsigned texture() const { return texture_; }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  /// Rows from top to bottom.
  [[nodiscard]] RgbaImage read();

 private:
  void drop();
  int samples_;
  int width_ = 0, height_ = 0;
  unsigned texture_ = 0, resolved_ = 0;          // what is shown, and the buffer that holds it
  unsigned drawn_ = 0, colour_ = 0, depth_ = 0;  // with several samples: drawn into, then resolved
};

}  // namespace needlelab
