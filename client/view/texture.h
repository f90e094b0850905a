/// A picture on the graphics side, for ImGui::Image.
#pragma once

#include <imgui/imgui.h>

#include "client/view/model/image.h"

namespace needlelab {

/// Needs the surface's context, for its whole life. Thread: the surface's.
class Texture {
 public:
  Texture() = default;
  ~Texture();
  Texture(Texture&& other) noexcept;
  Texture& operator=(Texture&& other) noexcept;

  /// Keeps the memory where the size is the same. Images without pixels empty it.
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

}  // namespace needlelab
