/// The `--plunger` option, in one place for every program that has it.
#pragma once

#include <string>

#include "client/device/plunger.h"
#include "common/base/result.h"

namespace needlelab {

/// `PUSH[,PULL]`: the numbers (0-31) of the button that presses the plunger and of the one that draws it
/// back; without the second there is no drawing back. Errors: kInvalidInput, with what was found and is
/// allowed.
Status parsePlungerOption(const std::string& text, PlungerSettings& settings);

}  // namespace needlelab
