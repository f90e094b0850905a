/// What a program prints when its command line is wrong.
#pragma once

#include <CLI/CLI.hpp>
#include <iosfwd>

namespace needlelab {

/// Ends the parsing of a command line: prints help or version to `out`, or what is wrong to `err`; of a wrong
/// command or option the nearest that exist: "'session lst' is not a command: did you mean 'session list'?"
/// Returns kExitDone or kExitInvalid.
int endOfParsing(const CLI::App& app, const CLI::ParseError& error, int argc, const char* const* argv,
                 std::ostream& out, std::ostream& err);
/// The same, to standard output and standard error.
int endOfParsing(const CLI::App& app, const CLI::ParseError& error, int argc, const char* const* argv);

}  // namespace needlelab
