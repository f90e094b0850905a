/// The program, callable from tests.
#pragma once

#include <iosfwd>

namespace needlelab {

/// Gives the exit code of DESIGN §5. Results go to `out`, everything else to `err`.
int runAdmin(int argc, const char* const* argv, std::ostream& out, std::ostream& err);

}  // namespace needlelab
