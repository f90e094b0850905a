#include "client/sim/accuracy/recorded_epidural.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/recorded.h"
#include "client/sim/accuracy/recorded_fit.h"

namespace needlelab {
namespace {

double valueOf(const ForcePolynomial& p, double x_mm) {
  return p.c[0] + x_mm * (p.c[1] + x_mm * (p.c[2] + x_mm * p.c[3]));
}

// the second derivative is linear in x: greatest at an end
double bendOf(const ForcePolynomial& p) {
  return std::max(std::fabs(2 * p.c[2]), std::fabs(2 * p.c[2] + 6 * p.c[3] * p.thickness_mm));
}

PrecomputedSpec::Row rowOf(double depth_mm, double force_N) {
  return {std::round(depth_mm * 1e3) / 1e6, std::round(std::max(0.0, force_N) * 1e4) / 1e4, 0};
}

// within 2 µm of a layer's end: there the table takes 1 µm to jump
bool nearJump(double depth_m) {
  double end_m = 0;
  for (const ForcePolynomial& layer : epiduralPolynomials()) {
    end_m += layer.thickness_mm * 1e-3;
    if (std::fabs(depth_m - end_m) < 2e-6) return true;
  }
  return false;
}

SceneSpec sceneOf(double stiffness_N_per_m) {
  SceneSpec scene = fittedSceneBase();
  scene.axial_model = AxialModel::kPrecomputed;
  scene.effects = bitOf(Effect::kCutting);
  scene.tracking_wall.stiffness_N_per_m = stiffness_N_per_m;
  // the layers of the sample: where its force falls at a layer's end, that is a release
  for (const ForcePolynomial& layer : epiduralPolynomials()) {
    scene.layers.push_back({});
    scene.layers.back().thickness_m = layer.thickness_mm * 1e-3;
  }
  scene.precomputed.table = epiduralTable(kEpiduralTableError_N);
  return scene;
}

}  // namespace

const std::array<ForcePolynomial, 9>& epiduralPolynomials() {
  static const std::array<ForcePolynomial, 9> layers = {{
      {"skin", 13.92, {0.0235, 0.0116, -0.0046, 0.0025}},
      {"fat", 3.23, {6.0372, 0.4516, -0.5287, 0}},
      {"muscle", 2.22, {1.9736, 0.8287, 0.1078, 0}},
      {"muscle, second part", 0.63, {4.354, -2.2543, 0.2902, 0}},
      {"interspinous ligament", 3.18, {4.4062, 0.9598, 0, 0}},
      {"interspinous ligament, plateau", 18.0, {7.467, 0, 0, 0}},
      {"ligamentum flavum", 3.61, {7.467, 1.5029, -0.0583, 0}},
      {"ligamentum flavum, after rupture", 3.59, {12.133, -0.1693, -0.1177, 0}},
      {"epidural space", 8.6, {0, 0, 0, 0}},
  }};
  return layers;
}

double epiduralForce_N(double depth_m) {
  double left_mm = depth_m * 1e3;
  if (left_mm < 0) return 0;
  for (const ForcePolynomial& layer : epiduralPolynomials()) {
    if (left_mm < layer.thickness_mm) return valueOf(layer, left_mm);
    left_mm -= layer.thickness_mm;
  }
  return 0;
}

std::vector<PrecomputedSpec::Row> epiduralTable(double error_N) {
  constexpr double kSide_mm = 0.001;
  std::vector<PrecomputedSpec::Row> table;
  double top_mm = 0;
  for (const ForcePolynomial& layer : epiduralPolynomials()) {
    // a chord of length h is off by at most h²·|f''|/8
    const int parts = std::max(
        1, static_cast<int>(std::ceil(layer.thickness_mm * std::sqrt(bendOf(layer) / (8 * error_N)))));
    for (int i = 0; i <= parts; ++i) {
      const double x_mm = i < parts ? layer.thickness_mm * i / parts : layer.thickness_mm - kSide_mm;
      table.push_back(rowOf(top_mm + x_mm, valueOf(layer, x_mm)));
    }
    top_mm += layer.thickness_mm;
  }
  return table;
}

Result<AccuracyRows> epiduralRows(const AccuracyOptions& /*options*/, const AccuracyProgress& progress,
                                  std::vector<std::string>& /*notes*/) {
  if (progress) progress("rendering the epidural table", 0);
  AccuracyRows rows;
  for (const double stiffness : {500.0, 1000.0, 10000.0}) {
    const SceneSpec scene = sceneOf(stiffness);
    ASSIGN_OR_RETURN(const auto model, compile(scene, 1000));
    // no tick within the micrometre in which the table falls into the epidural space
    const StraightGesture gesture = constantSpeed(-0.5e-6, 0.0569, 0.003, 1000);
    AxialRun run;
    runStraight(model, gesture, run);
    AccuracyRow row;
    double squares = 0, most = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < run.force_N.size(); ++i) {
      if (gesture.depth_m[i] <= 0 || nearJump(gesture.depth_m[i])) continue;
      const double off = run.force_N[i] - epiduralForce_N(gesture.depth_m[i]);
      squares += off * off;
      most = std::max(most, std::fabs(off));
      ++count;
    }
    row.scene = "epidural-porcine";
    row.model = axialModelName(AxialModel::kPrecomputed);
    row.variant =
        fmt::format("wall of {:.0f} N/m, table of {} rows", stiffness, scene.precomputed.table.size());
    row.reference = "force polynomials per layer, fitted by their source to porcine epidural insertions";
    row.rms_error_n = std::sqrt(squares / static_cast<double>(count));
    row.max_error_n = most;
    row.noticeable_n = noticeableForce_N(12.133);
    addGreatestStep(run, row);
    row.uncertainty = fmt::format(
        "{} ticks at 3 mm/s; the table is within {:.3f} N of the polynomials, the rest is the wall's spring "
        "where the force rises steeper than {:.0f} N/m (at most 1,500, and a jump of 1.4 N at 20 mm); ",
        count, kEpiduralTableError_N, stiffness);
    row.uncertainty += addTickTime(model, gesture, row);
    row.cannot_show =
        "the polynomials' own error against the insertions, which their source does not give; the "
        "withdrawal; forces "
        "above 10 N on a Desktop, whose gate cuts them";
    rows.push_back(row);
  }
  return rows;
}

