#include "client/sim/curves/curve_models.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/curves/baseline.h"
#include "client/sim/curves/curve_fit.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {
namespace {

constexpr double kThinLayer_m = 0.0005, kTableStep_m = 0.001;
constexpr double kWallStiffness_N_per_m = 1000;  // the maximum that the Desktop renders
constexpr double kMaxForce_N = 20;
constexpr double kMinDrop_N = 0.3;
constexpr double kThinnest_m = 1e-4;

// Where the force first stays above 5 % of its maximum: the needle is in contact.
double contactDepth(const std::vector<CurveBin>& bins) {
  double max_N = 0;
  for (const CurveBin& bin : bins) max_N = std::max(max_N, bin.value);
  double contact_m = bins.front().at;
  for (const CurveBin& bin : bins) {
    if (bin.value > 0.05 * max_N) break;
    contact_m = bin.at;
  }
  return contact_m;
}

CurveScene emptyScene(AxialModel model) {
  CurveScene scene{fittedSceneBase(), 0};
  scene.spec.axial_model = model;
  scene.spec.effects = bitOf(Effect::kCutting);
  scene.spec.tracking_wall.stiffness_N_per_m = kWallStiffness_N_per_m;
  return scene;
}

LayerSpec layerOf(double thickness_m, double cutting_N) {
  LayerSpec layer;
  layer.thickness_m = thickness_m;
  layer.cutting_force_N = cutting_N;
  return layer;
}

FitParameter forceParameter(const std::string& name, double start_N) {
  const double held = std::clamp(start_N, 0.0, kMaxForce_N);
  return {name, held, 0, kMaxForce_N, std::max(0.02, 0.1 * held)};
}

std::string counted(std::size_t count, const char* one) {
  return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
}

std::string nth(const char* name, std::size_t i) {
  return fmt::format("{}{}", name, i);
}

// Adds the parameters of a top from a piece of the curve: where it is pierced, how far it was stretched by
// then, and the force there.
void addTop(CurveModel& made, std::size_t i, const CurvePiece& piece, const char* force_name) {
  const double length_m = piece.rupture_m - piece.top_m;
  made.parameters.push_back({nth("rupture_m ", i), piece.rupture_m, 0, 0.9, 0.0005});
  made.parameters.push_back({nth("stretch_m ", i), length_m, kThinnest_m, 0.1, 0.2 * length_m});
  made.parameters.push_back(forceParameter(nth(force_name, i), piece.peak_N - piece.before_N));
}

// Also the share of that force that is linear in the stretch (the rest is quadratic), and the cutting force
// after it.
void addQuadraticTop(CurveModel& made, std::size_t i, const CurvePiece& piece, const char* force_name,
                     double min_share) {
  addTop(made, i, piece, force_name);
  made.parameters.push_back({nth("linear share ", i), 0.3, min_share, 1, 0.2});
  made.parameters.push_back(forceParameter(nth("cutting_n ", i), piece.after_N));
}

constexpr std::size_t kTopNumbers = 5;  // added by addQuadraticTop

// The top given by these numbers, starting at `values[at]`.
struct FittedTop {
  double top_m, force_N, linear_N_per_m, quadratic_N_per_m2, cutting_N;
};
FittedTop quadraticTop(const std::vector<double>& values, std::size_t at) {
  const double z_m = values[at + 1], force_N = std::max(1e-4, values[at + 2]), share = values[at + 3];
  return {values[at] - z_m, force_N, share * force_N / z_m, (1 - share) * force_N / (z_m * z_m),
          values[at + 4]};
}

// Layer i lies between tops[i] and the next; tops are sorted and at least 0.1 mm apart.
void setThicknesses(CurveScene& scene, std::vector<double> tops_m) {
  for (std::size_t i = 1; i < tops_m.size(); ++i)
    tops_m[i] = std::max(tops_m[i], tops_m[i - 1] + kThinnest_m);
  scene.surface_m = tops_m.front();
  for (std::size_t i = 0; i < tops_m.size(); ++i)
    scene.spec.layers[i].thickness_m = i + 1 < tops_m.size() ? tops_m[i + 1] - tops_m[i] : 0.05;
}

// Tops of layers: cuts the curve repeatedly where that reduces the squares about the parts' means most, until
// it has `most` layers or no cut gains a hundredth of a newton.
std::vector<double> layerTops(const std::vector<CurveBin>& bins, std::size_t most) {
  struct Part {
    std::size_t from, to;  // bins
  };
  const auto squares = [&](std::size_t from, std::size_t to) {
    double sum = 0, square = 0;
    for (std::size_t i = from; i < to; ++i) {
      sum += bins[i].value;
      square += bins[i].value * bins[i].value;
    }
    return square - sum * sum / static_cast<double>(to - from);
  };
  std::vector<Part> parts = {{0, bins.size()}};
  while (parts.size() < most) {
    double best_gain = 1e-4;
    std::size_t best_part = 0, best_cut = 0;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const double whole = squares(parts[p].from, parts[p].to);
      for (std::size_t cut = parts[p].from + 1; cut < parts[p].to; ++cut) {
        // both parts must be thick enough to feel
        if (bins[cut].at - bins[parts[p].from].at < kThinLayer_m ||
            bins[parts[p].to - 1].at - bins[cut].at < kThinLayer_m)
          continue;
        const double gain = whole - squares(parts[p].from, cut) - squares(cut, parts[p].to);
        if (gain > best_gain) {
          best_gain = gain;
          best_part = p;
          best_cut = cut;
        }
      }
    }
    if (best_cut == 0) break;
    parts.insert(parts.begin() + static_cast<std::ptrdiff_t>(best_part) + 1, {best_cut, parts[best_part].to});
    parts[best_part].to = best_cut;
  }
  std::vector<double> tops_m;
  for (const Part& part : parts)
    tops_m.push_back(part.from == 0 ? 0 : 0.5 * (bins[part.from - 1].at + bins[part.from].at));
  return tops_m;
}

}  // namespace

