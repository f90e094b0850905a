#include "client/sim/benchmark/formula.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace needlelab {
namespace {

constexpr double kMaxForce_N = 50, kMinStretch_m = 1e-4;

FitParameter forceOf(std::string name, double start_N) {
  const double held = std::clamp(start_N, 0.0, kMaxForce_N);
  return {std::move(name), held, 0, kMaxForce_N, std::max(0.02, 0.1 * held)};
}

std::string nth(const char* name, std::size_t i) {
  return fmt::format("{}{}", name, i);
}

std::string ruptures(std::size_t count) {
  return fmt::format("{} rupture{}", count, count == 1 ? "" : "s");
}

// A spring parallel to a Maxwell element, stretched at constant speed. `length_m`: speed × relaxation time.
struct Kelvin {
  double stiffness_N_per_m = 0, share = 0, length_m = 0;
  // of the Maxwell element's spring
  [[nodiscard]] double stretched_m(double z_m) const { return -length_m * std::expm1(-z_m / length_m); }
  [[nodiscard]] double force_N(double z_m) const {
    return stiffness_N_per_m * (z_m + share * stretched_m(z_m));
  }
  [[nodiscard]] double stored_J(double z_m) const {
    const double s = stretched_m(z_m);
    return 0.5 * stiffness_N_per_m * (z_m * z_m + share * s * s);
  }
};

template <typename Value>
bool severalOf(const TrainingSet& training, Value value) {
  std::set<double> values;
  for (const PooledBins& kind : training.kinds) values.insert(value(kind.kind));
  return values.size() > 1;
}

}  // namespace

Formula rateDependentFracture(const TrainingSet& training, std::size_t max_numbers) {
  constexpr std::size_t kMaxShared = 5, kOwn = 4;
  const InsertionKind reference = training.all.kind;
  const bool speeds = severalOf(training, [](const InsertionKind& kind) { return kind.speed_mps; });
  const bool diameters =
      training.diameters && severalOf(training, [](const InsertionKind& kind) { return kind.diameter_m; });
  const std::size_t shared = kMaxShared - (speeds ? 0 : 1) - (diameters ? 0 : 1);
  const std::size_t most = max_numbers > shared + kOwn ? (max_numbers - shared) / kOwn : 1;
  const auto pieces = curvePieces(training.all.bins, most);

  Formula formula;
  formula.name = "RATE_DEPENDENT_FRACTURE";
  formula.variant = ruptures(pieces.size());
  formula.parameters = {{"viscous share", 0.3, 0, 20, 0.3},
                        {"relaxation_s", 1, 1e-3, 100, 0.5},
                        {"friction_n_per_m", 1, 0, 1000, 2}};
  if (speeds) formula.parameters.push_back({"exponent of speed", 0, -1, 1, 0.1});
  if (diameters) formula.parameters.push_back({"exponent of diameter", 1, -1, 3, 0.2});
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const double length_m = std::max(kMinStretch_m, pieces[i].rupture_m - pieces[i].top_m);
    formula.parameters.push_back({nth("rupture_m ", i), pieces[i].rupture_m, -0.05, 1, 0.0005});
    formula.parameters.push_back({nth("stretch_m ", i), length_m, kMinStretch_m, 0.5, 0.2 * length_m});
    formula.parameters.push_back(forceOf(nth("rupture_n ", i), pieces[i].peak_N - pieces[i].before_N));
    formula.parameters.push_back(forceOf(nth("cutting_n ", i), pieces[i].after_N));
  }

  const bool scales = training.diameters;
  formula.forces = [reference, speeds, diameters, shared, scales](const std::vector<double>& values,
                                                                  const InsertionKind& kind,
                                                                  const std::vector<double>& depth_m) {
    const double share = values[0], relaxation_s = values[1], friction_N_per_m = values[2];
    const double of_speed = speeds ? values[3] : 0, of_diameter = diameters ? values[speeds ? 4 : 3] : 1;
    const double faster = std::pow(kind.speed_mps / reference.speed_mps, of_speed);
    const double wider =
        scales && kind.diameter_m > 0 ? std::pow(kind.diameter_m / reference.diameter_m, of_diameter) : 1;
    const std::size_t count = (values.size() - shared) / kOwn;
    // The numbers are for the reference speed: the rupture force and the energy stored there give the work of
    // fracture.
    std::vector<double> tops_m(count), works_J(count);
    std::vector<Kelvin> springs(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double* own = &values[shared + kOwn * i];
      Kelvin spring{1, share, reference.speed_mps * relaxation_s};
      spring.stiffness_N_per_m = own[2] / spring.force_N(own[1]);
      tops_m[i] = own[0] - own[1];
      works_J[i] = spring.stored_J(own[1]);
      spring.length_m = kind.speed_mps * relaxation_s;
      springs[i] = spring;
    }
    std::vector<double> force_N;
    force_N.reserve(depth_m.size());
    for (const double depth : depth_m) {
      double sum_N = 0, cutting_N = 0;
      bool inside = false;
      for (std::size_t i = 0; i < count; ++i) {
        const double z_m = depth - tops_m[i];
        if (z_m <= 0) continue;
        if (springs[i].stored_J(z_m) < works_J[i]) {
          sum_N += springs[i].force_N(z_m);
        } else {
          cutting_N = values[shared + kOwn * i + 3];
          inside = true;
        }
      }
      if (inside) sum_N += cutting_N * faster + friction_N_per_m * std::max(0.0, depth - tops_m[0]);
      force_N.push_back(sum_N * wider);
    }
    return force_N;
  };
  return formula;
}