Result<RecordedPicture> epiduralPicture() {
  SceneSpec scene = fittedSceneBase();
  scene.axial_model = AxialModel::kPrecomputed;
  scene.effects = bitOf(Effect::kCutting);
  scene.layers.push_back({});
  scene.layers[0].thickness_m = 0.06;
  scene.precomputed.table = epiduralTable(kEpiduralTableError_N);
  const StraightGesture gesture = constantSpeed(-1.5e-5, 0.0569, 0.003, 100);
  std::vector<double> depth_mm, force_N;
  for (const double d : gesture.depth_m) {
    depth_mm.push_back(d * 1e3);
    force_N.push_back(epiduralForce_N(d));
  }
  PlotBlocks data;
  data.columns("law", {depth_mm, force_N});
  std::vector<std::pair<std::string, std::vector<double>>> csv = {{"depth_mm", depth_mm},
                                                                  {"polynomial_n", force_N}};
  std::vector<std::string> legend;
  for (const double stiffness : {500.0, 1000.0}) {
    scene.tracking_wall.stiffness_N_per_m = stiffness;
    ASSIGN_OR_RETURN(const auto run, runStraight(scene, gesture));
    double squares = 0;
    for (std::size_t i = 0; i < force_N.size(); ++i) squares += std::pow(run.force_N[i] - force_N[i], 2);
    data.columns(fmt::format("wall {}", legend.size()), {depth_mm, run.force_N});
    legend.push_back(fmt::format("rendered by a wall of {:.0f} N/m: {:.2f} N rms", stiffness,
                                 std::sqrt(squares / static_cast<double>(force_N.size()))));
    csv.emplace_back(fmt::format("k{:.0f}_n", stiffness), run.force_N);
  }
  // layers by a short name
  constexpr std::array<const char*, 9> kShort = {"skin",   "fat",          "muscle",
                                                 "",       "interspinous", "ligament, plateau",
                                                 "flavum", "ruptured",     "epidural space"};
  double top_mm = 0;
  for (std::size_t i = 0; i < kShort.size(); ++i) {
    const double thickness_mm = epiduralPolynomials()[i].thickness_mm;
    data.row("layers", {top_mm, thickness_mm}, {kShort[i]});
    top_mm += thickness_mm;
  }
  return RecordedPicture{"epidural_table", csvOf(csv), data.text(), {{"legend", legend}}};
}

}  // namespace needlelab
