/// The paper's figures 7 to 11 from closed-loop runs with the simulated hand and device (DESIGN §5).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "client/device/simulated_device.h"
#include "client/sim/tools/closed_loop.h"
#include "common/base/result.h"

namespace needlelab {

/// A run that a figure shows. Times are those of the figure: `t0_s` belongs to tick 0.
struct FigureRun {
  double rate_hz = 1000;
  double t0_s = 0;
  std::vector<ChainTick> ticks;
  [[nodiscard]] double time_s(std::size_t i) const {
    return t0_s + static_cast<double>(ticks[i].tick) / rate_hz;
  }
};

/// A figure, ready to be written: the table, and the gnuplot script that draws it (from the table's path).
struct Figure {
  std::string name;   ///< "fig07"
  std::string title;  ///< for a person
  std::string csv;
  std::string script;
  int width_px = 1200, height_px = 800;
};

/// Fig. 7: one layer, 1 N in, 0.5 N out, with an intentional stop; along W's z.
Result<FigureRun> runOneLayer();
/// Fig. 8 and 9: six layers, oblique in W.
Result<FigureRun> runSixLayers();
/// Fig. 10 and 11: clamping force, a partial withdrawal and a change of trajectory.
Result<FigureRun> runClamping();

/// `csv_path`: where the table will be, for the script.
Figure figure07(const FigureRun& run, const std::filesystem::path& csv_path);
Figure figure08(const FigureRun& run, const std::filesystem::path& csv_path);
Figure figure09(const FigureRun& run, const std::filesystem::path& csv_path);
Figure figure10(const FigureRun& run, const std::filesystem::path& csv_path);
Figure figure11(const FigureRun& run, const std::filesystem::path& csv_path);

/// One of the paper's profiles (db/samples), compiled into the program: "paper-1dof", "paper-six-layers",
/// "paper-clamping". `X_WL` places it.
Result<SceneModel> paperScene(std::string_view id, const Pose& X_WL, double rate_hz);

/// The same, not yet compiled.
Result<SceneSpec> paperSceneSpec(std::string_view id, const Pose& X_WL);

/// Runs `plan` to its end in `model` with the simulated hand and device, through the gate.
Result<FigureRun> runPlan(const SceneModel& model, const SimulatedDeviceOptions& device, HandPlan plan,
                          double t0_s);

}  // namespace needlelab
