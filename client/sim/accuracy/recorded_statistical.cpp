#include "client/sim/accuracy/recorded_statistical.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/recorded.h"
#include "client/sim/accuracy/recorded_fit.h"

namespace needlelab {
namespace {

constexpr double kNormal975 = 1.959963984540054;  // quantile of the unit normal at 0.975
constexpr double kStep_m = 1e-4;  // per tick: the target bends every quarter of the correlation length only

struct LogNormal {
  double mu = 0, sigma = 0;
};
LogNormal logNormal(ForceLaw law) {
  const double share = law.sd_N / law.mean_N, variance = std::log1p(share * share);
  return {std::log(law.mean_N) - variance / 2, std::sqrt(variance)};
}

SceneSpec sceneOf(const StatisticalSpec& spec, double stiffness_N_per_m) {
  SceneSpec scene = fittedSceneBase();
  scene.axial_model = AxialModel::kStatistical;
  scene.effects = bitOf(Effect::kCutting);
  scene.tracking_wall.stiffness_N_per_m = stiffness_N_per_m;
  scene.layers.push_back({});
  scene.layers[0].thickness_m = 0.5;
  scene.statistical = spec;
  return scene;
}

double correlationOf(const std::vector<double>& a, const std::vector<double>& b) {
  const auto count = static_cast<double>(a.size());
  double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ma += a[i] / count;
    mb += b[i] / count;
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    aa += (a[i] - ma) * (a[i] - ma);
    bb += (b[i] - mb) * (b[i] - mb);
    ab += (a[i] - ma) * (b[i] - mb);
  }
  return ab / std::sqrt(aa * bb);
}

}  // namespace

StatisticalSpec syntheticStatistics() {
  StatisticalSpec spec;
  spec.table = {{0, 1.0, 0.15}, {0.01, 2.0, 0.5}, {0.02, 0.8, 0.3}, {0.03, 3.0, 0.6}};
  spec.correlation_length_m = 0.003;
  spec.seed = 20261120;
  return spec;
}

ForceBand centralBand95(double mean_N, double sd_N) {
  const LogNormal law = logNormal({mean_N, sd_N});
  return {std::exp(law.mu - kNormal975 * law.sigma), std::exp(law.mu + kNormal975 * law.sigma)};
}

BandVerdict bandVerdict(double share, std::size_t independent) {
  // fewer than this many keep a band of 95 % whatever they are
  constexpr std::size_t kLeast = 8;
  constexpr double kAsked = 0.95;
  BandVerdict verdict;
  if (independent == 0) {
    verdict.text = "cannot tell: no data";
    return verdict;
  }
  const auto n = static_cast<double>(independent);
  const double z2 = kNormal975 * kNormal975, middle = (share + z2 / (2 * n)) / (1 + z2 / n);
  const double half = kNormal975 / (1 + z2 / n) * std::sqrt(share * (1 - share) / n + z2 / (4 * n * n));
  verdict.low = std::max(0.0, middle - half);
  verdict.high = std::min(1.0, middle + half);
  const char* found = verdict.high < kAsked  ? "MISSED: too narrow"
                      : verdict.low > kAsked ? "MISSED: too wide"
                      : independent < kLeast ? "cannot tell"
                                             : "kept";
  verdict.text = fmt::format("{}, {:.0f} % inside ({:.0f} to {:.0f} %)", found, 100 * share,
                             100 * verdict.low, 100 * verdict.high);
  return verdict;
}

ForceLaw forceLawAt(const StatisticalSpec& spec, double depth_m) {
  const auto& table = spec.table;
  const auto after =
      std::lower_bound(table.begin(), table.end(), depth_m,
                       [](const StatisticalSpec::Row& row, double d) { return row.depth_m < d; });
  if (after == table.begin()) return {table.front().mean_N, table.front().sd_N};
  if (after == table.end()) return {table.back().mean_N, table.back().sd_N};
  const auto& before = *(after - 1);
  const double t = (depth_m - before.depth_m) / (after->depth_m - before.depth_m);
  return {std::lerp(before.mean_N, after->mean_N, t), std::lerp(before.sd_N, after->sd_N, t)};
}

