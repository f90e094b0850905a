// Replays the corpus and the earlier findings through the normal build, and mutants of them.
#include <gtest/gtest.h>

#include <algorithm>

#include "common/base/files/files.h"
#include "tests/fuzz/target.h"
#include "tests/support/random.h"
#include "tests/support/run_form.h"
#include "tests/support/sanitized.h"

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

using test::Random;

/// Changes bytes as a fuzzer does that knows no format: flips, odd numbers, erased, repeated and moved
/// pieces, and a piece of `other`.
void mutateBytes(Bytes& bytes, const Bytes& other, Random& random) {
  for (std::uint64_t changes = 1 + random.below(4); changes > 0; --changes) {
    const std::size_t at = random.below(bytes.size() + 1);
    const auto place = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    const std::size_t length =
        std::min<std::size_t>(bytes.size() - at, 1 + random.below(random.chance(0.5) ? 8 : 300));
    const auto end = place + static_cast<std::ptrdiff_t>(length);
    constexpr std::uint8_t kOdd[] = {0x00, 0x01, 0x7F, 0x80, 0xFE, 0xFF, '"', '/', '\n', '-'};
    switch (random.below(6)) {
      case 0:
        if (at < bytes.size()) *place ^= static_cast<std::uint8_t>(1u << random.below(8));
        break;
      case 1:
        std::fill(place, end, kOdd[random.below(std::size(kOdd))]);
        break;
      case 2:
        bytes.erase(place, end);
        break;
      case 3: {
        const Bytes piece(place, end);
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(random.below(bytes.size() + 1)),
                     piece.begin(), piece.end());
        break;
      }
      case 4: {
        const std::size_t from = random.below(other.size() + 1);
        const std::size_t count = std::min<std::size_t>(other.size() - from, random.below(400));
        const auto first = other.begin() + static_cast<std::ptrdiff_t>(from);
        bytes.insert(place, first, first + static_cast<std::ptrdiff_t>(count));
        break;
      }
      default:
        bytes.insert(place, 1 + random.below(random.chance(0.9) ? 4 : 2000),
                     static_cast<std::uint8_t>(random.bits()));
    }
  }
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

// No fuzzer: nothing looks at what a mutant reaches. It finds what is near to the corpus, in every build and
// without clang.
TEST_P(Replay, mutantsPass) {
  constexpr std::size_t kLargest = 64u << 10;  // a mutant of a long recording would take the time of hundreds
  const Target& target = GetParam();
  std::vector<Bytes> seeds;
  for (const auto& file : filesOf(target.name)) {
    const auto bytes = readWholeFile(file, 8u << 20);
    ASSERT_TRUE(bytes.ok()) << bytes.error().message;
    const ByteView view = viewOf(*bytes);
    if (view.size() <= kLargest) seeds.emplace_back(view.begin(), view.end());
  }
  ASSERT_FALSE(seeds.empty());
  Random random(test::seedOr(1));
  // most faults show under a sanitizer only
  const std::size_t mutants = test::longForm() ? 10'000 : test::kSanitized ? 4'000 : 300;
  for (std::size_t mutant = 0; mutant < mutants; ++mutant) {
    Bytes bytes = seeds[random.below(seeds.size())];
    const auto how = static_cast<unsigned>(random.bits());
    std::size_t written = 0;
    if (target.mutate != nullptr && random.chance(0.5)) {
      const std::size_t size = bytes.size();
      bytes.resize(2 * kLargest);
      written = target.mutate(bytes, size, how);
      bytes.resize(written > 0 ? written : size);
    }
    if (written == 0) mutateBytes(bytes, seeds[random.below(seeds.size())], random);
    if (bytes.empty()) continue;
    if (target.repair != nullptr && !random.chance(1.0 / 8)) target.repair(bytes, how);
    // A finding ends the program; the last line names the mutant.
    std::fprintf(stderr, "mutant %zu\n", mutant);
    target.run(bytes);
  }
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Replay, testing::ValuesIn(kTargets),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace needlelab::fuzz
