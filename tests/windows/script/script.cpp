#include "tests/windows/script/script.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>

#include <fmt/core.h>

#include "common/base/files/files.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

constexpr std::array kVerbs = {
    ScriptVerb{"login", 0, 0, "login",
               "log in with what the command line or the form says; waits until it is done"},
    ScriptVerb{"logout", 0, 0, "logout", "log out"},
    ScriptVerb{"wait", 1, 1, "wait SECONDS", "do nothing for that time"},
    ScriptVerb{"timeout", 1, 1, "timeout SECONDS",
               "how long waiting actions may take from here on; 30 at first"},
    ScriptVerb{"wait-station", 1, 2, "wait-station NAME [online|lesson|help|offline]",
               "wait until the tile is there in that state (online)"},
    ScriptVerb{"wait-text", 1, 1, "wait-text TEXT", "wait until the screen shows the text"},
    ScriptVerb{"wait-gone", 1, 1, "wait-gone TEXT", "wait until the text is gone"},
    ScriptVerb{"wait-live", 1, 1, "wait-live N",
               "wait until N more live frames of the watched station were on the screen"},
    ScriptVerb{"lab", 0, 0, "lab", "show the overview"},
    ScriptVerb{"filter", 1, 1, "filter TEXT", "of the overview: online, all, or a part of a name"},
    ScriptVerb{"open-first", 0, 0, "open-first",
               "watch the station that needs help most; without one that of the first tile"},
    ScriptVerb{"open", 2, 2, "open station NAME", "watch a station"},
    ScriptVerb{"pause", 0, 0, "pause", "stop the live plots, or the replay"},
    ScriptVerb{"resume", 0, 0, "resume", "follow the live stream again, or play"},
    ScriptVerb{"scroll-back", 1, 1, "scroll-back SECONDS", "show what was so long ago"},
    ScriptVerb{"camera", 1, 1, "camera trainee|above|side|free", "of the 3-D view"},
    ScriptVerb{"message", 1, 1, "message TEXT", "to the trainee at the watched station"},
    ScriptVerb{"annotate", 1, 1, "annotate TEXT", "a remark at the moment that is shown"},
    ScriptVerb{"next-exercise", 1, 1, "next-exercise ID", "for the watched station"},
    ScriptVerb{"aids", 1, 1, "aids LIST", "what the trainee is shown: \"depth, force\", none, all, reset"},
    ScriptVerb{"stop-lesson", 0, 1, "stop-lesson [REASON]", "end the watched lesson"},
    ScriptVerb{"sessions", 0, 0, "sessions", "show the list of sessions"},
    ScriptVerb{"search", 1, 1, "search TEXT", "part of the trainee's name; waits for the list"},
    ScriptVerb{"replay", 1, 2, "replay session ID|newest | replay newest", "load a session and show it"},
    ScriptVerb{"play", 0, 0, "play", "play the replay"},
    ScriptVerb{"wait-replay", 1, 1, "wait-replay SECONDS",
               "wait until the replay is there, since the session's beginning"},
    ScriptVerb{"seek", 1, 1, "seek SECONDS", "since the session's beginning"},
    ScriptVerb{"step", 1, 1, "step N", "steps of 10 ms, forward or (negative) back"},
    ScriptVerb{"speed", 1, 1, "speed FACTOR", "0.1 to 8"},
    ScriptVerb{"loop", 1, 2, "loop FROM TO | loop off", "seconds since the beginning"},
    ScriptVerb{"compare", 2, 3, "compare A B [depth|dtw|time]",
               "two sessions: IDs, newest, previous, or reference (the exercise's first expert)"},
    ScriptVerb{"rerun", 1, 2, "rerun PROFILE|own [MODEL]",
               "the session that is replayed, by another profile or model"},
    ScriptVerb{"scores", 0, 0, "scores", "measures and progress of the session that is replayed"},
    ScriptVerb{"export", 1, 1, "export FILE.html|FILE.csv",
               "report or samples of the session that is replayed"},
    ScriptVerb{"help", 0, 0, "help", "show the keyboard shortcuts, or hide them"},
    ScriptVerb{"font-scale", 1, 1, "font-scale FACTOR", "0.8 to 2.5"},
    ScriptVerb{"screenshot", 1, 1, "screenshot FILE.png", "of the next frame"},
    ScriptVerb{"expect", 1, 1, "expect TEXT", "fail unless the screen shows the text now"},
    ScriptVerb{"latency", 0, 1, "latency [MILLISECONDS]",
               "print capture-to-screen latency of the watched station; fail above that p99"},
    ScriptVerb{"frames", 0, 0, "frames", "print what frames cost"},
    ScriptVerb{"print", 1, 1, "print TEXT", "to the terminal"},
    ScriptVerb{"quit", 0, 0, "quit", "end; so does the end of the script"},
};

