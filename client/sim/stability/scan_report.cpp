#include "client/sim/stability/scan_report.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "client/sim/stability/scan_model.h"
#include "client/sim/tools/figure_table.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files.h"

namespace needlelab {
namespace {

struct Picture {
  const char* name;
  std::string (*csv)(const StiffnessLimits&);
  std::string (*script)(const StiffnessLimits&, const std::filesystem::path&);
  int width_px, height_px;
};
constexpr Picture kPictures[] = {
    {"stiffness_limits", limitsCsv, limitsScript, 1500, 1150},
    {"stiffness_rest", restCsv, restScript, 1150, 800},
    {"stiffness_beyond", beyondCsv, beyondScript, 1500, 1050},
};

double place(AxialModel model) {
  return static_cast<double>(model);
}

}  // namespace

nlohmann::ordered_json jsonOf(const StiffnessLimits& limits) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array(), rest = rows, beyond = rows;
  for (const StiffnessLimitRow& row : limits.rows)
    rows.push_back({{"model", axialModelName(row.model)},
                    {"parameter", stiffnessParameter(row.model)},
                    {"rate_hz", row.rate_hz},
                    {"delay_ticks", row.delay_ticks},
                    {"stiffness_n_per_m", row.stiffness_N_per_m},
                    {"at_cap", row.at_cap},
                    {"felt_n_per_m", row.felt_N_per_m},
                    {"passive_n_per_m", row.passive_N_per_m},
                    {"sampled_n_per_m", row.sampled_N_per_m},
                    {"runs", row.runs}});
  for (const RestLimitRow& row : limits.rest)
    rest.push_back({{"encoder_step_m", row.encoder_step_m},
                    {"dry_friction_n", row.dry_friction_N},
                    {"stiffness_n_per_m", row.stiffness_N_per_m},
                    {"at_cap", row.at_cap},
                    {"theory_n_per_m", row.theory_N_per_m}});
  for (const BeyondRow& row : limits.beyond)
    beyond.push_back({{"model", axialModelName(row.model)},
                      {"rate_hz", row.rate_hz},
                      {"delay_ticks", row.delay_ticks},
                      {"stiffness_n_per_m", row.stiffness_N_per_m},
                      {"swing_n", row.swing_N},
                      {"max_force_n", row.max_force_N},
                      {"held", row.held}});
  return {{"rows", rows}, {"rest", rest}, {"beyond", beyond}, {"notes", limits.notes}};
}

std::string limitsCsv(const StiffnessLimits& limits) {
  FigureTable table(
      "model_index,rate_hz,delay_ticks,stiffness_n_per_m,at_cap,felt_n_per_m,passive_n_per_m,sampled_n_per_m,"
      "runs,model");
  for (const StiffnessLimitRow& row : limits.rows)
    table.row({place(row.model), row.rate_hz, static_cast<double>(row.delay_ticks), row.stiffness_N_per_m,
               row.at_cap ? 1.0 : 0.0, row.felt_N_per_m, row.passive_N_per_m, row.sampled_N_per_m,
               static_cast<double>(row.runs)},
              {axialModelName(row.model)});
  return table.take();
}

std::string restCsv(const StiffnessLimits& limits) {
  FigureTable table("encoder_step_m,dry_friction_n,stiffness_n_per_m,at_cap,theory_n_per_m");
  for (const RestLimitRow& row : limits.rest)
    table.row({row.encoder_step_m, row.dry_friction_N, row.stiffness_N_per_m, row.at_cap ? 1.0 : 0.0,
               row.theory_N_per_m});
  return table.take();
}

std::string beyondCsv(const StiffnessLimits& limits) {
  FigureTable table("model_index,time_s,force_n,model");
  for (const BeyondRow& row : limits.beyond)
    for (std::size_t i = 0; i < row.trace.time_s.size(); ++i)
      table.row({place(row.model), row.trace.time_s[i], row.trace.force_N[i]}, {axialModelName(row.model)});
  return table.take();
}

Result<StiffnessLimits> drawStiffnessLimits(const std::filesystem::path& dir, const CaseSettings& settings,
                                            const StabilityProgress& progress) {
  auto limits = findStiffnessLimits(settings, progress);
  if (!limits.ok()) return limits.error();
  const std::string json = jsonOf(*limits).dump(2) + "\n";
  if (const Status written = writeFileAtomically(dir / "stiffness_limits.json", viewOf(json)); !written.ok())
    return written.error();
  const bool draw = hasGnuplot();
  for (const Picture& picture : kPictures) {
    const auto csv = dir / (std::string(picture.name) + ".csv");
    const std::string table = picture.csv(*limits);
    Status written = writeFileAtomically(csv, viewOf(table));
    if (written.ok() && draw)
      written = plotPng(picture.script(*limits, csv), dir / (std::string(picture.name) + ".png"),
                        picture.width_px, picture.height_px);
    if (!written.ok()) return written.error();
  }
  if (!draw) limits->notes.push_back("gnuplot is not on the PATH: tables only, no pictures");
  return limits;
}

}  // namespace needlelab
