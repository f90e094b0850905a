#include "client/sim/tools/offline_cli.h"

#include <cstdio>

#include "common/profile/profile.h"

namespace needlelab {

void addOfflineOptions(CLI::App& app, OfflineOptions& options) {
  app.add_option("--profile", options.profile, "the scene: a profile's JSON")->required();
  app.add_option("--trajectory", options.trajectory,
                 "CSV with t_s,px_m,py_m,pz_m,qx,qy,qz,qw and perhaps plunger; a row is a tick")
      ->required();
  app.add_option("--rate", options.rate_hz, "ticks per second, 50 to 40000")->capture_default_str();
  app.add_option("--model", options.model, "axial model, instead of the profile's");
  app.add_option("--placement", options.placement,
                 "the limb in the device's frame: x,y,z,qx,qy,qz,qw or a JSON file");
  app.add_option(
      "--tool", options.tool,
      "the tip in the handle's frame, when the rows are the handle's: x,y,z,qx,qy,qz,qw or a JSON file");
}

void sayWarnings(const OfflineScene& scene) {
  for (const std::string& warning : profileWarnings(scene.profile))
    std::fprintf(stderr, "needlelab-sim: warning: profile %s: %s\n", scene.profile.id().c_str(),
                 warning.c_str());
}

}  // namespace needlelab
