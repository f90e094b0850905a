/// The options of a profile and a trajectory, the same for every subcommand that takes them.
#pragma once

#include <CLI/CLI.hpp>

#include "client/sim/tools/offline_scene.h"

namespace needlelab {

/// `options` must outlive the parsing.
void addOfflineOptions(CLI::App& app, OfflineOptions& options);

/// The profile's warnings (DESIGN §4), a line each on stderr.
void sayWarnings(const OfflineScene& scene);

}  // namespace needlelab
