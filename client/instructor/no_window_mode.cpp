#include "client/instructor/window_mode.h"

namespace needlelab {

Status runWindowMode(const InstructorOptions&, const std::function<bool()>&) {
  return Error{
      ErrorCode::kUnavailable,
      "the window is not in this build (it was made without the station's parts): use --headless, or "
      "--report FILE, or build with -DNEEDLELAB_BUILD_STATION=ON"};
}

}  // namespace needlelab
