#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/study.h"

namespace needlelab {

Result<FemScene> femScene() {
  ASSIGN_OR_RETURN(const auto scene, studyScene());
  return femLikeForLike(scene);
}

FinestError finestError(double size_a, double error_a, double size_b, double error_b, double finest) {
  // error_a/error_b = (a^−q − f^−q)/(b^−q − f^−q): decreases with q, so solve by bisection
  const auto ratio = [&](double q) {
    return (std::pow(size_a / finest, -q) - 1) / (std::pow(size_b / finest, -q) - 1);
  };
  constexpr double kLeast = 0.05, kMost = 8;
  if (!(error_b > 0) || error_a / error_b <= ratio(kLeast) || error_a / error_b >= ratio(kMost))
    return {0, error_b};
  double low = kLeast, high = kMost;
  for (int i = 0; i < 60; ++i) {
    const double q = 0.5 * (low + high);
    (ratio(q) < error_a / error_b ? low : high) = q;
  }
  return {low, error_b / (std::pow(size_b / finest, -low) - 1)};
}

AccuracyRows rowsOf(const std::vector<MeshRow>& meshes, double young_factor) {
  const MeshRow& finest = meshes.back();
  std::vector<const MeshRow*> same;
  for (const MeshRow& mesh : meshes)
    if (mesh.stations == finest.stations) same.push_back(&mesh);
  FinestError missed{0, 0};
  if (same.size() >= 3) {
    const MeshRow &a = *same[same.size() - 3], &b = *same[same.size() - 2];
    missed = finestError(a.nodes, a.force_rms_error_N, b.nodes, b.force_rms_error_N, finest.nodes);
  }
  const std::string order = missed.order > 0
                                ? fmt::format("its own error falls as nodes^-{:.2f}", missed.order)
                                : "it does not converge yet";
  AccuracyRows rows;
  for (const MeshRow& mesh : meshes) {
    if (&mesh == &finest) continue;
    AccuracyRow row;
    row.comparator = Comparator::kRefinement;
    row.scene = "six layers, one insertion and withdrawal";
    row.model = axialModelName(AxialModel::kFem);
    row.rate_hz = kStationRate_hz;
    row.nodes = mesh.nodes;
    row.stations = mesh.stations;
    row.against = fmt::format("{} nodes, {} stations; {}", finest.nodes, finest.stations, order);
    const double error_N = mesh.force_rms_error_N;
    row.error_N = MeanInterval{error_N, std::max(0.0, error_N - missed.rest), error_N + missed.rest, 1};
    row.cannot_show = fmt::format(
        "linear elasticity at large strain, and an elasticity that was set, not measured: the scene's "
        "lateral stiffness gives E, times {:.3g} in all layers, so that the tip meets the stiffness of the "
        "scene's walls at the skin",
        young_factor);
    if (const std::string remark = cutRemark(mesh); !remark.empty()) row.cannot_show += "; " + remark;
    rows.push_back(std::move(row));
  }
  return rows;
}

Result<AccuracyRows> refinementRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                    std::vector<std::string>& /*notes*/) {
  std::vector<int> nodes = {1000, 4000, 16'000};
  if (options.long_form) nodes.push_back(64'000);
  std::vector<MeshSize> ladder;
  for (const int stations : kStationCounts)
    for (const int size : nodes) ladder.push_back({size, stations});
  ASSIGN_OR_RETURN(const auto scene, femScene());
  std::size_t done = 0;
  ASSIGN_OR_RETURN(const auto meshes, meshStudy(scene.spec, ladder, [&](const MeshRow& mesh) {
                     progress(fmt::format("{} nodes, {} stations", mesh.nodes, mesh.stations),
                              static_cast<double>(++done) / static_cast<double>(ladder.size()));
                   }));
  return rowsOf(meshes, scene.young_factor);
}

}  // namespace needlelab
