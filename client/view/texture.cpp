#include "client/view/texture.h"

#include <epoxy/gl.h>

#include <cstdint>
#include <utility>

#include "client/view/redraw.h"

namespace needlelab {
namespace {
// of the one surface that a process has
std::uint64_t texture_changes = 0, content = 0;
}  // namespace

void noteTextureChange() {
  ++texture_changes;
}

std::uint64_t textureChanges() {
  return texture_changes;
}

void noteContent(std::uint64_t word) {
  content = (content ^ word) * 0x100000001B3u;
  content ^= content >> 29;
}

std::uint64_t takeContent() {
  return std::exchange(content, 0);
}

Texture::~Texture() {
  if (name_ != 0) glDeleteTextures(1, &name_);
}

Texture::Texture(Texture&& other) noexcept {
  *this = std::move(other);
}

Texture& Texture::operator=(Texture&& other) noexcept {
  std::swap(name_, other.name_);
  std::swap(width_, other.width_);
  std::swap(height_, other.height_);
  std::swap(grey_, other.grey_);
  return *this;
}

void Texture::upload(const GreyImage& image) {
  put(image.width, image.height, true, image.pixels.data());
}

void Texture::upload(const RgbaImage& image) {
  put(image.width, image.height, false, image.pixels.data());
}

void Texture::put(int width, int height, bool grey, const void* pixels) {
  noteTextureChange();
  if (width <= 0 || height <= 0) {
    Texture empty;
    *this = std::move(empty);
    return;
  }
  const bool fresh = name_ == 0 || width != width_ || height != height_ || grey != grey_;
  if (name_ == 0) glGenTextures(1, &name_);
  glBindTexture(GL_TEXTURE_2D, name_);
  // rows of one byte a pixel need not begin at multiples of four
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  const GLenum format = grey ? GL_RED : GL_RGBA;
  if (fresh) {
    glTexImage2D(GL_TEXTURE_2D, 0, grey ? GL_R8 : GL_RGBA8, width, height, 0, format, GL_UNSIGNED_BYTE,
                 pixels);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    // one channel is shown as grey, opaque
    const GLint swizzle[4] = {GL_RED, grey ? GL_RED : GL_GREEN, grey ? GL_RED : GL_BLUE,
                              grey ? GL_ONE : GL_ALPHA};
    glTexParameteriv(GL_TEXTURE_2D, GL_TEXTURE_SWIZZLE_RGBA, swizzle);
  } else {
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, format, GL_UNSIGNED_BYTE, pixels);
  }
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  glBindTexture(GL_TEXTURE_2D, 0);
  width_ = width;
  height_ = height;
  grey_ = grey;
}

ImTextureID Texture::id() const {
  return reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(name_));
}

}  // namespace needlelab
