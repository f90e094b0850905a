// Replays the corpus and the earlier findings through the normal build.
#include <gtest/gtest.h>

#include <algorithm>

#include "common/base/files.h"
#include "tests/fuzz/target.h"

namespace needlelab::fuzz {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> filesOf(std::string_view target) {
  const fs::path root = NEEDLELAB_SOURCE_DIR;
  std::vector<fs::path> folders = {root / "tests/fuzz/corpus" / target,
                                   root / "tests/fuzz/findings" / target};
  // Seeds that are files of the project already are not stored twice.
  if (target == "profile" || target == "curriculum") folders.push_back(root / "db/samples");
  if (target == "chunk" || target == "recording") folders.push_back(root / "tests/data/gesture");
  std::vector<fs::path> files;
  for (const auto& folder : folders) {
    if (!fs::is_directory(folder)) continue;
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

class Replay : public testing::TestWithParam<Target> {};

TEST_P(Replay, corpusAndFindingsPass) {
  const auto files = filesOf(GetParam().name);
  ASSERT_FALSE(files.empty()) << "a target needs seeds: tests/fuzz/README.md";
  for (const auto& file : files) {
    const auto bytes = readWholeFile(file, 8u << 20);
    ASSERT_TRUE(bytes.ok()) << bytes.error().message;
    // A finding ends the program; the last line names the file.
    std::fprintf(stderr, "%s\n", file.c_str());
    GetParam().run(viewOf(*bytes));
    if (GetParam().repair == nullptr) continue;
    for (const unsigned how : {0u, 1u, 2u, 3u}) {
      Bytes mended(bytes->begin(), bytes->end());
      GetParam().repair(mended, how);
      GetParam().run(mended);
    }
  }
}

TEST_P(Replay, anythingCutOffPasses) {
  const auto files = filesOf(GetParam().name);
  for (const auto& file : files) {
    const auto bytes = readWholeFile(file, 8u << 20);
    ASSERT_TRUE(bytes.ok()) << bytes.error().message;
    const std::size_t step = std::max<std::size_t>(1, bytes->size() / 16);
    for (std::size_t length = 0; length < bytes->size(); length += step)
      GetParam().run(viewOf(*bytes).first(length));
  }
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Replay, testing::ValuesIn(kTargets),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace needlelab::fuzz
