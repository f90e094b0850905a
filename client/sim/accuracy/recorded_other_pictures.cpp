/// Pictures of the hold, the film, the statistical draws and the epidural table.
#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/recorded_epidural.h"
#include "client/sim/accuracy/recorded_film.h"
#include "client/sim/accuracy/recorded_hold.h"
#include "client/sim/accuracy/recorded_pictures.h"
#include "client/sim/accuracy/recorded_statistical.h"
#include "client/sim/accuracy/recorded_text.h"
#include "client/sim/tools/figure_table.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr const char* kShade = "#ecf0f4";
constexpr const char* kTitleFont = "font 'DejaVu Sans Bold,16' textcolor rgb '#1c2329'";

std::string titled(const std::string& title) {
  return "set label 1 " + quoted(title) + " at screen 0.5, 0.965 center " + kTitleFont + "\n";
}

// the engine's force at 100 Hz of the recording's time
struct OverTime {
  std::vector<double> t_s, force_N;
};
OverTime sampled(const StraightGesture& gesture, const AxialRun& run, double run_from_s, double from_s,
                 double to_s) {
  OverTime out;
  for (double t = from_s; t <= to_s; t += 0.01) {
    out.t_s.push_back(t);
    out.force_N.push_back(forceAtTime(gesture, run, run_from_s, t));
  }
  return out;
}

}  // namespace

Result<RecordedPicture> recordedHoldPicture(const AccuracyOptions& options) {
  const auto rows = readForceOverTime(options.data / kHoldFile);
  if (!rows.ok()) return rows.error();
  const auto even = [](int block) { return block % 2 == 0; };
  const auto exponential = fitHold(*rows, StopMode::kExponential, even);
  if (!exponential.ok()) return exponential.error();
  const auto ramp = fitHold(*rows, StopMode::kRamp, even);
  if (!ramp.ok()) return ramp.error();
  const auto out = fitWithdrawal(*rows, *exponential);
  if (!out.ok()) return out.error();

  std::vector<double> t, f;
  for (const ForceAtTime& row : *rows) {
    t.push_back(row.t_s);
    f.push_back(row.force_N);
  }
  std::vector<double> mean_t, mean_f;
  for (const CurveBin& bin : binned(t, f, kHoldBin_s, kHoldBlock_s))
    if (bin.at >= kHoldFrom_s && bin.at <= kHoldTo_s) {
      mean_t.push_back(bin.at);
      mean_f.push_back(bin.value);
    }
  const OverTime e =
      sampled(exponential->gesture, exponential->run, exponential->from_s, kHoldFrom_s, kHoldTo_s);
  const OverTime r = sampled(ramp->gesture, ramp->run, ramp->from_s, kHoldFrom_s, kHoldTo_s);
  const OverTime w = sampled(out->gesture, out->run, out->from_s, kHoldTo_s, kWithdrawalTo_s);
  std::vector<std::pair<double, double>> held_out;
  for (int block = 5; block * kHoldBlock_s < kHoldTo_s; block += 2)
    held_out.emplace_back(block * kHoldBlock_s, std::min(kHoldTo_s, (block + 1) * kHoldBlock_s));

  RecordedPicture picture{"recorded_hold", {}, {}, 1500, 950};
  picture.csv = csvOf({{"t_s", e.t_s}, {"exponential_n", e.force_N}, {"ramp_n", r.force_N}});
  picture.script =
      figureStyle() + dataBlock("recorded", {t, f}) + dataBlock("means", {mean_t, mean_f}) +
      dataBlock("e", {e.t_s, e.force_N}) + dataBlock("r", {r.t_s, r.force_N}) +
      dataBlock("w", {w.t_s, w.force_N}) + "set multiplot\n" +
      titled(formatted("An exponential stop follows a recorded hold to %.3f N, the linear ramp to %.3f N",
                       exponential->held_out.rms, ramp->held_out.rms));
  // above: the hold alone, with what was held out
  picture.script +=
      shadedSpans(held_out, 1, kShade) +
      "set lmargin at screen 0.075\nset rmargin at screen 0.985\nset tmargin at screen 0.925\nset bmargin "
      "at screen 0.50\nset xrange [2:10]\nset yrange [0.2:0.375]\nset ytics 0.05\nset ylabel 'force on the "
      "needle [N]'\nset key top right Left reverse\nset label 2 'hold; held out: every second 0.5 s "
      "(shaded)' at graph "
      "0.01, 0.06 font 'DejaVu Sans,12' textcolor rgb '#2b333b' front\n";
  picture.script +=
      "plot $recorded using 1:2 with points pt 7 ps 0.35 lc rgb '#b3bcc4' title 'recorded, digitised', "
      "$means using 1:2 with points pt 7 ps 0.8 lc rgb '#20262c' title 'its means over 0.1 s', $e using 1:2 "
      "with "
      "lines lw "
      "2.6 lc rgb '" +
      safeColour(0) +
      formatted(
          "' title 'EXPONENTIAL: %.1f s, %.2f of the force stays; error %.4f N', $r using "
          "1:2 with "
          "lines lw 2.6 dt (9,4) lc rgb '",
          exponential->relax_time_s, exponential->relax_residual, exponential->held_out.rms) +
      safeColour(1) +
      formatted("' title 'RAMP over %.1f s; error %.4f N'\n", ramp->stop_duration_s, ramp->held_out.rms);
  // below: the whole recording
  picture.script +=
      "unset object\nunset label\nset tmargin at screen 0.42\nset bmargin at screen 0.08\nset xrange "
      "[0:12]\nset yrange [-0.2:0.55]\nset ytics 0.1\nset xlabel 'time [s]'\nset arrow 1 from 0,0 to 12,0 "
      "nohead ls 6\nset label 3 'insertion' at 0.6,0.42 center\nset label 4 'hold' at 5.5,0.36 "
      "center\nset label 5 'withdrawal' at 10.9,0.42 center\n";
  picture.script +=
      "plot $recorded using 1:2 with points pt 7 ps 0.3 lc rgb '#9aa4ad' notitle, $e using 1:2 with lines "
      "lw 2.4 lc rgb '" +
      safeColour(0) + "' notitle, $w using 1:2 with lines lw 2.4 lc rgb '" + safeColour(2) +
      formatted(
          "' title 'withdrawal with one attracted force of %.3f N: error %.3f N; its displacement is "
          "unknown'\nunset multiplot\n",
          out->attracted_force_N, out->held_out.rms);
  return picture;
}

