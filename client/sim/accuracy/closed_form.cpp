#include "client/sim/accuracy/closed_form.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace needlelab {
namespace {

constexpr std::size_t kLayers = 3;
constexpr double kThick_m = 0.01, kWall_N_per_m = 500, kAttracted_N = 1;
constexpr std::array<double, kLayers> kCutting_N = {2, 3, 4};
// FIRST_ORDER, OKAMURA, DAHL: a top gives way at a stretch of `kHeld_m`
constexpr std::array<double, kLayers> kHeld_m = {0.002, 0.003, 0.004};
constexpr double kLinear_N_per_m = 300, kQuadratic_N_per_m2 = 40'000;
constexpr std::array<double, kLayers> kBehind_N = {0.5, 0.8, 1.2};
constexpr double kRubIn_N_per_m = 20, kRubOut_N_per_m = 30, kShaft_N_per_m = 140;
constexpr double kTableIn_N_per_m = 150, kTableOut_N_per_m = 50;
constexpr double kDamping_Ns_per_m = 5;

std::size_t layerAt(double x_m) {
  return std::min(kLayers - 1, static_cast<std::size_t>(x_m / kThick_m));
}
double topOf(std::size_t layer) {
  return static_cast<double>(layer) * kThick_m;
}

// "Tracking wall": on the way in each distance stretches the spring, up to the layer's limit
double wallStretchIn_m(double x_m) {
  double z_m = 0;
  for (std::size_t i = 0; i <= layerAt(x_m); ++i)
    z_m = std::min(z_m + std::min(x_m, topOf(i + 1)) - topOf(i), kCutting_N[i] / kWall_N_per_m);
  return z_m;
}
// On the way out the spring relaxes, then pulls with up to the attracted force, which fades out at the skin.
double wall_N(const TurnGesture& gesture, double x_m, bool out, double attracted_N) {
  if (!out) return -kWall_N_per_m * wallStretchIn_m(x_m);
  const double z_m = wallStretchIn_m(gesture.deepest_m) - (gesture.deepest_m - x_m);
  return -kWall_N_per_m * std::max(z_m, -std::min(attracted_N / kWall_N_per_m, x_m));
}

double topForce_N(double z_m, double quadratic_N_per_m2) {
  return kLinear_N_per_m * z_m + quadratic_N_per_m2 * z_m * z_m;
}

// "Axial models": state of the three models with tops
struct BehindTops {
  double held_N = 0;  // by this layer's top
  double cut_m = 0;   // stretch of the cutting wall
  double free_m = 0;  // x_c: no cutting or friction beyond a top that still holds
};
BehindTops behindTops(double x_m, double quadratic_N_per_m2) {
  BehindTops now;
  for (std::size_t i = 0; i <= layerAt(x_m); ++i) {
    const double passed_m = std::min(x_m, topOf(i + 1)) - topOf(i);
    now.free_m = topOf(i);
    now.held_N = passed_m < kHeld_m[i] ? topForce_N(passed_m, quadratic_N_per_m2) : 0;
    if (passed_m < kHeld_m[i]) continue;
    // the walls move with a rupture; only the distance after it stretches them
    now.cut_m = std::min(now.cut_m + passed_m - kHeld_m[i], kBehind_N[i] / kWall_N_per_m);
    now.free_m = topOf(i) + passed_m;
  }
  return now;
}

// Cutting on the way out; zero once the spring has relaxed.
double cuttingOut_N(const TurnGesture& gesture, double x_m, double quadratic_N_per_m2) {
  const double cut_m = behindTops(gesture.deepest_m, quadratic_N_per_m2).cut_m;
  return -kWall_N_per_m * std::max(0.0, cut_m - (gesture.deepest_m - x_m));
}

// Coulomb friction by a dragged spring: full on the way in, except while a top holds.
double rubbedIn_m(double x_m) {
  double z_m = 0;
  for (std::size_t i = 0; i <= layerAt(x_m); ++i) {
    const double passed_m = std::min(x_m, topOf(i + 1)) - topOf(i);
    if (passed_m < kHeld_m[i]) continue;
    const double reach_m = kRubIn_N_per_m * (topOf(i) + passed_m) / kShaft_N_per_m;
    z_m = std::min(z_m + passed_m - kHeld_m[i], reach_m);
  }
  return z_m;
}
double coulomb_N(const TurnGesture& gesture, double x_m, bool out, double rub_out_N_per_m) {
  if (!out) return -kShaft_N_per_m * rubbedIn_m(x_m);
  const double z_m = rubbedIn_m(gesture.deepest_m) - (gesture.deepest_m - x_m);
  return -kShaft_N_per_m * std::max(z_m, -rub_out_N_per_m * x_m / kShaft_N_per_m);
}

// Dahl: dz/dx = 1 − q z/x in, with q = K_f/friction: z = x/(1 + q) + C x^−q.
double dahlIn_m(double x_m) {
  constexpr double q = kShaft_N_per_m / kRubIn_N_per_m;
  double z_m = 0;
  for (std::size_t i = 0; i <= layerAt(x_m); ++i) {
    const double from_m = topOf(i) + kHeld_m[i], to_m = std::min(x_m, topOf(i + 1));
    if (to_m < from_m) continue;
    z_m = to_m / (1 + q) + (z_m - from_m / (1 + q)) * std::pow(to_m / from_m, -q);
  }
  return z_m;
}
// Out: dz/dx = 1 + q z/x while z > 0, then with the outward friction: z = C x^q − x/(q − 1).
double dahl_N(const TurnGesture& gesture, double x_m, bool out) {
  if (!out) return -kShaft_N_per_m * dahlIn_m(x_m);
  constexpr double q = kShaft_N_per_m / kRubIn_N_per_m, r = kShaft_N_per_m / kRubOut_N_per_m;
  const double deepest_m = gesture.deepest_m;
  const double turned = (dahlIn_m(deepest_m) + deepest_m / (q - 1)) / std::pow(deepest_m, q);
  const double zero_m = std::pow(1 / ((q - 1) * turned), 1 / (q - 1));  // where z = 0
  if (x_m > zero_m) return -kShaft_N_per_m * (turned * std::pow(x_m, q) - x_m / (q - 1));
  const double z_m = (zero_m * std::pow(x_m / zero_m, r) - x_m) / (r - 1);
  return -kShaft_N_per_m * std::max(z_m, -x_m / r);
}

SceneSpec layersOf(AxialModel model) {
  SceneSpec scene;
  scene.axial_model = model;
  scene.needle_length_m = 1;
  scene.max_force_N = 50;
  scene.effects = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);
  scene.tracking_wall.stiffness_N_per_m = kWall_N_per_m;
  // slower than any gesture here: reversing does not count as a stop
  scene.tracking_wall.stop_speed_mps = 1e-4;
  scene.friction_stiffness_N_per_m = kShaft_N_per_m;
  for (std::size_t i = 0; i < kLayers; ++i) {
    LayerSpec layer;
    layer.thickness_m = kThick_m;
    layer.cutting_force_N = kCutting_N[i];
    layer.attracted_force_N = kAttracted_N;
    layer.first_order =
        FirstOrderSpec{kLinear_N_per_m, topForce_N(kHeld_m[i], 0), kBehind_N[i], kRubIn_N_per_m};
    OkamuraSpec own;
    own.linear_N_per_m = kLinear_N_per_m;
    own.quadratic_N_per_m2 = kQuadratic_N_per_m2;
    own.puncture_force_N = topForce_N(kHeld_m[i], kQuadratic_N_per_m2);
    own.cutting_force_N = kBehind_N[i];
    own.in = {kRubIn_N_per_m, kRubIn_N_per_m, 0};
    own.out = {kRubOut_N_per_m, kRubOut_N_per_m, 0};
    layer.okamura = own;
    scene.layers.push_back(layer);
  }
  scene.direct.stiffness_N_per_m = scene.voigt.stiffness_N_per_m = scene.god_object.stiffness_N_per_m =
      kWall_N_per_m;
  scene.voigt.damping_Ns_per_m = kDamping_Ns_per_m;
  scene.precomputed.table = {{0, 0, 0}, {0.1, 0.1 * kTableIn_N_per_m, 0.1 * kTableOut_N_per_m}};
  return scene;
}

