/// The `--hand-…` options, in one place for every program that has a simulated hand.
#pragma once

#include <CLI/CLI.hpp>

#include "client/device/hand.h"

namespace needlelab {

/// A person who is asked to reach a target corrects himself; see HandOptions::correction_per_s.
inline constexpr double kCommandLineCorrection_per_s = 2;

/// Adds the options to `app`, and sets the command line's own default in `options`, which must live until
/// parsing is done. Values out of range are CLI11 parse errors.
void addHandOptions(CLI::App& app, HandOptions& options);

}  // namespace needlelab
