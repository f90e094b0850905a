/// The paper's figures 7 to 11 from closed-loop runs with the simulated hand and device.
#pragma once

#include <string>
#include <vector>

#include "client/sim/tools/closed_loop.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/result.h"

namespace needlelab {

/// A figure, ready to be written: the table, and additional variables for its plot file (client/sim/plots,
/// same name).
struct Figure {
  std::string name;   ///< "fig07"
  std::string title;  ///< for people
  std::string csv;
  std::vector<PlotVariable> variables;
};

/// Fig. 7: one layer, 1 N in, 0.5 N out, with an intentional stop; along W's z.
Result<FigureRun> runOneLayer();
/// Figs. 8 and 9: six layers, oblique in W.
Result<FigureRun> runSixLayers();
/// Figs. 10 and 11: clamping force, a partial withdrawal and a change of trajectory.
Result<FigureRun> runClamping();

Figure figure07(const FigureRun& run);
Figure figure08(const FigureRun& run);
Figure figure09(const FigureRun& run);
Figure figure10(const FigureRun& run);
Figure figure11(const FigureRun& run);

}  // namespace needlelab
