#include "common/base/planted_bug.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <set>
#include <string>

namespace needlelab::test {
namespace {

// The users' programs contain no planted bug, regardless of the environment.
TEST(PlantedBug, isInNoProgramThatUsersRun) {
  std::set<std::string_view> names;
  for (int i = 0; i < kPlantedBugs; ++i) {
    const auto bug = static_cast<PlantedBug>(i);
    ASSERT_EQ(::setenv("NEEDLELAB_PLANT", std::string(nameOf(bug)).c_str(), 1), 0);
    EXPECT_FALSE(planted(bug)) << nameOf(bug);
    names.insert(nameOf(bug));
  }
  ::unsetenv("NEEDLELAB_PLANT");
  EXPECT_EQ(names.size(), static_cast<std::size_t>(kPlantedBugs));
}

}  // namespace
}  // namespace needlelab::test
