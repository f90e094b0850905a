/// The options of needlelab-station, in the groups in which --help shows them.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/station/run/options.h"

namespace needlelab {

/// What the command line says in a form that is checked or converted later.
struct RawOptions {
  std::string server, tool, placement, plunger, on_fault;
  std::optional<std::string> json;
  double keep_days = 14, quota_mib = 4096;
  std::optional<std::string> enrolled;
  std::vector<std::string> screenshots, screenshot_times;
  std::string window_size;
  bool list_devices = false, self_test = false, calibrate = false, list_exercises = false;
};

/// Where samples wait when nothing else is said.
std::filesystem::path defaultSpool();

/// Adds all of them. `o` and `raw` must outlive `app`.
void addStationOptions(CLI::App& app, StationOptions& o, RawOptions& raw);

}  // namespace needlelab
