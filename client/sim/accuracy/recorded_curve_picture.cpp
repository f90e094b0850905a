/// Models beside the recorded force-depth curve.
#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/recorded_curve.h"
#include "client/sim/accuracy/recorded_pictures.h"
#include "client/sim/accuracy/recorded_text.h"
#include "client/sim/tools/figure_table.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr double kPictureTo_m = 0.048;

struct DrawnFit {
  CurveFit fit;
  std::vector<double> depth_mm, force_N;  // the engine's, every 30 µm
};

Result<DepthCurve> readCurve(const AccuracyOptions& options) {
  const auto rows = readForceOverDepth(options.data / kLiverHeartFile);
  if (!rows.ok()) return rows.error();
  return depthCurve(*rows);
}

Result<DrawnFit> drawn(const DepthCurve& curve, const CurveModel& model, const BinChoice& choice) {
  auto fit = fitCurve(curve, model, choice);
  if (!fit.ok()) return fit.error();
  const auto run = runCurve(fit->scene, kPictureTo_m);
  if (!run.ok()) return run.error();
  DrawnFit made{std::move(fit).value(), {}, {}};
  for (double d = 0; d < kPictureTo_m; d += 3e-5) made.depth_mm.push_back(d);
  made.force_N = forceAtDepths(*run, made.fit.scene.surface_m, made.depth_mm);
  for (double& d : made.depth_mm) d *= 1e3;
  return made;
}

// recorded rows, in mm: those fitted on, and those held out
std::string recordedBlocks(const DepthCurve& curve, const BinChoice& choice) {
  std::vector<std::vector<double>> fitted(2), held_out(2);
  for (const CurveBin& bin : curve.bins)
    for (const std::size_t i : bin.rows) {
      auto& side = choice(bin) ? fitted : held_out;
      side[0].push_back(curve.depth_m[i] * 1e3);
      side[1].push_back(curve.force_N[i]);
    }
  return dataBlock("fitted", fitted) + dataBlock("heldout", held_out);
}

std::vector<std::pair<double, double>> heldOutBlocks(int fold) {
  std::vector<std::pair<double, double>> spans;
  const double width_mm = kDepthBlock_m * 1e3;
  for (int block = fold; block * width_mm < kPictureTo_m * 1e3; block += 2)
    spans.emplace_back(block * width_mm, (block + 1) * width_mm);
  return spans;
}

std::string modelWords(const CurveFit& fit) {
  switch (fit.model) {
    case AxialModel::kEnhancedTrackingWall:
      return fit.variant.starts_with("PUNCTURE") ? "enhanced wall, membranes" : "enhanced wall, layers";
    case AxialModel::kTrackingWall:
      return "tracking wall (2018), layers";
    case AxialModel::kDirect:
      return "direct, layers";
    case AxialModel::kVoigt:
      return "Voigt";
    case AxialModel::kGodObject:
      return "god object";
    case AxialModel::kFirstOrder:
      return "first order";
    case AxialModel::kPrecomputed:
      return "precomputed table";
    default:
      return std::string(axialModelName(fit.model));
  }
}

constexpr const char* kShade = "#ecf0f4";
constexpr const char* kTitleFont = "font 'DejaVu Sans Bold,16' textcolor rgb '#1c2329'";

}  // namespace

Result<RecordedPicture> recordedCurvePicture(const AccuracyOptions& options) {
  const auto curve = readCurve(options);
  if (!curve.ok()) return curve.error();
  RecordedPicture picture{"recorded_curve", {}, {}, 1500, 1050};

  // above: every second block held out; below: all beyond 25 mm
  std::string script = figureStyle() + "set multiplot\n";
  std::vector<std::pair<std::string, std::vector<double>>> csv = {{"depth_m", curve->depth_m},
                                                                  {"recorded_n", curve->force_N}};
  std::string finding;
  for (const bool extrapolates : {false, true}) {
    const BinChoice choice = extrapolates ? beforeTheSplit() : alternateBlocks(1);
    const auto chosen = chosenBins(*curve, choice);
    const std::vector<CurveModel> models = {layeredModel(AxialModel::kEnhancedTrackingWall, chosen),
                                            membraneModel(chosen), lineModel(AxialModel::kVoigt, chosen)};
    script += recordedBlocks(*curve, choice);
    std::string plots;
    std::vector<double> errors_N;
    for (std::size_t m = 0; m < models.size(); ++m) {
      const auto model = drawn(*curve, models[m], choice);
      if (!model.ok()) return model.error();
      const std::string name = formatted("model%d%zu", extrapolates ? 1 : 0, m);
      script += dataBlock(name, {model->depth_mm, model->force_N});
      errors_N.push_back(model->fit.held_out.rms);
      plots += ", $" + name + " using 1:2 with lines lw 2.2 " + (m == 2 ? "dt (9,4) " : "") + "lc rgb '" +
               safeColour(m) + "' title '" + modelWords(model->fit) +
               formatted(" (%zu numbers): %.2f N'", model->fit.parameters, model->fit.held_out.rms);
      csv.emplace_back(formatted("%s_%zu_n", extrapolates ? "extrapolated" : "alternate", m),
                       model->fit.model_N);
    }
    if (!extrapolates)
      finding = formatted(
          "Between what it was fitted on, the wall follows a bovine liver and heart to %.2f N; ahead of it, "
          "no model does",
          errors_N[0]);
    script += "unset object\nunset label\nset lmargin at screen 0.065\nset rmargin at screen 0.985\n";
    script += extrapolates ? shadedSpans({{kExtrapolateFrom_m * 1e3, kPictureTo_m * 1e3}}, 1, kShade)
                           : shadedSpans(heldOutBlocks(1), 1, kShade);
    script += std::string("set tmargin at screen ") + (extrapolates ? "0.475" : "0.925") +
              "\nset bmargin at screen " + (extrapolates ? "0.07" : "0.53") + "\n";
    if (!extrapolates)
      script += "set label 1 '" + finding + "' at screen 0.5, 0.965 center " + kTitleFont + "\n";
    script += std::string("set label 2 '") +
              (extrapolates ? "fitted on the first 25 mm, held out: the rest (shaded); rms error there"
                            : "held out: every second 0.5 mm (shaded); rms error there") +
              "' at graph 0.01, 0.955 font 'DejaVu Sans,12' textcolor rgb '#2b333b' front\n";
    script +=
        "set xrange [0:48]\nset yrange [-0.15:2.7]\nset ytics 0.5\nset key at graph 0.01, 0.90 left top "
        "Left reverse samplen 2 spacing 1.15 font 'DejaVu Sans,11'\nset ylabel 'force on the needle [N]'\n";
    script +=
        extrapolates ? "set xlabel 'depth [mm]'\nset format x '%g'\n" : "unset xlabel\nset format x ''\n";
    script +=
        "plot $fitted using 1:2 with points pt 7 ps 0.5 lc rgb '#5b6670' title 'recorded, fitted on', "
        "$heldout "
        "using 1:2 with points pt 6 ps 0.6 lc rgb '#20262c' title 'recorded, held out'" +
        plots + "\n";
  }
  picture.csv = csvOf(csv);
  picture.script = script + "unset multiplot\n";
  return picture;
}

