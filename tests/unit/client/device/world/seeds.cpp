#include "tests/unit/client/device/world/seeds.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

namespace needlelab {

// replaces the library's function: one bug at a time, chosen by a test
bool planted(PlantedBug bug) noexcept {
  return test::bugHere() == bug;
}

namespace test {

std::optional<PlantedBug>& bugHere() {
  static std::optional<PlantedBug> bug;
  return bug;
}

std::string again(const SeededRuns& runs, std::uint64_t seed) {
  return "seed " + std::to_string(seed) + " (" + runs.textOf(seed) +
         "); again: NEEDLELAB_SEED=" + std::to_string(seed) +
         " bin/device_world_test --gtest_filter=" + runs.name + ".everyRunKeepsTheRules";
}

void playSeeds(const SeededRuns& runs, std::uint64_t count) {
  if (const char* const one = std::getenv("NEEDLELAB_SEED"); one != nullptr) {
    const std::uint64_t seed = std::strtoull(one, nullptr, 10);
    EXPECT_EQ(runs.brokenBy(seed), "") << again(runs, seed);
    return;
  }
  int failures = 0;
  for (std::uint64_t seed = 1; seed <= count && failures < 5; ++seed) {
    const std::string broken = runs.brokenBy(seed);
    EXPECT_EQ(broken, "") << again(runs, seed);
    if (!broken.empty()) ++failures;
  }
}

void playRegressions(const SeededRuns& runs, const std::string& file) {
  std::ifstream lines(file);
  ASSERT_TRUE(lines) << file;
  std::string line;
  while (std::getline(lines, line)) {
    if (line.empty() || line[0] == '#') continue;
    char* end = nullptr;
    const std::uint64_t seed = std::strtoull(line.c_str(), &end, 10);
    ASSERT_TRUE(end != line.c_str() && *end == ' ') << "not a seed and its reason: " << line;
    EXPECT_EQ(runs.brokenBy(seed), "") << line << "\n" << again(runs, seed);
  }
}

std::uint64_t catchIn(const std::string& what, const std::function<std::string(std::uint64_t seed)>& brokenBy,
                      std::uint64_t most) {
  for (std::uint64_t seed = 1; seed <= most; ++seed)
    if (const std::string broken = brokenBy(seed); !broken.empty()) {
      std::printf("%s: seed %llu, %s\n", what.c_str(), static_cast<unsigned long long>(seed), broken.c_str());
      return seed;
    }
  ADD_FAILURE() << what << " is not caught";
  return 0;
}

void catchBug(const SeededRuns& runs, PlantedBug bug, std::uint64_t most) {
  bugHere() = bug;
  const std::uint64_t seed = catchIn(std::string(nameOf(bug)), runs.brokenBy, most);
  bugHere().reset();
  if (seed == 0) return;
  EXPECT_EQ(runs.brokenBy(seed), "") << "without the bug";
}

}  // namespace test
}  // namespace needlelab