Result<StatisticalDraws> drawStatistical(const StatisticalSpec& spec, const std::vector<double>& depths_m,
                                         std::size_t draws, double stiffness_N_per_m) {
  ASSIGN_OR_RETURN(const auto model, compile(sceneOf(spec, stiffness_N_per_m), 1000));

  // ticks at which to look: each depth, and one correlation length below it
  const auto tickOf = [](double depth_m) { return static_cast<std::size_t>(std::lround(depth_m / kStep_m)); };
  const std::size_t lag = tickOf(spec.correlation_length_m), count = depths_m.size();
  std::vector<std::size_t> ticks;
  for (const double d : depths_m) ticks.push_back(tickOf(d));
  for (const double d : depths_m) ticks.push_back(tickOf(d) + lag);
  const std::size_t last = *std::max_element(ticks.begin(), ticks.end());

  // one state for all: the engine draws a new target with each entry
  std::vector<std::vector<double>> forces_N(2 * count);
  constexpr Quat kDown{1, 0, 0, 0};
  SimState state{};
  StepReport report;
  std::vector<double> along_N(last + 1);
  for (std::size_t draw = 0; draw < draws; ++draw) {
    step(model, {{0, 0, kStep_m}, kDown}, state, report);
    for (std::size_t i = 1; i <= last; ++i) {
      step(model, {{0, 0, -static_cast<double>(i) * kStep_m}, kDown}, state, report);
      along_N[i] = report.wrench_W.force_N.z;
    }
    for (std::size_t k = 0; k < ticks.size(); ++k) forces_N[k].push_back(along_N[ticks[k]]);
  }

  StatisticalDraws result;
  result.draws = draws;
  const auto n = static_cast<double>(draws);
  const auto scores = [&](std::size_t k) {
    const LogNormal law = logNormal(forceLawAt(spec, static_cast<double>(ticks[k]) * kStep_m));
    std::vector<double> z;
    for (const double f : forces_N[k]) z.push_back((std::log(std::max(f, 1e-12)) - law.mu) / law.sigma);
    return z;
  };
  for (std::size_t k = 0; k < count; ++k) {
    DrawnAtDepth at;
    at.depth_m = static_cast<double>(ticks[k]) * kStep_m;
    at.asked = forceLawAt(spec, at.depth_m);
    const ForceBand band = centralBand95(at.asked.mean_N, at.asked.sd_N);
    double squares = 0;
    for (const double f : forces_N[k]) {
      at.drawn.mean_N += f / n;
      at.in_band += (f >= band.low_N && f <= band.high_N) ? 1 / n : 0;
    }
    for (const double f : forces_N[k]) squares += (f - at.drawn.mean_N) * (f - at.drawn.mean_N);
    at.drawn.sd_N = std::sqrt(squares / (n - 1));
    result.depths.push_back(at);
    result.correlation += correlationOf(scores(k), scores(count + k)) / static_cast<double>(count);
  }
  result.correlation_length_m = -static_cast<double>(lag) * kStep_m / std::log(result.correlation);
  return result;
}

