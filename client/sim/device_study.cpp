#include "client/sim/device_study.h"

#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/sim/tools/gnuplot.h"
#include "client/sim/tools/small_sample.h"
#include "common/base/files/files.h"
#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/haptics/gate/handle_stiffness.h"

namespace needlelab {
namespace {

constexpr const char* kCase = "late_rest";
constexpr double kPress_N = 3;
constexpr double kSoftest_N_per_m = 100, kStiffest_N_per_m = 10'000, kStep = 1.25;

// What a station does: "76 %", of the stiffness, or "refused: 41 %".
std::string shareText(const DeviceRow& row) {
  return fmt::format("{}{:.0f} %", row.share < kMinStiffnessShare ? "refused: " : "", 100 * row.share);
}

// The file's members; the plant is all of them but its texts and what is told.
Result<nlohmann::json> readDevice(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const auto text, readWholeFile(path, 1u << 16));
  ASSIGN_OR_RETURN(auto json, readStrictJson(text, path.string(), 1u << 16));
  const auto missing = [&](const std::string& field, const char* must) {
    return Error{ErrorCode::kInvalidInput, fmt::format("{}: {}: {}", path.string(), field, must)};
  };
  if (!json.is_object()) return missing("(all)", "must be an object");
  if (!json.contains("name") || !json["name"].is_string()) return missing("name", "must be a text");
  if (!json.contains("told") || !json["told"].is_object()) return missing("told", "must be an object");
  for (const char* field :
       {"mass_kg", "damping_ns_per_m", "dry_friction_n", "encoder_step_m", "rate_hz", "delay_ticks", "lag_s"})
    if (!json.contains(field) || !json[field].is_number()) return missing(field, "must be a number");
  for (const char* field : {"delay_ticks", "lag_s", "damping_ns_per_m"})
    if (!json["told"].contains(field) || !json["told"][field].is_number())
      return missing(std::string("told.") + field, "must be a number");
  return json;
}

// `late_rest` with this device, in `scene`, pressed at `depth_m`.
Result<DeviceRow> runIn(const nlohmann::json& cases, const nlohmann::json& device, const std::string& scene,
                        double depth_m, const nlohmann::json& patch, bool long_form,
                        const std::string& source) {
  auto changed = cases;
  auto& entry = changed["cases"][kCase];
  auto plant = device;
  for (const char* other : {"name", "source", "told"}) plant.erase(other);
  entry.merge_patch({{"scene", scene}, {"plant", plant}, {"told", device["told"]}, {"scene_patch", patch}});
  if (!patch.empty()) entry["full_stiffness"] = true;  // a wall as it is, not as a station lowers it
  const double hand_N_per_m = 90;
  for (auto& step : entry["path"])
    if (step.contains("to_depth_m")) step["to_depth_m"] = depth_m + kPress_N / hand_N_per_m;
  ASSIGN_OR_RETURN(const auto file, CaseFile::parse(changed.dump(), source));
  const ForceSourceFactory engine = engineSource();
  DeviceRow row;
  row.scene = scene;
  CaseEntry read(file, kCase, long_form);
  const SceneSpec spec = read.scene();
  if (!read.status().ok()) return read.status().error();
  ASSIGN_OR_RETURN(const auto made, engine(spec, device["rate_hz"].get<double>()));
  row.at_once_N_per_m = made->axialStiffness_N_per_m();
  for (const StabilityCase& one : allCases())
    if (one.name == kCase) {
      ASSIGN_OR_RETURN(const auto outcome,
                       runCase(one, {file, long_form}, AxialModel::kEnhancedTrackingWall, engine));
      row.row = outcome.row;
    }
  return row;
}

// Half of what lies above the bone.
double halfway(const nlohmann::json& profile) {
  double depth_m = 0;
  for (const auto& layer : profile.at("layers")) {
    if (layer.value("tissue", "") == "BONE") break;
    depth_m += layer.at("thickness_m").get<double>();
  }
  return depth_m / 2;
}

}  // namespace