Result<RecordedPicture> recordedModelsPicture(const AccuracyOptions& options) {
  const auto curve = readCurve(options);
  if (!curve.ok()) return curve.error();
  RecordedPicture picture{"recorded_models", {}, {}, 1500, 1000};
  const BinChoice choice = alternateBlocks(1);
  const auto models = curveModels(chosenBins(*curve, choice));
  constexpr int kColumns = 4;
  const int lines = (static_cast<int>(models.size()) + kColumns - 1) / kColumns;

  std::string script = figureStyle() + "set multiplot\n" + recordedBlocks(*curve, choice);
  std::vector<std::pair<std::string, std::vector<double>>> csv = {{"depth_m", curve->depth_m},
                                                                  {"recorded_n", curve->force_N}};
  script += "set xrange [0:48]\nset yrange [-0.15:2.6]\nset xtics 10\nset ytics 0.5\nunset key\n";
  double least = 1e9, most = 0;
  for (std::size_t m = 0; m < models.size(); ++m) {
    const auto model = drawn(*curve, models[m], choice);
    if (!model.ok()) return model.error();
    const std::string name = formatted("model%zu", m);
    least = std::min(least, model->fit.held_out.rms);
    most = std::max(most, model->fit.held_out.rms);
    csv.emplace_back(formatted("model_%zu_n", m), model->fit.model_N);
    const int line = static_cast<int>(m) / kColumns, column = static_cast<int>(m) % kColumns;
    const double left = 0.05 + 0.2375 * column, top = 0.86 - 0.43 * line;
    script += dataBlock(name, {model->depth_mm, model->force_N}) + "unset label\n";
    script += formatted(
        "set lmargin at screen %.4f\nset rmargin at screen %.4f\nset tmargin at screen %.4f\nset bmargin at "
        "screen %.4f\n",
        left, left + 0.212, top, top - 0.335);
    script += column == 0 ? "set ylabel 'force [N]' offset 1,0\nset format y '%g'\n"
                          : "unset ylabel\nset format y ''\n";
    script += line == lines - 1 ? "set xlabel 'depth [mm]'\n" : "unset xlabel\n";
    script += "set label 1 '" + modelWords(model->fit) +
              "' at graph 0.5, 1.10 center font 'DejaVu Sans Bold,12' textcolor rgb '#1c2329'\n";
    script += formatted(
        "set label 2 '%zu numbers: %.2f N rms' at graph 0.5, 1.035 center font 'DejaVu Sans,11' textcolor "
        "rgb '#2b333b'\n",
        model->fit.parameters, model->fit.held_out.rms);
    // the title and the legend stand beside the first panel
    if (m == 0) {
      picture.script.clear();
      script += "@TITLE@";
    }
    script +=
        "plot $fitted using 1:2 with points pt 7 ps 0.3 lc rgb '#9aa4ad', $heldout using 1:2 with points pt "
        "7 ps "
        "0.35 lc rgb '" +
        safeColour(1) + "', $" + name + " using 1:2 with lines lw 2 lc rgb '" + safeColour(0) + "'\n";
  }
  const std::string title = formatted(
      "set label 10 'Models that know of layers or ruptures follow a recorded needle to %.2f N, a straight "
      "line "
      "to %.2f N' at screen 0.5, 0.968 center %s\nset label 11 'grey: recorded, fitted on; orange: recorded, "
      "held "
      "out (every second 0.5 mm); blue: the engine with the fitted scene; rms error on what was held out' at "
      "screen 0.5, 0.935 center font 'DejaVu Sans,12' textcolor rgb '#2b333b'\n",
      least, most, kTitleFont);
  script.replace(script.find("@TITLE@"), 7, title);
  picture.csv = csvOf(csv);
  picture.script = script + "unset multiplot\n";
  return picture;
}

}  // namespace needlelab
