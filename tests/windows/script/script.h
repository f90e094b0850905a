/// Scripts that drive the instructor's window, one action per line (`scriptVerbs` lists the actions).
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
  std::vector<std::string> words;  ///< the arguments; "quoted text" is one word, with \" and \\ for " and \.
};

/// A verb and its words.
struct ScriptVerb {
  std::string_view verb;
  std::size_t least = 0, most = 0;  ///< number of arguments
  std::string_view usage, meaning;  ///< "seek SECONDS", "…": for messages
};
std::span<const ScriptVerb> scriptVerbs();

/// Ignores empty lines and everything after a # outside quotes. Errors: kInvalidInput, "NAME:3: …", for the
/// first line with an unknown verb, a wrong number of words, a bad number, or an open quote.
Result<std::vector<ScriptAction>> parseScript(std::string_view text, const std::string& name);
/// Parses a file of at most 1 MiB.
Result<std::vector<ScriptAction>> loadScript(const std::filesystem::path& file);

/// Parses the whole text as a finite number. Errors: kInvalidInput, naming the text.
Result<double> numberOf(const std::string& text);

}  // namespace needlelab
