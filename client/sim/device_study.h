/// `needlelab-sim stability --device FILE`: the late loop at rest (late_rest) of one device in each patient.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/sim/stability/case.h"
#include "common/base/result.h"

namespace needlelab {

/// One patient, or a layer with a wall of one stiffness.
struct DeviceRow {
  std::string scene;
  double at_once_N_per_m = 0;  ///< the scene's stiffness along the needle
  double share = 1;            ///< of it, as a station renders it; below kMinStiffnessShare it refuses
  CaseRow row;                 ///< neighbours, energies, swing
};

struct DeviceStudy {
  std::string device;
  std::vector<DeviceRow> patients, walls;  ///< walls: from soft to stiff, up to the first that is not stable
  double most_N_per_m = 0;  ///< what is told to the control: (b + 0.9)/(T (½ + D)), FORCE_MODEL.md
  std::optional<double> safe_N_per_m;  ///< the stiffest of `walls` that is stable
};

/// The file's device replaces the plant of `late_rest`, with its hand and neighbours; the hand presses with
/// 3 N halfway to the bone. The file: {"name", "mass_kg", "damping_ns_per_m", "dry_friction_n",
/// "encoder_step_m", "rate_hz", "delay_ticks", "lag_s", "told": {"delay_ticks", "lag_s",
/// "damping_ns_per_m"}}, all SI; `told` is what the passivity control counts. Errors: kInvalidInput naming
/// file and field.
Result<DeviceStudy> studyDevice(const std::filesystem::path& file, const CaseFile& cases, bool long_form);

/// A table for people.
std::string deviceText(const DeviceStudy& study);
nlohmann::ordered_json deviceJson(const DeviceStudy& study);
/// Draws device.png into the existing `out`, if gnuplot is found.
Status drawDevice(const DeviceStudy& study, const std::filesystem::path& out);

}  // namespace needlelab
