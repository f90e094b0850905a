#include <fmt/core.h>

#include <iterator>
#include <span>

#include "client/sim/accuracy/study.h"

namespace needlelab {

Result<FemScene> femScene() {
  ASSIGN_OR_RETURN(const auto scene, studyScene());
  return femLikeForLike(scene);
}

AccuracyRows rowsOf(const std::vector<MeshRow>& meshes, double young_factor) {
  const MeshRow& finest = meshes.back();
  constexpr double kAtTurn = 0.95;  // from this share of the stroke's depth on
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
    row.against = fmt::format("{} nodes, {} stations, itself not exact", finest.nodes, finest.stations);
    row.error_N = meanInterval(std::span(&mesh.force_rms_error_N, 1));
    row.greatest_N = mesh.force_max_error_N;
    row.greatest_at =
        mesh.force_max_depth_m > kAtTurn * mesh.stroke_m
            ? "at the turn"
            : fmt::format("{:.0f} mm, {}", 1e3 * mesh.force_max_depth_m, mesh.force_max_out ? "out" : "in");
    row.prepare_s = mesh.precompute_s;
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
  std::vector<int> nodes = {1000, 4000, 8000, 16'000};
  if (options.long_form) nodes.push_back(32'000);
  std::vector<MeshSize> ladder;
  for (const int stations : kStationCounts)
    for (const int size : nodes) ladder.push_back({size, stations});
  ladder.push_back({2 * nodes.back(), *std::rbegin(kStationCounts)});
  ASSIGN_OR_RETURN(const auto scene, femScene());
  std::size_t done = 0;
  ASSIGN_OR_RETURN(const auto meshes, meshStudy(scene.spec, ladder, [&](const MeshRow& mesh) {
                     progress(fmt::format("{} nodes, {} stations", mesh.nodes, mesh.stations),
                              static_cast<double>(++done) / static_cast<double>(ladder.size()));
                   }));
  return rowsOf(meshes, scene.young_factor);
}

}  // namespace needlelab
