/// What a program prints when its command line is wrong.
#pragma once

#include <CLI/CLI.hpp>
#include <iosfwd>
#include <string>

namespace needlelab {

/// Returns a sentence about the first word of the command line that names no command or option of `app`, with
/// the nearest ones that exist: "'session lst' is not a command: did you mean 'session list'?" Returns an
/// empty text if each word is known, or if nothing that exists is near an unknown option.
std::string unknownWord(const CLI::App& app, int argc, const char* const* argv);

/// Ends the parsing of a command line: prints help or version to `out`, or what is wrong to `err`. Returns
/// kExitDone or kExitInvalid.
int endOfParsing(const CLI::App& app, const CLI::ParseError& error, int argc, const char* const* argv,
                 std::ostream& out, std::ostream& err);
/// The same, to standard output and standard error.
int endOfParsing(const CLI::App& app, const CLI::ParseError& error, int argc, const char* const* argv);

}  // namespace needlelab
