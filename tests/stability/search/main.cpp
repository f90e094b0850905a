// Searches random gestures for those that give energy to the hand or step without a cause, shrinks the first
// one of each source, and writes them to a folder: the files of ../regressions.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <filesystem>
#include <string>

#include "common/base/files/files.h"
#include "tests/stability/planted_sources.h"
#include "tests/stability/search/counter_example.h"

namespace needlelab::test {
namespace {

struct Searched {
  std::string file, source;
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  ClampingMode clamping = ClampingMode::kConservative;
};

std::vector<Searched> everySource() {
  std::vector<Searched> all = {{"engine", "engine"},
                               {"proportional", "engine", {}, ClampingMode::kProportional},
                               {"direct", "engine", AxialModel::kDirect},
                               {"voigt", "engine", AxialModel::kVoigt}};
  for (const auto& [name, defect] : kFindableDefects) {
    std::string file(name);
    std::replace_if(
        file.begin(), file.end(), [](unsigned char c) { return !std::isalnum(c); }, '-');
    all.push_back({file, sourceName(name)});
  }
  return all;
}

int searchAll(GestureSearch search, const std::filesystem::path& out) {
  for (const Searched& one : everySource()) {
    search.range.clamping = one.clamping;
    const auto found = counterExamples(search, one.source, one.model, *sourceNamed(one.source));
    if (!found.ok()) return std::fprintf(stderr, "%s\n", found.error().message.c_str()), 1;
    fmt::print("{}: {}\n", one.file, found->empty() ? "no gesture fails" : "a gesture fails");
    if (found->empty()) continue;
    const std::string json = counterExampleJson(found->front());
    const Status written = writeFileAtomically(out / (one.file + ".json"), viewOf(json));
    if (!written.ok()) return std::fprintf(stderr, "%s\n", written.error().message.c_str()), 1;
  }
  return 0;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  needlelab::GestureSearch search;
  std::filesystem::path out;
  CLI::App app{"Searches random gestures for counter-examples of passivity, and shrinks them"};
  app.add_option("--gestures", search.gestures, "how many gestures of each source");
  app.add_option("--first-seed", search.first_seed, "their seeds continue from here");
  app.add_option("--out", out, "the folder for the files, which must exist")->required();
  CLI11_PARSE(app, argc, argv);
  return needlelab::test::searchAll(search, out);
}