double voigt_N(const TurnGesture& gesture, double x_m, bool out) {
  const double speed_mps = out ? -gesture.speed_mps : gesture.speed_mps;
  return std::min(0.0, -kWall_N_per_m * x_m - kDamping_Ns_per_m * speed_mps);
}

std::vector<ClosedForm> makeClosedForms() {
  constexpr char kNoStop[] = "the stop, which a turn at once does not begin";
  const auto scene = [](AxialModel model) { return layersOf(model); };
  std::vector<ClosedForm> forms;
  forms.push_back({AxialModel::kEnhancedTrackingWall, "", scene(AxialModel::kEnhancedTrackingWall),
                   [](const TurnGesture& g, double x, bool out) { return wall_N(g, x, out, kAttracted_N); },
                   kNoStop});
  forms.push_back({AxialModel::kTrackingWall, "", scene(AxialModel::kTrackingWall),
                   [](const TurnGesture& g, double x, bool out) { return wall_N(g, x, out, 0); }, kNoStop});
  forms.push_back({AxialModel::kDirect, "", scene(AxialModel::kDirect),
                   [](const TurnGesture&, double x, bool) {
                     return -std::min(kWall_N_per_m * x, kCutting_N[layerAt(x)]);
                   },
                   ""});
  forms.push_back({AxialModel::kVoigt, "", scene(AxialModel::kVoigt), voigt_N, ""});
  forms.push_back(
      {AxialModel::kVoigt, "velocity over an adaptive window", scene(AxialModel::kVoigt), voigt_N, ""});
  forms.back().scene.voigt.velocity_noise_m = 1e-5;
  // The proxy holds on a top up to the layer's force, then moves with the tip; it never pulls.
  forms.push_back({AxialModel::kGodObject, "", scene(AxialModel::kGodObject),
                   [](const TurnGesture&, double x, bool out) {
                     const std::size_t layer = out ? kLayers - 1 : layerAt(x);
                     const double force_N = kWall_N_per_m * std::max(0.0, x - topOf(layer));
                     return force_N > kCutting_N[layer] ? 0.0 : -force_N;
                   },
                   ""});
  forms.push_back({AxialModel::kFirstOrder, "", scene(AxialModel::kFirstOrder),
                   [](const TurnGesture& g, double x, bool out) {
                     const double rubs_N = coulomb_N(g, x, out, kRubIn_N_per_m);
                     if (out) return cuttingOut_N(g, x, 0) + rubs_N;
                     const BehindTops now = behindTops(x, 0);
                     return -now.held_N - kWall_N_per_m * now.cut_m + rubs_N;
                   },
                   ""});
  forms.push_back({AxialModel::kPrecomputed, "", scene(AxialModel::kPrecomputed),
                   [](const TurnGesture& g, double x, bool out) {
                     if (!out) return -kTableIn_N_per_m * x;
                     const double z_m = kTableIn_N_per_m * g.deepest_m / kWall_N_per_m - (g.deepest_m - x);
                     return -kWall_N_per_m * std::max(z_m, -kTableOut_N_per_m * x / kWall_N_per_m);
                   },
                   kNoStop});
  const auto three = [](const TurnGesture& g, double x, bool out, double rubs_N) {
    if (out) return cuttingOut_N(g, x, kQuadratic_N_per_m2) + rubs_N;
    const BehindTops now = behindTops(x, kQuadratic_N_per_m2);
    return -now.held_N - kWall_N_per_m * now.cut_m + rubs_N;
  };
  constexpr char kNoRest[] = "static and viscous friction";
  forms.push_back({AxialModel::kOkamura, "", scene(AxialModel::kOkamura),
                   [three](const TurnGesture& g, double x, bool out) {
                     return three(g, x, out, coulomb_N(g, x, out, kRubOut_N_per_m));
                   },
                   kNoRest});
  forms.push_back(
      {AxialModel::kDahl, "", scene(AxialModel::kDahl),
       [three](const TurnGesture& g, double x, bool out) { return three(g, x, out, dahl_N(g, x, out)); },
       kNoRest});
  return forms;
}

}  // namespace

double TurnGesture::depth_m(double t_s) const {
  const double way_m = speed_mps * t_s;
  return t_s < turn_s() ? way_m - from_m : 2 * deepest_m + from_m - way_m;
}

const std::vector<ClosedForm>& closedForms() {
  static const std::vector<ClosedForm> forms = makeClosedForms();
  return forms;
}

TipSample straightTip(double depth_m) {
  // half a turn about x: the tip frame's z axis points to −z of W
  return {{0, 0, -depth_m}, {1, 0, 0, 0}};
}

}  // namespace needlelab
