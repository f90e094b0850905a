/// The sizes that the connected monitors report (EDID), as suggestions for --monitor.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace needlelab {

struct MonitorSize {
  std::string plug;  ///< "HDMI-A-1"
  double diagonal_m = 0;
};

/// Returns the picture's diagonal from an EDID's base block (VESA E-EDID 1.4): of the preferred timing in mm,
/// otherwise of the screen in cm. Nothing if `edid` is not an EDID or gives no size (a projector).
std::optional<double> edidDiagonal_m(std::string_view edid);

/// The connected monitors that report a size. `drm`: the kernel's folder of graphics cards.
std::vector<MonitorSize> connectedMonitors(const std::filesystem::path& drm = "/sys/class/drm");

}  // namespace needlelab