std::vector<Rupture> findRuptures(const std::vector<CurveBin>& bins, double min_drop_N) {
  std::vector<Rupture> ruptures;
  if (bins.empty()) return ruptures;
  Rupture now{bins.front().at, bins.front().value, bins.front().value, bins.front().at};
  bool falling = false;
  for (const CurveBin& bin : bins) {
    if (bin.value < now.valley_N) {
      now.valley_N = bin.value;
      now.valley_m = bin.at;
    }
    if (now.peak_N - now.valley_N > min_drop_N) falling = true;
    // a rise by a third of the minimum fall ends a rupture; before a rupture it means a new peak
    const bool rises = bin.value > now.valley_N + min_drop_N / 3;
    if (falling && rises) ruptures.push_back(now);
    if (bin.value > now.peak_N || (falling && rises)) {
      now = {bin.at, bin.value, bin.value, bin.at};
      falling = false;
    }
  }
  if (falling) ruptures.push_back(now);
  return ruptures;
}

std::vector<CurvePiece> curvePieces(const std::vector<CurveBin>& bins, std::size_t most) {
  // the minimum fall that leaves few enough ruptures
  double min_drop_N = kMinDrop_N;
  std::vector<Rupture> ruptures = findRuptures(bins, min_drop_N);
  while (ruptures.size() > most) {
    min_drop_N *= 1.05;
    ruptures = findRuptures(bins, min_drop_N);
  }
  std::vector<CurvePiece> pieces;
  double top_m = contactDepth(bins), before_N = 0;
  for (const Rupture& rupture : ruptures) {
    pieces.push_back(
        {top_m, std::max(rupture.depth_m, top_m + kThinnest_m), rupture.peak_N, before_N, rupture.valley_N});
    top_m = rupture.valley_m;
    before_N = rupture.valley_N;
  }
  // a curve without ruptures is a single piece
  if (pieces.empty())
    pieces.push_back(
        {top_m, std::max(bins.back().at, top_m + kThinnest_m), bins.back().value, 0, bins.back().value});
  return pieces;
}

CurveModel layeredModel(AxialModel model, const std::vector<CurveBin>& fit_on, std::size_t max_numbers) {
  CurveModel made;
  made.model = model;
  const std::vector<double> tops_m = layerTops(fit_on, std::min(kMaxLayers, (max_numbers + 1) / 2));
  made.chosen = tops_m.size() - 1;
  made.variant = counted(tops_m.size(), "layer") + ", thinnest where the force changes most";
  for (std::size_t i = 0; i < tops_m.size(); ++i) {
    const double end_m = i + 1 < tops_m.size() ? tops_m[i + 1] : fit_on.back().at;
    made.parameters.push_back(forceParameter(
        nth("cutting_n ", i), baselineAt(Baseline::kConnectTheDots, fit_on, 0.5 * (tops_m[i] + end_m))));
  }
  made.scene = [model, tops_m](const std::vector<double>& values) {
    CurveScene scene = emptyScene(model);
    scene.spec.direct.stiffness_N_per_m = kWallStiffness_N_per_m;
    for (const double force_N : values) scene.spec.layers.push_back(layerOf(0, force_N));
    setThicknesses(scene, tops_m);
    return scene;
  };
  return made;
}

