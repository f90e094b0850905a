/// What the connected monitors say about their size (EDID): a suggestion for --monitor.
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

/// The diagonal of the picture in an EDID's base block (VESA E-EDID 1.4): of the preferred timing in mm, else
/// of the screen in cm. Nothing where it is no EDID, or says no size (a projector).
std::optional<double> edidDiagonal_m(std::string_view edid);

/// The connected monitors that say their size. `drm`: the kernel's folder of graphics cards.
std::vector<MonitorSize> connectedMonitors(const std::filesystem::path& drm = "/sys/class/drm");

}  // namespace needlelab
