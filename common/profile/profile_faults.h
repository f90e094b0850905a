/// For an author who is still writing: everything that is wrong with a profile, not only the first of it.
#pragma once

#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Each fault begins with its path where it has one, `layers[2].cutting_force_n: …`. What binds several
/// fields is looked at once the fields are right by themselves, and stops at its first fault. Empty:
/// parseProfile takes the text.
std::vector<Error> profileFaults(std::string_view json);

}  // namespace needlelab
