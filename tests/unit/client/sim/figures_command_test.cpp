#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "client/sim/tools/gnuplot.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab {
namespace {

using test::sim;
using testing::HasSubstr;

TEST(FiguresCommand, writesEveryTableAndPicture) {
  const test::TempFolder folder;
  const auto out = folder.path() / "new" / "folder";
  const auto outcome = sim({"figures", "--out", out.string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::size_t files = 0;
  for (const char* name : {"fig07", "fig08", "fig09", "fig10", "fig11"}) {
    EXPECT_GT(std::filesystem::file_size(out / (std::string(name) + ".csv")), 10'000u);
    EXPECT_THAT(outcome.out, HasSubstr(name));
    files += 1;
    if (!hasGnuplot()) continue;
    EXPECT_GT(std::filesystem::file_size(out / (std::string(name) + ".png")), 20'000u);
    files += 1;
  }
  EXPECT_EQ(static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(out), {})), files);
}

TEST(FiguresCommand, jsonListsWhatWasWritten) {
  const test::TempFolder folder;
  const auto outcome = sim({"figures", "--out", folder.path().string(), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto whole = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(whole.at("rows").size(), 5u);
  for (const auto& row : whole.at("rows")) {
    EXPECT_TRUE(std::filesystem::exists(row.at("csv").get<std::string>()));
    EXPECT_EQ(row.at("png").is_null(), !hasGnuplot());
  }
}

TEST(FiguresCommand, withoutGnuplotGivesTheTablesAndSaysSo) {
  const test::TempFolder folder;
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", folder.path().c_str(), 1);
  const auto outcome = sim({"figures", "--out", (folder.path() / "out").string()});
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("gnuplot"));
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "out" / "fig11.csv"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "out" / "fig11.png"));
}

TEST(FiguresCommand, aFolderThatCannotBeMadeIsNamed) {
  const test::TempFolder folder;
  const auto file = folder.write("file", "");
  const auto outcome = sim({"figures", "--out", (file / "below").string()});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr((file / "below").string()));
}

}  // namespace
}  // namespace needlelab