Formula gordonExponential(const TrainingSet& training, std::size_t max_numbers) {
  constexpr std::size_t kShared = 2, kOwn = 4;
  const std::size_t most = max_numbers > kShared + kOwn ? (max_numbers - kShared) / kOwn : 1;
  const auto pieces = curvePieces(training.all.bins, most);
  Formula formula;
  formula.name = "GORDON_EXPONENTIAL";
  formula.variant = ruptures(pieces.size());
  formula.parameters = {{"curvature", 2, 0.01, 30, 1}, {"fall_m", 0.0005, 1e-5, 0.1, 0.0005}};
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    formula.parameters.push_back({nth("top_m ", i), pieces[i].top_m, -0.05, 1, 0.001});
    formula.parameters.push_back({nth("rupture_m ", i), pieces[i].rupture_m, -0.05, 1, 0.0005});
    formula.parameters.push_back(forceOf(nth("rupture_n ", i), pieces[i].peak_N));
    formula.parameters.push_back(forceOf(nth("behind_n ", i), pieces[i].after_N));
  }
  formula.forces = [](const std::vector<double>& values, const InsertionKind&,
                      const std::vector<double>& depth_m) {
    const double curvature = values[0], fall_m = values[1];
    const std::size_t count = (values.size() - kShared) / kOwn;
    std::vector<double> force_N;
    force_N.reserve(depth_m.size());
    for (const double depth : depth_m) {
      // the decay after the previous piece: the next rise starts from it
      double behind_N = 0, risen_N = 0, from_m = depth, value_N = 0;
      const auto fallen_N = [&](double at_m) {
        return behind_N + (risen_N - behind_N) * std::exp(-std::max(0.0, at_m - from_m) / fall_m);
      };
      for (std::size_t i = 0; i < count; ++i) {
        const double* own = &values[kShared + kOwn * i];
        if (depth < own[0]) break;
        const double end_m = std::max(own[1], own[0] + kMinStretch_m);
        if (depth < end_m) {
          const double base_N = i > 0 ? fallen_N(own[0]) : 0;
          const double risen = std::expm1(curvature * (depth - own[0]) / (end_m - own[0]));
          value_N = base_N + (own[2] - base_N) * risen / std::expm1(curvature);
          break;
        }
        risen_N = own[2];
        behind_N = own[3];
        from_m = end_m;
        value_N = fallen_N(depth);
      }
      force_N.push_back(value_N);
    }
    return force_N;
  };
  return formula;
}

}  // namespace needlelab