/// The verbs that take only numbers.
constexpr std::array<std::string_view, 10> kNumbers = {"wait",        "wait-live", "wait-replay", "timeout",
                                                       "scroll-back", "seek",      "step",        "speed",
                                                       "font-scale",  "latency"};

const ScriptVerb* verbOf(std::string_view name) {
  const auto found =
      std::find_if(kVerbs.begin(), kVerbs.end(), [&](const ScriptVerb& v) { return v.verb == name; });
  return found == kVerbs.end() ? nullptr : &*found;
}

/// Splits a line into words; returns nothing for an open quote.
std::optional<std::vector<std::string>> splitWords(std::string_view line) {
  std::vector<std::string> words;
  std::size_t i = 0;
  while (i < line.size()) {
    if (line[i] == ' ' || line[i] == '\t' || line[i] == '\r') {
      ++i;
      continue;
    }
    if (line[i] == '#') break;
    std::string word;
    if (line[i] == '"') {
      for (++i;; ++i) {
        if (i >= line.size()) return std::nullopt;
        if (line[i] == '"') break;
        if (line[i] == '\\' && i + 1 < line.size() && (line[i + 1] == '"' || line[i + 1] == '\\')) ++i;
        word += line[i];
      }
      ++i;
    } else {
      while (i < line.size() && line[i] != ' ' && line[i] != '\t' && line[i] != '\r' && line[i] != '#')
        word += line[i++];
    }
    words.push_back(std::move(word));
  }
  return words;
}

/// Returns the error in an action; empty: none.
std::string faultOf(const ScriptAction& action) {
  const ScriptVerb* const verb = verbOf(action.verb);
  if (verb == nullptr) return "no such action: '" + printable(action.verb) + "'";
  if (action.words.size() < verb->least || action.words.size() > verb->most)
    return "it is written: " + std::string(verb->usage);
  if (std::find(kNumbers.begin(), kNumbers.end(), action.verb) != kNumbers.end()) {
    for (const std::string& word : action.words)
      if (const auto number = numberOf(word); !number.ok()) return number.error().message;
  }
  if (action.verb == "open" && action.words[0] != "station")
    return "it is written: " + std::string(verb->usage);
  if (action.verb == "replay" && action.words.size() == 2 && action.words[0] != "session")
    return "it is written: " + std::string(verb->usage);
  if (action.verb == "compare" && action.words.size() == 3 && action.words[2] != "depth" &&
      action.words[2] != "dtw" && action.words[2] != "time")
    return "alignments are depth, dtw and time, not '" + printable(action.words[2]) + "'";
  if (action.verb == "loop" && !(action.words.size() == 1 && action.words[0] == "off")) {
    if (action.words.size() != 2) return "it is written: " + std::string(verb->usage);
    for (const std::string& word : action.words)
      if (const auto number = numberOf(word); !number.ok()) return number.error().message;
  }
  return {};
}

}  // namespace

std::span<const ScriptVerb> scriptVerbs() {
  return kVerbs;
}

Result<double> numberOf(const std::string& text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    return Error{ErrorCode::kInvalidInput, "'" + printable(text) + "' is not a number"};
  return value;
}

Result<std::vector<ScriptAction>> parseScript(std::string_view text, const std::string& name) {
  std::vector<ScriptAction> actions;
  std::size_t number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const auto fault = [&](const std::string& words) {
      return Error{ErrorCode::kInvalidInput, fmt::format("{}:{}: {}", name, number, words)};
    };
    auto words = splitWords(line);
    if (!words) return fault("a quote is not closed");
    if (words->empty()) continue;
    ScriptAction action{number, words->front(), {words->begin() + 1, words->end()}};
    if (const std::string wrong = faultOf(action); !wrong.empty()) return fault(wrong);
    actions.push_back(std::move(action));
  }
  return actions;
}

Result<std::vector<ScriptAction>> loadScript(const std::filesystem::path& file) {
  ASSIGN_OR_RETURN(const auto text, readWholeFile(file, 1u << 20));
  return parseScript(text, file.string());
}

}  // namespace needlelab
