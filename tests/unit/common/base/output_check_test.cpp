#include "common/base/output_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

class OutputCheck : public testing::Test {
 protected:
  fs::path file(const std::string& name) {
    const fs::path path = folder_.path() / name;
    std::ofstream(path) << "x";
    return path;
  }
  [[nodiscard]] fs::path in(const std::string& name) const { return folder_.path() / name; }
  static std::string refusal(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs) {
    const Status status = checkOutputs(inputs, outputs);
    if (status.ok()) return "";
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
    return status.error().message;
  }
  test::TempFolder folder_;
};

TEST_F(OutputCheck, newAndOldFilesThatAreNoInputMayBeWritten) {
  EXPECT_EQ(
      refusal({{"--profile", file("p.json")}}, {{"--out", in("new.csv")}, {"--json", file("old.json")}}), "");
  EXPECT_EQ(refusal({{"--profile", file("p.json")}}, {{"--json", ""}}), "");
}

TEST_F(OutputCheck, anInputIsNeverOverwrittenByWhateverName) {
  const fs::path input = file("p.json");
  fs::create_symlink(input, in("link.json"));
  fs::create_hard_link(input, in("hard.json"));
  for (const fs::path& output : {input, in(".") / "p.json", in("link.json"), in("hard.json")})
    EXPECT_THAT(refusal({{"--profile", input}}, {{"--json", output}}),
                HasSubstr("is the same file as the input"))
        << output;
}

TEST_F(OutputCheck, twoOutputsAreTwoFilesBeforeEitherIsThere) {
  EXPECT_THAT(refusal({}, {{"--out", in("x.csv")}, {"--json", in(".") / "x.csv"}}),
              HasSubstr("is the same file as that of --out"));
}

TEST_F(OutputCheck, foldersAndMissingFoldersAreRefusedByName) {
  EXPECT_THAT(refusal({}, {{"--json", folder_.path()}}), HasSubstr("is a folder"));
  EXPECT_THAT(refusal({}, {{"--json", in("nodir") / "x"}}), HasSubstr("there is no folder"));
}

}  // namespace
}  // namespace needlelab
