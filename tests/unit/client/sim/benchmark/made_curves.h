// Sets of curves whose truth is known: made by laws that are written here again, with noise from a seed.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/device/hand.h"
#include "client/sim/benchmark/curve_set.h"

namespace needlelab::test {

/// The force at each depth (0.1 mm apart, from 0) of an insertion at a speed.
using MadeLaw = std::function<std::vector<double>(const std::vector<double>& depth_m, double speed_mps)>;

/// A spring beside a Maxwell element, step by step in time; through when both springs hold `work_J`; cutting
/// and friction behind.
inline MadeLaw madeFracture(double work_J) {
  return [work_J](const std::vector<double>& depth_m, double speed_mps) {
    constexpr double kTop_m = 0.002, kStiffness = 80, kShare = 1.5, kRelax_s = 0.8;
    constexpr double kCut_N = 0.25, kFriction = 12;
    constexpr int kSteps = 50;
    std::vector<double> force_N;
    double maxwell_m = 0, z_m = 0;
    bool through = false;
    for (std::size_t i = 0; i < depth_m.size(); ++i) {
      const double z_end_m = depth_m[i] - kTop_m;
      if (z_end_m <= 0) {
        force_N.push_back(0);
        continue;
      }
      const double dz_m = (z_end_m - z_m) / kSteps;
      for (int k = 0; k < kSteps && !through; ++k) {
        maxwell_m += dz_m * (1 - maxwell_m / (kRelax_s * speed_mps));
        z_m += dz_m;
        through = 0.5 * kStiffness * (z_m * z_m + kShare * maxwell_m * maxwell_m) >= work_J;
      }
      force_N.push_back(through ? kCut_N + kFriction * z_end_m : kStiffness * (z_m + kShare * maxwell_m));
    }
    return force_N;
  };
}

/// Two exponential rises, an exponential fall behind each; knows no speed.
inline MadeLaw madeExponential() {
  return [](const std::vector<double>& depth_m, double) {
    std::vector<double> force_N;
    for (const double d : depth_m) {
      const auto rise = [&](double from_m, double to_m, double base_N, double top_N) {
        return base_N +
               (top_N - base_N) * (std::exp(4 * (d - from_m) / (to_m - from_m)) - 1) / (std::exp(4.0) - 1);
      };
      const auto fall = [](double at_m, double from_m, double top_N, double to_N) {
        return to_N + (top_N - to_N) * std::exp(-(at_m - from_m) / 0.0008);
      };
      force_N.push_back(d < 0.001   ? 0
                        : d < 0.008 ? rise(0.001, 0.008, 0, 1.2)
                        : d < 0.011 ? fall(d, 0.008, 1.2, 0.4)
                        : d < 0.016 ? rise(0.011, 0.016, fall(0.011, 0.008, 1.2, 0.4), 2)
                                    : fall(d, 0.016, 2, 0.6));
    }
    return force_N;
  };
}

/// A line of 60 N/m from 2 mm on, and a damper of 20 N s/m.
inline MadeLaw madeVoigt() {
  return [](const std::vector<double>& depth_m, double speed_mps) {
    std::vector<double> force_N;
    for (const double d : depth_m) force_N.push_back(d < 0.002 ? 0 : 60 * (d - 0.002) + 20 * speed_mps);
    return force_N;
  };
}

/// Three layers, each cut with a force of its own, behind 2 mm of air; within 0.5 mm from one to the next.
inline MadeLaw madeLayers() {
  return [](const std::vector<double>& depth_m, double) {
    std::vector<double> force_N;
    for (const double d : depth_m) {
      const auto reached = [d](double from_m) { return std::min(1.0, std::max(0.0, (d - from_m) / 5e-4)); };
      force_N.push_back(0.5 * reached(0.002) + 1.0 * reached(0.008) - 0.7 * reached(0.014));
    }
    return force_N;
  };
}

/// After Okamura, Simone and O'Leary 2004: 60 z + 12,000 z² N from 2 mm on up to a puncture at 0.9 N, then
/// cutting with 0.3 N and friction of 20 N for each metre of the shaft inside.
inline MadeLaw madeOkamura() {
  return [](const std::vector<double>& depth_m, double) {
    std::vector<double> force_N;
    for (const double d : depth_m) {
      const double z_m = std::max(0.0, d - 0.002), stiff_N = 60 * z_m + 12'000 * z_m * z_m;
      force_N.push_back(stiff_N < 0.9 ? stiff_N : 0.3 + 20 * z_m);
    }
    return force_N;
  };
}

/// No law: 0.5 N, and noise of up to 0.3 N that forgets itself within a millimetre, another at each
/// insertion.
inline MadeLaw madeNoise(std::uint64_t seed) {
  return [random = std::make_shared<HandRandom>(seed)](const std::vector<double>& depth_m, double) {
    std::vector<double> force_N;
    double off_N = 0;
    for (std::size_t i = 0; i < depth_m.size(); ++i) {
      off_N += 0.1 * (0.9 * (2 * random->uniform() - 1) - off_N);
      force_N.push_back(0.5 + off_N);
    }
    return force_N;
  };
}

struct MadeSet {
  int specimens = 4;
  std::vector<double> speeds_mps = {0.003};
  double noise_N = 0.02;     ///< uniform, at most so much, of each row
  double specimens_off = 0;  ///< a specimen's force is up to this share more or less
  double hold_s = 0;         ///< at the end at rest, and then out at the same speed: see `madeSet`
  double to_m = 0.02;
  std::uint64_t seed = 1;
};

/// Where there is a hold, force behind the way in is the law's at a speed of 0, and on the way out at minus
/// the speed, but no pull.
inline CurveSet madeSet(const MadeLaw& law, const MadeSet& made) {
  HandRandom random(made.seed);
  CurveSet set;
  set.name = "made";
  set.licence = set.source = "made by a test";
  for (int s = 0; s < made.specimens; ++s) {
    const double scale = 1 + made.specimens_off * (2 * random.uniform() - 1);
    for (const double speed : made.speeds_mps) {
      ForceCurve curve;
      curve.specimen = "s" + std::to_string(s);
      curve.name = curve.specimen + " " + std::to_string(speed);
      curve.needle = "18G";
      curve.tissue = "made";
      curve.speed_mps = speed;
      for (double d = 0; d < made.to_m; d += 1e-4) curve.depth_m.push_back(d);
      curve.force_N = law(curve.depth_m, speed);
      for (double& force : curve.force_N) force = scale * force + made.noise_N * (2 * random.uniform() - 1);
      if (made.hold_s > 0) {
        const auto& depth_m = curve.depth_m;
        curve.hold.depth_m = depth_m.back();
        const double rest_N = scale * law(depth_m, 0).back();
        for (int i = 0; i < 100; ++i) {
          curve.hold.t_s.push_back(made.hold_s * i / 99);
          curve.hold.force_N.push_back(rest_N + made.noise_N * (2 * random.uniform() - 1));
        }
        curve.withdrawal.speed_mps = speed;
        curve.withdrawal.depth_m = depth_m;
        for (const double force : law(depth_m, -speed))
          curve.withdrawal.force_N.push_back(scale * std::max(0.0, force) +
                                             made.noise_N * (2 * random.uniform() - 1));
      }
      set.curves.push_back(std::move(curve));
    }
  }
  return set;
}

}  // namespace needlelab::test
