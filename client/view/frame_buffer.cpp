#include "client/view/frame_buffer.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cstring>

namespace needlelab {

PixelRect joined(PixelRect a, PixelRect b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  const int x = std::min(a.x, b.x), y = std::min(a.y, b.y);
  return {x, y, std::max(a.x + a.width, b.x + b.width) - x, std::max(a.y + a.height, b.y + b.height) - y};
}

FrameBuffer::~FrameBuffer() {
  drop();
}

void FrameBuffer::drop() {
  if (texture_ != 0) glDeleteTextures(1, &texture_);
  if (resolved_ != 0) glDeleteFramebuffers(1, &resolved_);
  if (drawn_ != 0) glDeleteFramebuffers(1, &drawn_);
  if (colour_ != 0) glDeleteRenderbuffers(1, &colour_);
  if (depth_ != 0) glDeleteRenderbuffers(1, &depth_);
  texture_ = resolved_ = drawn_ = colour_ = depth_ = 0;
}

void FrameBuffer::bind(int width, int height) {
  width = std::clamp(width, 1, 16384);
  height = std::clamp(height, 1, 16384);
  if (width != width_ || height != height_ || texture_ == 0) {
    drop();
    width_ = width;
    height_ = height;
    glGenTextures(1, &texture_);
    glBindTexture(GL_TEXTURE_2D, texture_);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width, height, 0, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glBindTexture(GL_TEXTURE_2D, 0);
    glGenRenderbuffers(1, &depth_);
    glBindRenderbuffer(GL_RENDERBUFFER, depth_);
    const bool several = samples_ > 1;
    if (several)
      glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples_, GL_DEPTH_COMPONENT24, width, height);
    else
      glRenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT24, width, height);
    glGenFramebuffers(1, &resolved_);
    glBindFramebuffer(GL_FRAMEBUFFER, resolved_);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture_, 0);
    if (several) {
      glGenRenderbuffers(1, &colour_);
      glBindRenderbuffer(GL_RENDERBUFFER, colour_);
      glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples_, GL_RGBA8, width, height);
      glGenFramebuffers(1, &drawn_);
      glBindFramebuffer(GL_FRAMEBUFFER, drawn_);
      glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colour_);
    }
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_);
  }
  glBindFramebuffer(GL_FRAMEBUFFER, drawn_ != 0 ? drawn_ : resolved_);
  glViewport(0, 0, width_, height_);
}

void FrameBuffer::copyFrom(const FrameBuffer& other, PixelRect part) {
  if (part.empty()) return;
  glBindFramebuffer(GL_READ_FRAMEBUFFER, other.drawn_ != 0 ? other.drawn_ : other.resolved_);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, drawn_ != 0 ? drawn_ : resolved_);
  const int x1 = part.x + part.width, y1 = part.y + part.height;
  glBlitFramebuffer(part.x, part.y, x1, y1, part.x, part.y, x1, y1, GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT,
                    GL_NEAREST);
}

void FrameBuffer::resolve() {
  resolve(whole());
}

void FrameBuffer::resolve(PixelRect part) {
  if (drawn_ != 0 && !part.empty()) {
    const int x1 = part.x + part.width, y1 = part.y + part.height;
    glBindFramebuffer(GL_READ_FRAMEBUFFER, drawn_);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, resolved_);
    glBlitFramebuffer(part.x, part.y, x1, y1, part.x, part.y, x1, y1, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  }
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
}

void FrameBuffer::showAt(int x, int y) const {
  glBindFramebuffer(GL_READ_FRAMEBUFFER, resolved_);
  glBlitFramebuffer(0, 0, width_, height_, x, y, x + width_, y + height_, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, 0);
}

RgbaImage FrameBuffer::read() {
  RgbaImage image;
  if (texture_ == 0) return image;
  image.width = width_;
  image.height = height_;
  const auto row = 4 * static_cast<std::size_t>(width_);
  std::vector<std::uint8_t> upward(row * static_cast<std::size_t>(height_));
  glBindFramebuffer(GL_READ_FRAMEBUFFER, resolved_);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, width_, height_, GL_RGBA, GL_UNSIGNED_BYTE, upward.data());
  glBindFramebuffer(GL_READ_FRAMEBUFFER, 0);
  // OpenGL begins below
  image.pixels.resize(upward.size());
  for (std::size_t y = 0; y < static_cast<std::size_t>(height_); ++y)
    std::memcpy(&image.pixels[y * row], &upward[(static_cast<std::size_t>(height_) - 1 - y) * row], row);
  return image;
}

}  // namespace needlelab
