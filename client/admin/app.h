/// The admin program as a function, for tests.
#pragma once

#include <iosfwd>

namespace needlelab {

/// Returns 0 (done), 1 (failed or refused) or 2 (wrong usage or input). Results go to `out`, everything else
/// to `err`.
int runAdmin(int argc, const char* const* argv, std::ostream& out, std::ostream& err);

}  // namespace needlelab
