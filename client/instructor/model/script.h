/// Scripts for the window, one action a line: tests and demonstrations drive it with them
/// (client/instructor/screens/README.md lists them).
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

struct ScriptAction {
  std::size_t line = 0;            ///< from 1
  std::string verb;                ///< "open"
  std::vector<std::string> words;  ///< what follows; "quoted text" is one word, with \" and \\ in it
};

/// A verb and its words.
struct ScriptVerb {
  std::string_view verb;
  std::size_t least = 0, most = 0;  ///< how many words follow
  std::string_view usage, meaning;  ///< "seek SECONDS", "…": for messages and the README
};
std::span<const ScriptVerb> scriptVerbs();

/// Ignores empty lines, and everything after a # outside of quotes. Errors: kInvalidInput, "NAME:3: …":
/// the first line with an unknown verb, a wrong number of words, a bad number, or an open quote.
Result<std::vector<ScriptAction>> parseScript(std::string_view text, const std::string& name);
/// From a file of at most 1 MiB.
Result<std::vector<ScriptAction>> loadScript(const std::filesystem::path& file);

/// A finite number, all of the text. Errors: kInvalidInput naming it.
Result<double> numberOf(const std::string& text);

}  // namespace needlelab