Result<RecordedPicture> recordedFilmPicture(const AccuracyOptions& options) {
  const auto traces = readFilmTraces(options.data / kFilmFile);
  if (!traces.ok()) return traces.error();
  const auto forces = filmForcesOf(*traces);
  if (!forces.ok()) return forces.error();

  RecordedPicture picture{"recorded_film", {}, {}, 1300, 850};
  std::string script = figureStyle() + "set multiplot\n";
  std::vector<double> d, measured, measured_sd, predicted, predicted_sd, z;
  double greatest_z = 0;
  for (const bool stated : {false, true}) {
    const auto set = stated ? statedFilmForces() : *forces;
    std::vector<std::vector<double>> m(3), p(3);
    std::string plots;
    script += "unset label\n";
    for (std::size_t i = 0; i < set.size(); ++i) {
      const FilmForce &a = set[(i + 1) % 3], &b = set[(i + 2) % 3];
      const FilmPrediction prediction = predictFilmForce(set[i], a, b);
      const double x = set[i].diameter_m * 1e3;
      m[0].push_back(x);
      m[1].push_back(set[i].mean_N);
      m[2].push_back(set[i].sd_N);
      p[0].push_back(x * 1.012);  // beside, so that bars do not cover each other
      p[1].push_back(prediction.predicted_N);
      p[2].push_back(prediction.predicted_sd_N);
      d.push_back(set[i].diameter_m);
      measured.push_back(set[i].mean_N);
      measured_sd.push_back(set[i].sd_N);
      predicted.push_back(prediction.predicted_N);
      predicted_sd.push_back(prediction.predicted_sd_N);
      z.push_back(prediction.z);
      greatest_z = std::max(greatest_z, std::fabs(prediction.z));
      // the law of the two others
      const double scale = a.mean_N / std::pow(a.diameter_m * 1e3, prediction.exponent);
      plots +=
          formatted(", %.6g*x**%.6g with lines lw 1.8 dt (6,4) lc rgb '%s' title '%s left out: z = %+.2f'",
                    scale, prediction.exponent,
                    safeColour(i == 0   ? 0
                               : i == 1 ? 2
                                        : 3)
                        .c_str(),
                    set[i].needle.c_str(), prediction.z);
      script += formatted("set label %zu '%s' at %.4f, graph 0.03 center font 'DejaVu Sans,12'\n", 20 + i,
                          set[i].needle.c_str(), x);
    }
    const std::string suffix = stated ? "s" : "t";
    script += dataBlock("m" + suffix, m) + dataBlock("p" + suffix, p);
    script += formatted(
        "set lmargin at screen %.3f\nset rmargin at screen %.3f\nset tmargin at screen 0.84\nset bmargin at "
        "screen 0.10\n",
        stated ? 0.56 : 0.085, stated ? 0.985 : 0.51);
    if (!stated) script += "@TITLE@";
    script += std::string("set label 2 '") +
              (stated ? "means and sd as the source states them" : "peaks of the five recorded traces") +
              "' at graph 0.5, 1.03 center font 'DejaVu Sans,12' textcolor rgb '#2b333b'\n";
    script +=
        "set logscale xy\nset xrange [0.7:1.95]\nset yrange [0.1:0.9]\nset xtics (0.8,1,1.25,1.6)\nset ytics "
        "(0.1,0.15,0.2,0.3,0.4,0.5,0.7)\nset xlabel 'outer diameter [mm]'\nset key top left Left reverse\n";
    script += stated ? "unset ylabel\n" : "set ylabel 'puncture force [N]'\n";
    script += "plot $m" + suffix + " using 1:2:3 with yerrorbars pt 7 ps 1.3 lw 2 lc rgb '" + safeColour(6) +
              "' title 'measured, ±1 sd', $p" + suffix +
              " using 1:2:3 with yerrorbars pt 4 ps 1.4 lw 2 lc rgb '" + safeColour(1) +
              "' title 'predicted from the two others, ±1 sd'" + plots + "\n";
  }
  const std::string title = titled(formatted(
      "Each needle is predicted by the power law of the two others, |z| ≤ %.2f: not contradicted, not proven",
      greatest_z));
  script.replace(script.find("@TITLE@"), 7, title);
  picture.csv = csvOf({{"diameter_m", d},
                       {"measured_n", measured},
                       {"measured_sd_n", measured_sd},
                       {"predicted_n", predicted},
                       {"predicted_sd_n", predicted_sd},
                       {"z", z}});
  picture.script = script + "unset multiplot\n";
  return picture;
}