CurveModel membraneModel(const std::vector<CurveBin>& fit_on, std::size_t max_numbers) {
  CurveModel made;
  const auto pieces = curvePieces(fit_on, max_numbers / kTopNumbers);
  made.variant = "PUNCTURE: " + counted(pieces.size(), "membrane") + ", cutting behind each";
  for (std::size_t i = 0; i < pieces.size(); ++i) addQuadraticTop(made, i, pieces[i], "rupture_n ", 0);
  made.scene = [](const std::vector<double>& values) {
    CurveScene scene = emptyScene(AxialModel::kEnhancedTrackingWall);
    scene.spec.effects |= bitOf(Effect::kPuncture);
    std::vector<double> tops_m;
    for (std::size_t i = 0; i + kTopNumbers <= values.size(); i += kTopNumbers) {
      const FittedTop top = quadraticTop(values, i);
      tops_m.push_back(top.top_m);
      scene.spec.layers.push_back(layerOf(0, top.cutting_N));
      scene.spec.layers.back().membrane =
          MembraneSpec{top.linear_N_per_m, top.quadratic_N_per_m2, top.force_N};
    }
    setThicknesses(scene, tops_m);
    return scene;
  };
  return made;
}

CurveModel lineModel(AxialModel model, const std::vector<CurveBin>& fit_on) {
  CurveModel made;
  made.model = model;
  made.variant = "one line from the contact on";
  const double contact_m = contactDepth(fit_on), reach_m = std::max(1e-3, fit_on.back().at - contact_m);
  const double stiffness = std::clamp(fit_on.back().value / reach_m, 1.0, 1000.0);
  made.parameters = {{"surface_m", contact_m, 0, 0.9, 0.002},
                     {"stiffness_n_per_m", stiffness, 0.1, 1000, 0.2 * stiffness}};
  if (model == AxialModel::kVoigt) made.parameters.push_back({"damping_ns_per_m", 5, 0, 100, 5});
  made.scene = [model](const std::vector<double>& values) {
    CurveScene scene = emptyScene(model);
    scene.surface_m = values[0];
    scene.spec.layers.push_back(layerOf(0.1, 1));
    scene.spec.direct.stiffness_N_per_m = scene.spec.voigt.stiffness_N_per_m = values[1];
    scene.spec.direct.step_at_layers = false;
    if (values.size() > 2) scene.spec.voigt.damping_Ns_per_m = values[2];
    return scene;
  };
  return made;
}

CurveModel godObjectModel(const std::vector<CurveBin>& fit_on, std::size_t max_numbers) {
  CurveModel made;
  made.model = AxialModel::kGodObject;
  const auto pieces = curvePieces(fit_on, (max_numbers - 1) / 2);
  made.variant = counted(pieces.size(), "top") + ", one per rupture";
  // one slope for all pieces, by least squares
  double force_length = 0, length_squared = 0;
  for (const CurvePiece& piece : pieces) {
    const double length_m = piece.rupture_m - piece.top_m;
    force_length += piece.peak_N * length_m;
    length_squared += length_m * length_m;
  }
  const double slope = std::clamp(force_length / length_squared, 1.0, 1000.0);
  made.parameters.push_back({"stiffness_n_per_m", slope, 0.1, 1000, 0.2 * slope});
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    made.parameters.push_back({nth("top_m ", i), pieces[i].top_m, 0, 0.9, 0.001});
    made.parameters.push_back({nth("rupture_m ", i), pieces[i].rupture_m, 0, 0.9, 0.0005});
  }
  made.scene = [](const std::vector<double>& values) {
    CurveScene scene = emptyScene(AxialModel::kGodObject);
    scene.spec.god_object.stiffness_N_per_m = values[0];
    std::vector<double> tops_m;
    for (std::size_t i = 1; i + 1 < values.size(); i += 2) {
      // The proxy passes when the spring reaches the layer's force: position and slope are easier to fit than
      // force and slope.
      const double force_N = values[0] * std::max(0.0, values[i + 1] - values[i]);
      tops_m.push_back(values[i]);
      scene.spec.layers.push_back(layerOf(0, std::min(force_N, kMaxForce_N)));
    }
    setThicknesses(scene, tops_m);
    return scene;
  };
  return made;
}

