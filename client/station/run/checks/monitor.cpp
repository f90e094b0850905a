#include "client/station/run/checks/monitor.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <system_error>

namespace needlelab {
namespace {

constexpr std::size_t kBlockBytes = 128;
constexpr std::string_view kHeader("\x00\xFF\xFF\xFF\xFF\xFF\xFF\x00", 8);
constexpr std::size_t kWidth_cm = 21, kHeight_cm = 22;
// in the first detailed timing at 54: the low bytes, and the high four bits of both
constexpr std::size_t kWidth_mm = 66, kHeight_mm = 67, kHigh_mm = 68;

int byteAt(std::string_view edid, std::size_t at) {
  return static_cast<unsigned char>(edid[at]);
}

}  // namespace

std::optional<double> edidDiagonal_m(std::string_view edid) {
  if (edid.size() < kBlockBytes || !edid.starts_with(kHeader)) return std::nullopt;
  const int high = byteAt(edid, kHigh_mm);
  const int width_mm = byteAt(edid, kWidth_mm) | (high & 0xF0) << 4,
            height_mm = byteAt(edid, kHeight_mm) | (high & 0x0F) << 8;
  if (width_mm > 0 && height_mm > 0) return 1e-3 * std::hypot(width_mm, height_mm);
  const int width_cm = byteAt(edid, kWidth_cm), height_cm = byteAt(edid, kHeight_cm);
  if (width_cm > 0 && height_cm > 0) return 1e-2 * std::hypot(width_cm, height_cm);
  return std::nullopt;
}

std::vector<MonitorSize> connectedMonitors(const std::filesystem::path& drm) {
  std::vector<MonitorSize> found;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(drm, none)) {
    const std::string name = entry.path().filename();  // "card0-HDMI-A-1"
    const std::size_t dash = name.find('-');
    if (!name.starts_with("card") || dash == std::string::npos) continue;
    // the kernel reports no size for this file; it is empty if nothing is connected
    std::string edid(kBlockBytes, 0);
    std::ifstream file(entry.path() / "edid", std::ios::binary);
    file.read(edid.data(), static_cast<std::streamsize>(edid.size()));
    edid.resize(static_cast<std::size_t>(file.gcount()));
    if (const auto diagonal_m = edidDiagonal_m(edid)) found.push_back({name.substr(dash + 1), *diagonal_m});
  }
  std::ranges::sort(found, {}, &MonitorSize::plug);
  return found;
}

}  // namespace needlelab
