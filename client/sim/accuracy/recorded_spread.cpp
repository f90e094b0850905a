#include "client/sim/accuracy/recorded_spread.h"

#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/recorded_statistical.h"

namespace needlelab {

StatisticalSpec spreadAround(const DepthCurve& curve, const CurveFit& table, const BinChoice& fit_on) {
  constexpr double kReach_m = 0.001, kLeast_N = 0.005;
  StatisticalSpec spec;
  spec.seed = 1;
  for (const auto& row : table.scene.spec.precomputed.table) {
    double squares = 0;
    std::size_t count = 0;
    for (const CurveBin& bin : curve.bins) {
      if (!fit_on(bin) || std::fabs(bin.at - row.depth_m) > kReach_m) continue;
      for (const std::size_t i : bin.rows) {
        squares += std::pow(curve.force_N[i] - table.model_N[i], 2);
        ++count;
      }
    }
    const double mean_N = std::max(kLeast_N, row.cutting_N);
    const double sd_N = count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0;
    // more spread than the mean itself would only make a heavier tail of a log-normal law
    spec.table.push_back({row.depth_m, mean_N, std::clamp(sd_N, kLeast_N, mean_N)});
  }
  return spec;
}

Result<SpreadCheck> checkSpread(const DepthCurve& curve, const StatisticalSpec& spec, const BinChoice& fit_on,
                                int insertions) {
  const auto held_out = [&](const CurveBin& bin) { return !fit_on(bin); };
  SpreadCheck check;
  check.scene.spec = fittedSceneBase();
  check.scene.spec.axial_model = AxialModel::kStatistical;
  check.scene.spec.effects = bitOf(Effect::kCutting);
  check.scene.spec.tracking_wall.stiffness_N_per_m = 1000;
  check.scene.spec.layers.push_back({});
  check.scene.spec.layers[0].thickness_m = 0.1;
  check.scene.spec.statistical = spec;

  std::vector<double> mean_N(curve.depth_m.size(), 0), rms;
  for (int i = 0; i < insertions; ++i) {
    CurveScene scene = check.scene;
    scene.spec.statistical.seed = spec.seed + static_cast<std::uint64_t>(i);
    const auto run = runCurve(scene, curve.depth_m.back());
    if (!run.ok()) return run.error();
    const auto force_N = forceAtDepths(*run, scene.surface_m, curve.depth_m);
    const CurveError error = curveError(curve.bins, curve.force_N, force_N, held_out);
    rms.push_back(error.rms);
    check.held_out_rms += error.rms / insertions;
    check.held_out_max = std::max(check.held_out_max, error.max);
    for (std::size_t k = 0; k < mean_N.size(); ++k) mean_N[k] += force_N[k] / insertions;
  }
  for (const double one : rms) check.spread_of_rms += std::pow(one - check.held_out_rms, 2) / insertions;
  check.spread_of_rms = std::sqrt(check.spread_of_rms);
  check.held_out_of_mean = curveError(curve.bins, curve.force_N, mean_N, held_out);

  // before the contact digitised noise is below zero as often as above, which no log-normal force is
  constexpr double kFelt_N = 0.02;
  std::size_t rows = 0, inside = 0;
  for (const CurveBin& bin : curve.bins) {
    if (!held_out(bin)) continue;
    for (const std::size_t i : bin.rows) {
      const ForceLaw law = forceLawAt(spec, curve.depth_m[i]);
      if (law.mean_N < kFelt_N) continue;
      const ForceBand band = centralBand95(law.mean_N, law.sd_N);
      ++rows;
      if (curve.force_N[i] >= band.low_N && curve.force_N[i] <= band.high_N) ++inside;
    }
  }
  check.in_band = rows > 0 ? static_cast<double>(inside) / static_cast<double>(rows) : 0;
  return check;
}

}  // namespace needlelab