CurveModel firstOrderModel(const std::vector<CurveBin>& fit_on, std::size_t max_numbers) {
  CurveModel made;
  made.model = AxialModel::kFirstOrder;
  const auto pieces = curvePieces(fit_on, max_numbers / 5);
  made.variant = counted(pieces.size(), "layer") +
                 ", one per rupture; without Okamura's viscous (Karnopp) friction and quadratic stiffness";
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    addTop(made, i, pieces[i], "puncture_n ");
    made.parameters.push_back(forceParameter(nth("cutting_n ", i), pieces[i].after_N));
    made.parameters.push_back({nth("friction_n_per_m ", i), 1, 0, 500, 2});
  }
  made.scene = [](const std::vector<double>& values) {
    CurveScene scene = emptyScene(AxialModel::kFirstOrder);
    std::vector<double> tops_m;
    for (std::size_t i = 0; i + 4 < values.size(); i += 5) {
      tops_m.push_back(values[i] - values[i + 1]);
      scene.spec.layers.push_back(layerOf(0, 0));
      FirstOrderSpec first;
      first.puncture_force_N = std::max(1e-4, values[i + 2]);
      first.stiffness_N_per_m = std::min(1000.0, first.puncture_force_N / values[i + 1]);
      first.cutting_force_N = values[i + 3];
      first.friction_N_per_m = values[i + 4];
      scene.spec.layers.back().first_order = first;
    }
    setThicknesses(scene, tops_m);
    return scene;
  };
  return made;
}

CurveModel okamuraModel(AxialModel model, const std::vector<CurveBin>& fit_on, std::size_t max_numbers) {
  constexpr std::size_t kShared = 2;
  CurveModel made;
  made.model = model;
  const auto pieces = curvePieces(fit_on, std::max<std::size_t>(1, (max_numbers - kShared) / kTopNumbers));
  made.variant = counted(pieces.size(), "layer") + ", one per rupture";
  made.parameters = {{"kinetic_n_per_m", 1, 0, 500, 2}, {"viscous_ns_per_m2", 10, 0, 1e5, 50}};
  for (std::size_t i = 0; i < pieces.size(); ++i) addQuadraticTop(made, i, pieces[i], "puncture_n ", 0.01);
  made.scene = [model](const std::vector<double>& values) {
    CurveScene scene = emptyScene(model);
    scene.spec.tracking_wall.stop_speed_mps = 5e-5;  // slower than any recording, so the needle slips
    std::vector<double> tops_m;
    for (std::size_t i = kShared; i + kTopNumbers <= values.size(); i += kTopNumbers) {
      const FittedTop top = quadraticTop(values, i);
      tops_m.push_back(top.top_m);
      scene.spec.layers.push_back(layerOf(0, 0));
      OkamuraSpec own;
      own.puncture_force_N = top.force_N;
      own.linear_N_per_m = std::min(1000.0, top.linear_N_per_m);
      own.quadratic_N_per_m2 = top.quadratic_N_per_m2;
      own.cutting_force_N = top.cutting_N;
      own.in = own.out = {values[0], values[0], values[1]};
      scene.spec.layers.back().okamura = own;
    }
    setThicknesses(scene, tops_m);
    return scene;
  };
  return made;
}

CurveModel tableModel(const std::vector<CurveBin>& fit_on, std::size_t max_numbers) {
  CurveModel made;
  made.model = AxialModel::kPrecomputed;
  const double deepest_m = std::max(fit_on.back().at, kTableStep_m);
  const auto whole = static_cast<std::size_t>(std::floor(deepest_m / kTableStep_m)) + 1;
  const std::size_t rows = std::min(whole, max_numbers);
  const double step_m = rows < whole ? deepest_m / static_cast<double>(rows - 1) : kTableStep_m;
  made.variant = fmt::format("table of {} rows, {:.3g} mm apart", rows, step_m * 1e3);
  for (std::size_t i = 0; i < rows; ++i)
    made.parameters.push_back(
        forceParameter(nth("cutting_n ", i),
                       baselineAt(Baseline::kConnectTheDots, fit_on, static_cast<double>(i) * step_m)));
  made.scene = [step_m](const std::vector<double>& values) {
    CurveScene scene = emptyScene(AxialModel::kPrecomputed);
    scene.spec.layers.push_back(layerOf(0.1, 0));
    for (std::size_t i = 0; i < values.size(); ++i)
      scene.spec.precomputed.table.push_back({static_cast<double>(i) * step_m, values[i], 0});
    return scene;
  };
  return made;
}

std::vector<CurveModel> curveModels(const std::vector<CurveBin>& fit_on, std::size_t max_numbers) {
  return {layeredModel(AxialModel::kEnhancedTrackingWall, fit_on, max_numbers),
          membraneModel(fit_on, max_numbers),
          layeredModel(AxialModel::kTrackingWall, fit_on, max_numbers),
          layeredModel(AxialModel::kDirect, fit_on, max_numbers),
          lineModel(AxialModel::kVoigt, fit_on),
          godObjectModel(fit_on, max_numbers),
          firstOrderModel(fit_on, max_numbers),
          okamuraModel(AxialModel::kOkamura, fit_on, max_numbers),
          okamuraModel(AxialModel::kDahl, fit_on, max_numbers),
          tableModel(fit_on, max_numbers)};
}

}  // namespace needlelab