Result<AccuracyRows> statisticalRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                     std::vector<std::string>& /*notes*/) {
  if (progress) progress("drawing statistical insertions", 0);
  const StatisticalSpec spec = syntheticStatistics();
  const std::size_t draws = options.long_form ? 100'000 : 10'000;
  ASSIGN_OR_RETURN(const auto result,
                   drawStatistical(spec, {0.002, 0.0075, 0.015, 0.022, 0.0265}, draws, 1000));
  ASSIGN_OR_RETURN(const auto model, compile(sceneOf(spec, 1000), 1000));
  AccuracyRows rows;
  for (const DrawnAtDepth& at : result.depths) {
    AccuracyRow row;
    row.scene = "synthetic statistics";
    row.model = axialModelName(AxialModel::kStatistical);
    row.variant = fmt::format(
        "at {:.1f} mm: mean {:.3f} N of {:.3f}, sd {:.3f} N of {:.3f}; {:.2f} % within the 95 % band",
        at.depth_m * 1e3, at.drawn.mean_N, at.asked.mean_N, at.drawn.sd_N, at.asked.sd_N, 100 * at.in_band);
    row.reference = "log-normal law of the section's mean and sd at that depth";
    row.rms_error_n = std::fabs(at.drawn.mean_N - at.asked.mean_N);
    row.max_error_n = std::max(*row.rms_error_n, std::fabs(at.drawn.sd_N - at.asked.sd_N));
    row.noticeable_n = noticeableForce_N(at.asked.mean_N);
    row.uncertainty = fmt::format(
        "{} insertions: mean known to {:.4f} N, share in the band to {:.2f} %; correlation length {:.2f} mm "
        "of {:.2f}; ",
        result.draws, at.asked.sd_N / std::sqrt(static_cast<double>(result.draws)),
        100 * std::sqrt(0.95 * 0.05 / static_cast<double>(result.draws)), result.correlation_length_m * 1e3,
        spec.correlation_length_m * 1e3);
    row.uncertainty += addTickTime(model, constantSpeed(-1e-4, 0.03, 0.003, 1000), row);
    row.cannot_show =
        "the numbers are synthetic: it shows that the sampler keeps to its law, not that tissue does";
    rows.push_back(row);
  }
  return rows;
}

Result<RecordedPicture> statisticalPicture() {
  const StatisticalSpec spec = syntheticStatistics();
  SceneSpec scene = sceneOf(spec, 1000);
  std::vector<double> x, mean, low, high;
  for (double d = 0; d <= 0.03; d += 1e-4) {
    const ForceLaw law = forceLawAt(spec, d);
    const ForceBand band = centralBand95(law.mean_N, law.sd_N);
    x.push_back(d * 1e3);
    mean.push_back(law.mean_N);
    low.push_back(band.low_N);
    high.push_back(band.high_N);
  }
  PlotBlocks data;
  data.columns("law", {x, mean, low, high});
  constexpr int kShown = 40;
  for (int i = 0; i < kShown; ++i) {
    scene.statistical.seed = spec.seed + static_cast<std::uint64_t>(i);
    const StraightGesture gesture = constantSpeed(-1e-5, 0.03, 0.003, 100);
    ASSIGN_OR_RETURN(const auto run, runStraight(scene, gesture));
    std::vector<double> depth_mm;
    for (const double d : gesture.depth_m) depth_mm.push_back(d * 1e3);
    data.columns(fmt::format("draw {}", i), {depth_mm, run.force_N});
  }
  ASSIGN_OR_RETURN(const auto draws,
                   drawStatistical(spec, {0.002, 0.0075, 0.015, 0.022, 0.0265}, 10'000, 1000));
  double least = 1, most = 0;
  std::vector<double> at, drawn, drawn_sd, in_band;
  for (const DrawnAtDepth& one : draws.depths) {
    least = std::min(least, one.in_band);
    most = std::max(most, one.in_band);
    at.push_back(one.depth_m);
    drawn.push_back(one.drawn.mean_N);
    drawn_sd.push_back(one.drawn.sd_N);
    in_band.push_back(one.in_band);
  }
  return RecordedPicture{
      "statistical_draws",
      csvOf({{"depth_m", at}, {"mean_n", drawn}, {"sd_n", drawn_sd}, {"share_in_band", in_band}}),
      data.text(),
      {{"finding",
        fmt::format("Statistical insertions keep to their law: {:.1f} to {:.1f} % of 10,000 draws lie in "
                    "the 95 % band",
                    100 * least, 100 * most)},
       {"draws", static_cast<double>(kShown)}}};
}

}  // namespace needlelab