Result<DeviceStudy> studyDevice(const std::filesystem::path& path, const CaseFile& cases, bool long_form) {
  ASSIGN_OR_RETURN(const auto device, readDevice(path));
  const auto& told = device["told"];
  const double rate_hz = device["rate_hz"], told_Ns_per_m = told["damping_ns_per_m"];
  const double delay = told["delay_ticks"].get<double>() + told["lag_s"].get<double>() * rate_hz;
  DeviceStudy study;
  study.device = device["name"];
  study.most_N_per_m = stableInLightestGrip_N_per_m(told_Ns_per_m, rate_hz, delay);
  const nlohmann::json none = nlohmann::json::object();
  for (const EmbeddedFile& patient : samplePatients()) {
    const auto profile = nlohmann::json::parse(patient.text);
    if (profile.value("axial_model", "") != "ENHANCED_TRACKING_WALL" || !profile.contains("layers")) continue;
    const std::string name(patient.name.substr(0, patient.name.rfind('.')));
    ASSIGN_OR_RETURN(auto row,
                     runIn(cases.json(), device, name, halfway(profile), none, long_form, path.string()));
    row.share = std::min(1.0, study.most_N_per_m / row.at_once_N_per_m);
    study.patients.push_back(std::move(row));
  }
  for (double k = kSoftest_N_per_m; k <= kStiffest_N_per_m; k *= kStep) {
    const nlohmann::json patch = {{"tracking_wall", {{"stiffness_n_per_m", k}}}};
    ASSIGN_OR_RETURN(auto row,
                     runIn(cases.json(), device, "one_layer", 0.02, patch, long_form, path.string()));
    study.walls.push_back(std::move(row));
    if (!study.walls.back().row.passed) break;
    study.safe_N_per_m = study.walls.back().at_once_N_per_m;
  }
  std::stable_sort(study.patients.begin(), study.patients.end(), [](const DeviceRow& a, const DeviceRow& b) {
    return a.row.neighbours->share() > b.row.neighbours->share();
  });
  return study;
}

std::string deviceText(const DeviceStudy& study) {
  std::string text = fmt::format("{}\n{}{}{}{}{}swing [N]\n", study.device, padded("patient", 28),
                                 padded("at once [N/m]", 16), padded("rendered", 16), padded("stable", 18),
                                 padded("in a second [mJ]", 18));
  for (const DeviceRow& one : study.patients)
    text += fmt::format("{}{}{}{}{}{}\n", padded(one.scene, 28),
                        padded(fmt::format("{:.0f}", one.at_once_N_per_m), 16), padded(shareText(one), 16),
                        padded(neighboursText(*one.row.neighbours) + (one.row.passed ? "" : " ~"), 18),
                        padded(shortNumber(1e3 * one.row.second_energy_J.value_or(0)), 18),
                        shortNumber(one.row.hold_swing_N));
  return text +
         fmt::format(
             "The stiffest safe wall: {}; (b + {:g})/(T (½ + D)), with the delay that it is told, is {:.0f} N/m.\n",
             study.safe_N_per_m ? fmt::format("{:.0f} N/m", *study.safe_N_per_m)
                                : fmt::format("none, not even {:g} N/m", kSoftest_N_per_m),
             kLightestGrip_Ns_per_m, study.most_N_per_m);
}

nlohmann::ordered_json deviceJson(const DeviceStudy& study) {
  auto rows = nlohmann::ordered_json::array();
  for (const auto* list : {&study.patients, &study.walls})
    for (const DeviceRow& one : *list) {
      auto row = rowsJson({one.row}).at(0);
      row["scene"] = one.scene;
      row["at_once_n_per_m"] = one.at_once_N_per_m;
      row["share"] = one.share;
      rows.push_back(row);
    }
  return rows;
}

Status drawDevice(const DeviceStudy& study, const std::filesystem::path& out) {
  if (!hasGnuplot()) return {};
  PlotBlocks data;
  for (std::size_t y = 0; y < study.patients.size(); ++y) {
    const DeviceRow& one = study.patients[y];
    const ShareInterval interval = wilsonInterval(one.row.neighbours->share(), one.row.neighbours->all);
    data.row("patients",
             {static_cast<double>(y), one.row.neighbours->share(), interval.low, interval.high,
              one.row.passed ? 1.0 : 0.0},
             {fmt::format("{}, {:.0f} N/m, {}", one.scene, one.at_once_N_per_m, shareText(one))});
  }
  const auto file = out / "device.dat";
  RETURN_IF_ERROR(writeFileAtomically(file, viewOf(data.text())));
  return drawPlot(
      "device", out / "device.png",
      {{"data", file.string()},
       {"finding", fmt::format("{}: stable up to {} N/m", study.device,
                               study.safe_N_per_m ? fmt::format("{:.0f}", *study.safe_N_per_m) : "0")}});
}

}  // namespace needlelab
