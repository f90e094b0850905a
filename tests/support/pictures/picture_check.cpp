#include "tests/support/pictures/picture_check.h"

#include <algorithm>
#include <cstdlib>

#include "client/view/surface.h"

namespace needlelab::test {
namespace {

std::size_t indexOf(const RgbaImage& image, int x, int y) {
  return 4 *
         (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x));
}

void blacken(RgbaImage& image, const std::vector<PictureArea>& areas) {
  for (const PictureArea& area : areas)
    for (int y = std::max(0, area.y); y < std::min(image.height, area.y + area.height); ++y)
      for (int x = std::max(0, area.x); x < std::min(image.width, area.x + area.width); ++x)
        std::fill_n(image.pixels.begin() + static_cast<std::ptrdiff_t>(indexOf(image, x, y)), 3,
                    std::uint8_t{0});
}

// five bits per channel: half the size in git, and far within the tolerance
void coarsen(RgbaImage& image) {
  for (std::uint8_t& value : image.pixels) value = static_cast<std::uint8_t>((value & 0xF8u) | (value >> 5));
}

RgbaImage differencePicture(const RgbaImage& a, const RgbaImage& b, int per_channel) {
  RgbaImage out = a;
  for (std::size_t i = 0; i + 3 < out.pixels.size() && i + 3 < b.pixels.size(); i += 4) {
    int worst = 0;
    for (std::size_t c = 0; c < 3; ++c) worst = std::max(worst, std::abs(a.pixels[i + c] - b.pixels[i + c]));
    // equal pixels are dim, different ones bright
    const bool off = worst > per_channel;
    for (std::size_t c = 0; c < 3; ++c)
      out.pixels[i + c] = static_cast<std::uint8_t>(off ? (c == 2 ? 0 : 255) : a.pixels[i + c] / 4);
  }
  return out;
}

std::filesystem::path failureFolder() {
  const char* wished = std::getenv("NEEDLELAB_PICTURES");
  std::filesystem::path folder =
      wished != nullptr ? wished : std::filesystem::temp_directory_path() / "needlelab-pictures";
  std::error_code ignored;
  std::filesystem::create_directories(folder, ignored);
  return folder;
}

}  // namespace

double shareThatDiffers(const RgbaImage& a, const RgbaImage& b, int per_channel) {
  if (a.width != b.width || a.height != b.height || a.pixels.size() != b.pixels.size() || a.pixels.empty())
    return 1;
  std::size_t off = 0;
  for (std::size_t i = 0; i < a.pixels.size(); i += 4) {
    bool differs = false;
    for (std::size_t c = 0; c < 3; ++c)
      differs = differs || std::abs(a.pixels[i + c] - b.pixels[i + c]) > per_channel;
    off += differs ? 1 : 0;
  }
  return static_cast<double>(off) / (static_cast<double>(a.pixels.size()) / 4);
}

RgbaImage shrunk(const RgbaImage& image, int by) {
  if (by <= 1) return image;
  RgbaImage out{image.width / by, image.height / by, {}};
  out.pixels.resize(4 * static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height));
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x)
      for (std::size_t c = 0; c < 4; ++c) {
        int sum = 0;
        for (int dy = 0; dy < by; ++dy)
          for (int dx = 0; dx < by; ++dx) sum += image.pixels[indexOf(image, x * by + dx, y * by + dy) + c];
        out.pixels[indexOf(out, x, y) + c] = static_cast<std::uint8_t>((sum + by * by / 2) / (by * by));
      }
  return out;
}

unsigned pixelAt(const RgbaImage& image, double x_px, double y_px) {
  const int x = static_cast<int>(x_px), y = static_cast<int>(y_px);
  if (x < 0 || y < 0 || x >= image.width || y >= image.height) return 0;
  const std::uint8_t* pixel = &image.pixels[indexOf(image, x, y)];
  return static_cast<unsigned>(pixel[0]) << 16 | static_cast<unsigned>(pixel[1]) << 8 | pixel[2];
}

MeanColour meanAround(const RgbaImage& image, double x_px, double y_px, int half) {
  MeanColour mean;
  int count = 0;
  for (int dy = -half; dy <= half; ++dy)
    for (int dx = -half; dx <= half; ++dx) {
      const int x = static_cast<int>(x_px) + dx, y = static_cast<int>(y_px) + dy;
      if (x < 0 || y < 0 || x >= image.width || y >= image.height) continue;
      const std::uint8_t* pixel = &image.pixels[indexOf(image, x, y)];
      mean.red += pixel[0];
      mean.green += pixel[1];
      mean.blue += pixel[2];
      ++count;
    }
  if (count > 0) mean = {mean.red / count, mean.green / count, mean.blue / count};
  return mean;
}

::testing::AssertionResult looksLike(const RgbaImage& picture, const std::filesystem::path& reference,
                                     const PictureTolerance& tolerance) {
  RgbaImage seen = picture;
  blacken(seen, tolerance.passed_over);
  seen = shrunk(seen, tolerance.shrink);
  if (std::getenv("NEEDLELAB_PICTURES_OUT") != nullptr) {
    coarsen(seen);
    if (Status saved = savePng(seen, reference); !saved)
      return ::testing::AssertionFailure() << saved.error().message;
    return ::testing::AssertionSuccess() << "wrote " << reference;
  }
  const Result<RgbaImage> expected = loadPng(reference);
  if (!expected) return ::testing::AssertionFailure() << expected.error().message;
  const double share = shareThatDiffers(seen, *expected, tolerance.per_channel);
  if (share <= tolerance.share_of_pixels) return ::testing::AssertionSuccess();
  const std::filesystem::path folder = failureFolder();
  const std::string name = reference.stem().string();
  const auto leave = [&](const char* what, const RgbaImage& image) {
    (void)savePng(image, folder / (name + "." + what + ".png")).ok();
  };
  leave("seen", seen);
  leave("reference", *expected);
  leave("difference", differencePicture(seen, *expected, tolerance.per_channel));
  return ::testing::AssertionFailure()
         << share * 100 << " % of the pixels differ from " << reference << " (at most "
         << tolerance.share_of_pixels * 100 << " % may; " << seen.width << "×" << seen.height << " beside "
         << expected->width << "×" << expected->height << "): look at "
         << (folder / (name + ".difference.png")).string();
}

}  // namespace needlelab::test
