// Runs files through one target without libFuzzer, for coverage or to debug a finding. usage: replay TARGET
// FILE|FOLDER...
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "common/base/files/files.h"
#include "tests/fuzz/target.h"

int main(int argc, char** argv) {
  namespace fs = std::filesystem;
  using namespace needlelab;
  const auto found = argc < 3 ? std::end(fuzz::kTargets)
                              : std::find_if(std::begin(fuzz::kTargets), std::end(fuzz::kTargets),
                                             [&](const auto& t) { return t.name == argv[1]; });
  if (found == std::end(fuzz::kTargets)) {
    std::fprintf(stderr, "usage: %s TARGET FILE|FOLDER...; targets:", argv[0]);
    for (const auto& target : fuzz::kTargets) std::fprintf(stderr, " %s", std::string(target.name).c_str());
    std::fprintf(stderr, "\n");
    return 2;
  }
  std::vector<fs::path> files;
  for (int i = 2; i < argc; ++i) {
    if (!fs::is_directory(argv[i])) {
      files.emplace_back(argv[i]);
      continue;
    }
    for (const auto& entry : fs::directory_iterator(argv[i]))
      if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  for (const auto& file : files) {
    const auto bytes = readWholeFile(file, 8u << 20);
    if (!bytes.ok()) {
      std::fprintf(stderr, "%s\n", bytes.error().message.c_str());
      return 2;
    }
    found->run(viewOf(*bytes));
  }
  std::printf("%s: %zu files\n", argv[1], files.size());
  return 0;
}
