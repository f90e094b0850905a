// PNG files.
#include <string>

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>

#include "client/view/surface.h"
#include "common/base/files/files.h"

namespace needlelab {

Status savePng(const RgbaImage& image, const std::filesystem::path& file) {
  std::string png;
  const auto append = [](void* to, void* data, int size) {
    static_cast<std::string*>(to)->append(static_cast<const char*>(data), static_cast<std::size_t>(size));
  };
  const bool whole = image.width > 0 && image.height > 0 &&
                     image.pixels.size() ==
                         4 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (!whole ||
      stbi_write_png_to_func(append, &png, image.width, image.height, 4, image.pixels.data(), 0) == 0)
    return Error{ErrorCode::kFailed, file.string() + ": the picture cannot be coded as PNG"};
  return writeFileAtomically(file, viewOf(png));
}

Result<RgbaImage> loadPng(const std::filesystem::path& file) {
  constexpr std::size_t kMostBytes = 64u << 20;
  const Result<std::string> bytes = readWholeFile(file, kMostBytes);
  if (!bytes) return Error{ErrorCode::kNotFound, bytes.error().message};
  RgbaImage image;
  int channels = 0;
  stbi_uc* pixels =
      stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(bytes->data()), static_cast<int>(bytes->size()),
                            &image.width, &image.height, &channels, 4);
  if (pixels == nullptr) return Error{ErrorCode::kCorrupt, file.string() + ": no PNG that can be read"};
  image.pixels.assign(
      pixels, pixels + 4 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  stbi_image_free(pixels);
  return image;
}

}  // namespace needlelab
