/// OpenGL objects: shader programs, meshes, frame buffers, textures. Also records changes, so that a surface
/// knows whether to draw a frame.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>

#include <imgui/imgui.h>

#include "client/view/model/camera.h"
#include "client/view/model/mesh.h"
#include "client/view/model/palette.h"
#include "common/base/result.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// A shader program. Needs the context for its whole life. `set` ignores names that the program lacks.
class GlProgram {
 public:
  GlProgram() = default;
  ~GlProgram();
  GlProgram(const GlProgram&) = delete;
  GlProgram& operator=(const GlProgram&) = delete;

  /// Errors: kUnavailable, with the driver's message.
  Status build(const char* name, const char* vertex_source, const char* fragment_source);
  void use() const;
  void set(const char* name, float value) const;
  void set(const char* name, int value) const;
  void set(const char* name, Vec3 value) const;
  void set(const char* name, Vec3 value, double fourth) const;
  void set(const char* name, Rgb colour, float opacity) const;
  void set(const char* name, const Matrix4& value) const;

 private:
  [[nodiscard]] int location(const char* name) const;
  unsigned program_ = 0;
};

/// A mesh in OpenGL buffers. Attributes: 0 position, 1 normal.
class GlMesh {
 public:
  GlMesh() = default;
  ~GlMesh();
  GlMesh(const GlMesh&) = delete;
  GlMesh& operator=(const GlMesh&) = delete;

  void upload(const Mesh& mesh);
  void draw() const;
  [[nodiscard]] bool empty() const { return count_ == 0; }

 private:
  unsigned array_ = 0, vertices_ = 0, indices_ = 0;
  int count_ = 0;
};

/// Pixels of a picture, counted from its lower left corner as in OpenGL; empty if width or height is not
/// positive.
struct PixelRect {
  int x = 0, y = 0, width = 0, height = 0;
  [[nodiscard]] bool empty() const { return width <= 0 || height <= 0; }
};
/// The smallest rectangle that contains both.
PixelRect joined(PixelRect a, PixelRect b);

/// A drawing target: colour (RGBA8) and depth, with one or several samples per pixel; `resolve` merges the
/// samples. Needs the context for its whole life.
class FrameBuffer {
 public:
  explicit FrameBuffer(int samples = 1) : samples_(samples) {}
  ~FrameBuffer();
  FrameBuffer(const FrameBuffer&) = delete;
  FrameBuffer& operator=(const FrameBuffer&) = delete;

  /// Binds it for drawing and sets the viewport; reallocates when the size changes.
  void bind(int width, int height);
  /// Copies colour and depth of a part of `other`, which has the same size and samples.
  void copyFrom(const FrameBuffer& other, PixelRect part);
  /// Call after drawing: updates the texture, or the drawn part of it.
  void resolve();
  void resolve(PixelRect part);
  /// Copies the picture to the bound draw buffer, lower left corner at x, y; respects the scissor.
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
  unsigned texture_ = 0, resolved_ = 0;          // the shown picture, and its buffer
  unsigned drawn_ = 0, colour_ = 0, depth_ = 0;  // if multisampled: drawn into, then resolved
};

/// A picture in an OpenGL texture, for ImGui::Image. Needs the surface's context for its whole life. Thread:
/// the surface's.
class Texture {
 public:
  Texture() = default;
  ~Texture();
  Texture(Texture&& other) noexcept;
  Texture& operator=(Texture&& other) noexcept;

  /// Reuses the memory if the size is unchanged. An image without pixels empties the texture.
  void upload(const GreyImage& image);
  void upload(const RgbaImage& image);
  [[nodiscard]] ImTextureID id() const;  ///< null when empty
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

 private:
  void put(int width, int height, bool grey, const void* pixels);
  unsigned name_ = 0;
  int width_ = 0, height_ = 0;
  bool grey_ = false;
};

/// Converts ImGui's coordinates to OpenGL's, for draw callbacks: returns the rectangle in pixels of the bound
/// buffer, counted from the bottom, clipped to `clip` (left, top, right, bottom). ImGui counts from the top,
/// in points on a scaled display.
PixelRect surfacePixels(ImVec2 from, ImVec2 to, ImVec4 clip);

/// Records a change of a texture's pixels, so that the next frame is drawn. Thread: the surface's.
void noteTextureChange();
/// Records content of the current frame outside ImGui's lists, such as a draw callback's data.
void noteContent(std::uint64_t word);
/// Returns a hash of everything that determines the frame's pixels: ImGui's lists, texture changes, and the
/// noteContent words since the last call.
std::uint64_t hashOfFrame(const ImDrawData& data, int width_px, int height_px);

}  // namespace needlelab
