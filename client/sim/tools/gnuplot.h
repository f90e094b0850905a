/// Pictures by gnuplot, a program that is found at run time.
#pragma once

#include <filesystem>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// Whether `gnuplot` is on the PATH.
bool hasGnuplot();

/// Runs a script that begins after `set terminal` and `set output`; the picture appears at `png` when it is
/// whole. `width`, `height` in pixels. Errors: kFailed with gnuplot's own words.
Status plotPng(const std::string& script, const std::filesystem::path& png, int width, int height);

}  // namespace needlelab
