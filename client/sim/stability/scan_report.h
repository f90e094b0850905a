/// The study of stiffness as files. Private to this folder.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "client/sim/stability/scan_limits.h"

namespace needlelab {

nlohmann::ordered_json jsonOf(const StiffnessLimits& limits);

/// Tables; the first column of a model's row is its place in kAxialModelNames.
std::string limitsCsv(const StiffnessLimits& limits);
std::string restCsv(const StiffnessLimits& limits);
std::string beyondCsv(const StiffnessLimits& limits);

/// gnuplot scripts that draw the tables at `csv`.
std::string limitsScript(const StiffnessLimits& limits, const std::filesystem::path& csv);
std::string restScript(const StiffnessLimits& limits, const std::filesystem::path& csv);
std::string beyondScript(const StiffnessLimits& limits, const std::filesystem::path& csv);

}  // namespace needlelab