Result<RecordedPicture> statisticalPicture() {
  const StatisticalSpec spec = syntheticStatistics();
  SceneSpec scene = fittedSceneBase();
  scene.axial_model = AxialModel::kStatistical;
  scene.effects = bitOf(Effect::kCutting);
  scene.tracking_wall.stiffness_N_per_m = 1000;
  scene.layers.push_back({});
  scene.layers[0].thickness_m = 0.5;

  RecordedPicture picture{"statistical_draws", {}, {}, 1400, 800};
  std::vector<double> x, mean, low, high;
  for (double d = 0; d <= 0.03; d += 1e-4) {
    const ForceLaw law = forceLawAt(spec, d);
    const ForceBand band = centralBand95(law.mean_N, law.sd_N);
    x.push_back(d * 1e3);
    mean.push_back(law.mean_N);
    low.push_back(band.low_N);
    high.push_back(band.high_N);
  }
  std::string script = figureStyle() + dataBlock("law", {x, mean, low, high}), plots;
  constexpr int kShown = 40;
  for (int i = 0; i < kShown; ++i) {
    scene.statistical = spec;
    scene.statistical.seed = spec.seed + static_cast<std::uint64_t>(i);
    const StraightGesture gesture = constantSpeed(-1e-5, 0.03, 0.003, 100);
    const auto run = runStraight(scene, gesture);
    if (!run.ok()) return run.error();
    std::vector<double> depth_mm;
    for (const double d : gesture.depth_m) depth_mm.push_back(d * 1e3);
    script += dataBlock(formatted("draw%d", i), {depth_mm, run->force_N});
    plots += formatted(", $draw%d using 1:2 with lines lw %s lc rgb '%s' %s", i, i < 3 ? "2.2" : "0.8",
                       i < 3 ? safeColour(static_cast<std::size_t>(i)).c_str() : "#707d8790",
                       i == 0   ? "title 'three insertions'"
                       : i == 3 ? "title 'others'"
                                : "notitle");
  }
  const auto draws = drawStatistical(spec, {0.002, 0.0075, 0.015, 0.022, 0.0265}, 10'000, 1000);
  if (!draws.ok()) return draws.error();
  double least = 1, most = 0;
  std::vector<double> at, drawn, drawn_sd, in_band;
  for (const DrawnAtDepth& one : draws->depths) {
    least = std::min(least, one.in_band);
    most = std::max(most, one.in_band);
    at.push_back(one.depth_m);
    drawn.push_back(one.drawn.mean_N);
    drawn_sd.push_back(one.drawn.sd_N);
    in_band.push_back(one.in_band);
  }
  picture.csv = csvOf({{"depth_m", at}, {"mean_n", drawn}, {"sd_n", drawn_sd}, {"share_in_band", in_band}});
  script += titled(formatted(
      "Statistical insertions keep to their law: %.1f to %.1f %% of 10,000 draws lie in the 95 %% band",
      100 * least, 100 * most));
  script +=
      "set tmargin at screen 0.92\nset lmargin at screen 0.075\nset rmargin at screen 0.985\nset xrange "
      "[0:30]\nset yrange [0:5.2]\nset xlabel 'depth [mm]'\nset ylabel 'force on the needle [N]'\nset key "
      "top "
      "left Left reverse\nplot $law using 1:3:4 with filledcurves fc rgb '#d7e6f2' title 'central 95 % of "
      "the law "
      "(synthetic "
      "numbers)'" +
      plots + ", $law using 1:2 with lines lw 2.4 dt (9,4) lc rgb '" + safeColour(6) +
      "' title 'mean of the law'\n";
  picture.script = script;
  return picture;
}

Result<RecordedPicture> epiduralPicture() {
  RecordedPicture picture{"epidural_table", {}, {}, 1400, 800};
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
  std::string script = figureStyle() + dataBlock("law", {depth_mm, force_N}), plots;
  std::vector<std::pair<std::string, std::vector<double>>> csv = {{"depth_mm", depth_mm},
                                                                  {"polynomial_n", force_N}};
  std::size_t colour = 0;
  for (const double stiffness : {500.0, 1000.0}) {
    scene.tracking_wall.stiffness_N_per_m = stiffness;
    const auto run = runStraight(scene, gesture);
    if (!run.ok()) return run.error();
    const std::string name = formatted("k%.0f", stiffness);
    double squares = 0;
    for (std::size_t i = 0; i < force_N.size(); ++i) squares += std::pow(run->force_N[i] - force_N[i], 2);
    script += dataBlock(name, {depth_mm, run->force_N});
    plots += ", $" + name + " using 1:2 with lines lw 2.4 lc rgb '" + safeColour(colour++) +
             formatted("' title 'rendered by a wall of %.0f N/m: %.2f N rms'", stiffness,
                       std::sqrt(squares / static_cast<double>(force_N.size())));
    csv.emplace_back(name + "_n", run->force_N);
  }
  picture.csv = csvOf(csv);
  // layers by name, shaded in turn
  double top_mm = 0;
  std::vector<std::pair<double, double>> shades;
  int i = 0;
  constexpr std::array<const char*, 9> kShort = {"skin",   "fat",          "muscle",
                                                 "",       "interspinous", "ligament, plateau",
                                                 "flavum", "ruptured",     "epidural space"};
  for (const ForcePolynomial& layer : epiduralPolynomials()) {
    if (i % 2 == 0) shades.emplace_back(top_mm, top_mm + layer.thickness_mm);
    script += formatted(
        "set label %d '%s' at %.2f, graph 0.035 %s front font 'DejaVu Sans,10' textcolor rgb '#2b333b'\n",
        20 + i, kShort[static_cast<std::size_t>(i)], top_mm + (i == 0 ? 0.75 : 0.5) * layer.thickness_mm,
        layer.thickness_mm < 4 ? "rotate by 90 left" : "center");
    top_mm += layer.thickness_mm;
    ++i;
  }
  script += shadedSpans(shades, 1, kShade) + titled(
                                                 "A needle's measured force rises faster than a haptic "
                                                 "device can: the wall's spring is the limit, not "
                                                 "the table");
  script +=
      "set tmargin at screen 0.92\nset lmargin at screen 0.075\nset rmargin at screen 0.985\nset xrange "
      "[0:57]\nset yrange [0:14]\nset xlabel 'depth [mm]'\nset ylabel 'force on the needle [N]'\nset key top "
      "left Left reverse\nset arrow 1 from 0,10 to 57,10 nohead ls 6\nset label 40 'peak of the Desktop, 10 "
      "N' at 32,10.35 "
      "center font 'DejaVu Sans,11' textcolor rgb '#7d8790'\nplot $law using 1:2 with lines lw 2 dt (7,4) lc "
      "rgb '" +
      safeColour(6) + "' title 'polynomials of porcine epidural insertions'" + plots + "\n";
  picture.script = script;
  return picture;
}

}  // namespace needlelab
