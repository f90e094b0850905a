/// The `--hand-…` options, in one place for every program that has a simulated hand.
#pragma once

#include <CLI/CLI.hpp>

#include "device/hand.h"

namespace needlelab {

/// Adds the options to `app`; `options` must live until parsing is done. Values out of range are CLI11 parse
/// errors.
void addHandOptions(CLI::App& app, HandOptions& options);

}  // namespace needlelab
