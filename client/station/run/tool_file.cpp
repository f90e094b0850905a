#include "client/station/run/tool_file.h"

#include <ctime>
#include <nlohmann/json.hpp>

#include "client/device/pose_option.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

// 2026-11-20T10:45:00Z
std::string utcText(std::int64_t unix_ns) {
  const auto seconds = static_cast<std::time_t>(unix_ns / 1'000'000'000);
  std::tm utc{};
  char text[32] = {};
  ::gmtime_r(&seconds, &utc);
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

}  // namespace

std::string toolFileText(const Pose& X_HT, const ToolNotes& notes) {
  // one writer of the pose: its text is taken apart again
  auto json = nlohmann::ordered_json::parse(poseOptionJson(X_HT));
  json["calibration"] = {{"made", utcText(notes.made_unix_ns)},
                         {"program", std::string("needlelab-station ") + NEEDLELAB_VERSION},
                         {"machine", machineText()},
                         {"device", notes.device},
                         {"axis", notes.axis},
                         {"samples", notes.samples},
                         {"used", notes.used},
                         {"residual_rms_m", notes.residual_rms_m},
                         {"residual_max_m", notes.residual_max_m},
                         {"expected_error_m", notes.expected_error_m},
                         {"tool_error_m", notes.tool_error_m},
                         {"spread", notes.spread}};
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace needlelab
