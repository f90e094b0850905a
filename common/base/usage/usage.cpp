#include "common/base/usage/usage.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <string_view>
#include <vector>

#include "common/base/program.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

/// "'session list', 'session get' or 'session show'", nearest first; empty if no name is near.
std::string nearestOf(const std::string& typed, const std::vector<KnownName>& known,
                      const std::string& before) {
  std::string words;
  const auto near = nearNames(typed, known);
  for (std::size_t i = 0; i < near.size(); ++i)
    words += fmt::format("{}'{}{}'", i == 0 ? "" : i + 1 < near.size() ? ", " : " or ", before, near[i].name);
  return words;
}

std::vector<KnownName> commandsOf(const CLI::App& app) {
  std::vector<KnownName> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    if (!command->get_name().empty()) names.push_back({command->get_name(), ""});
  return names;
}

bool isCommand(const CLI::App& app, std::string_view word) {
  return std::ranges::any_of(commandsOf(app), [&](const KnownName& command) { return command.name == word; });
}

std::string unknownCommand(const CLI::App& app, const std::string& before, const std::string& word) {
  const auto known = commandsOf(app);
  std::string near = nearestOf(word, known, before);
  if (!near.empty()) return fmt::format("'{}{}' is not a command: did you mean {}?", before, word, near);
  for (const KnownName& command : known) near += (near.empty() ? "" : ", ") + command.name;
  return fmt::format("'{}{}' is not a command; there are: {}", before, word, near);
}

/// A sentence about the first word that names no command or option of `app`, with the nearest ones that
/// exist; empty if each word is known, or if nothing is near an unknown option.
std::string unknownWord(const CLI::App& app, int argc, const char* const* argv) {
  const CLI::App* command = &app;
  std::string before;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--") return {};
    if (word.size() > 1 && word[0] == '-') {
      const std::string name = word.substr(0, word.find('='));
      const CLI::Option* option = nullptr;
      std::vector<KnownName> known;
      for (const CLI::App* place = command; place != nullptr && option == nullptr;
           place = place->get_parent()) {
        option = place->get_option_no_throw(name);
        for (const CLI::Option* each : place->get_options())
          for (const std::string& long_name : each->get_lnames()) known.push_back({"--" + long_name, ""});
      }
      if (option == nullptr) {
        const std::string near = name.starts_with("--") ? nearestOf(name, known, "") : "";
        return near.empty() ? "" : fmt::format("{} is not an option: did you mean {}?", name, near);
      }
      // passes over its value; a value that may be left out is not a command's name
      const bool may_have_value =
          option->get_items_expected_max() > 0 && i + 1 < argc && argv[i + 1][0] != '-';
      if (name == word &&
          (option->get_items_expected_min() > 0 || (may_have_value && !isCommand(*command, argv[i + 1]))))
        ++i;
      continue;
    }
    if (!isCommand(*command, word)) {
      const bool takes_values = std::ranges::any_of(command->get_options(), &CLI::Option::get_positional);
      if (takes_values || commandsOf(*command).empty()) continue;
      return unknownCommand(*command, before, word);
    }
    command = command->get_subcommand(word);
    before += word + " ";
  }
  return {};
}

}  // namespace

int endOfParsing(const CLI::App& app, const CLI::ParseError& error, int argc, const char* const* argv,
                 std::ostream& out, std::ostream& err) {
  if (error.get_exit_code() != 0) {
    if (const std::string words = unknownWord(app, argc, argv); !words.empty()) {
      err << std::filesystem::path(argv[0]).filename().string() << ": " << words
          << "\nRun with --help for more information.\n";
      return kExitInvalid;
    }
  }
  // 0 for --help and --version; all other codes of CLI11 mean wrong usage
  return app.exit(error, out, err) == 0 ? kExitDone : kExitInvalid;
}

int endOfParsing(const CLI::App& app, const CLI::ParseError& error, int argc, const char* const* argv) {
  return endOfParsing(app, error, argc, argv, std::cout, std::cerr);
}

}  // namespace needlelab
