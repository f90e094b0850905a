// Runs deploy/install below a folder without root, and checks the units with systemd.
#include <gmock/gmock.h>

#include <fstream>
#include <sstream>

#include "common/base/files/files.h"
#include "tests/integration/process.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using namespace test;
using namespace std::chrono_literals;
namespace fs = std::filesystem;
using testing::HasSubstr;

class InstallTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto [code, said] =
        run(NEEDLELAB_SOURCE "/deploy/install",
            {"--prefix", "/opt/nl", "--destdir", root(), "--build", fs::path(NEEDLELAB_BIN).parent_path()});
    if (code == 1 && said.find("is not built") != std::string::npos) GTEST_SKIP() << said;
    ASSERT_EQ(code, 0) << said;
  }
  [[nodiscard]] fs::path root() const { return folder_.path() / "root"; }
  [[nodiscard]] fs::path unit(const std::string& name) const {
    return root() / "opt/nl/lib/systemd/system" / name;
  }
  std::pair<int, std::string> run(const std::string& program, const std::vector<std::string>& arguments) {
    Process process(program, arguments, folder_.path() / ("log" + std::to_string(++runs_)));
    const auto code = process.wait();
    return {code.value_or(-1000), process.said()};
  }
  TempFolder folder_;
  int runs_ = 0;
};

TEST_F(InstallTest, putsProgramsUnitsAndGuideInPlace) {
  for (const char* program : {"server", "admin", "station", "instructor"}) {
    const auto [code, said] =
        run(root() / "opt/nl/bin" / (std::string("needlelab-") + program), {"--version"});
    EXPECT_EQ(code, 0) << said;
  }
  EXPECT_TRUE(fs::exists(root() / "opt/nl/share/needlelab/OPERATIONS.md"));
  for (const char* name : {"needlelab-server.service", "needlelab-server.socket", "needlelab-backup.service",
                           "needlelab-backup.timer"}) {
    const auto text = *readWholeFile(unit(name));
    EXPECT_THAT(text, testing::Not(HasSubstr("@PREFIX@"))) << name;
    EXPECT_THAT(text, HasSubstr("/opt/nl")) << name;
  }
  // A second installation keeps edited files.
  std::ofstream(root() / "etc/needlelab/server.conf") << "mine";
  EXPECT_EQ(run(NEEDLELAB_SOURCE "/deploy/install", {"--prefix", "/opt/nl", "--destdir", root(), "--build",
                                                     fs::path(NEEDLELAB_BIN).parent_path()})
                .first,
            0);
  EXPECT_EQ(*readWholeFile(root() / "etc/needlelab/server.conf"), "mine");
}

TEST_F(InstallTest, programsFindTheirFilesInAFolderThatWasMoved) {
  fs::rename(root() / "opt/nl", folder_.path() / "elsewhere");
  const fs::path bin = folder_.path() / "elsewhere/bin", out = folder_.path() / "demo";
  const auto [code, said] =
      run("/usr/bin/env", {"-u", "DISPLAY", "bash", std::string(NEEDLELAB_SOURCE "/deploy/needlelab-demo"),
                           "--headless", "--seconds", "6", "--bin", bin, "--out", out});
  EXPECT_EQ(code, 0) << said;
  EXPECT_THAT(said, HasSubstr("the lesson is stored and verified"));
  EXPECT_THAT(*readWholeFile(out / "latest/server.log"),
              HasSubstr((bin.parent_path() / "share/needlelab/web").string()));
}

TEST_F(InstallTest, theCommandLinesOfTheUnitsAreUnderstood) {
  // Runs the command line of ExecStart with --help: the program refuses unknown options.
  for (const auto& [name, program] : {std::pair("needlelab-server.service", "needlelab-server"),
                                      std::pair("needlelab-backup.service", "needlelab-admin")}) {
    std::string text = *readWholeFile(unit(name));
    for (std::size_t at; (at = text.find("\\\n")) != std::string::npos;) text.replace(at, 2, " ");
    const auto begin = text.find("ExecStart=") + 10;
    std::istringstream words(text.substr(begin, text.find('\n', begin) - begin));
    std::vector<std::string> arguments;
    for (std::string word; words >> word;)
      if (word[0] != '$') arguments.push_back(word);
    EXPECT_EQ(arguments[0], "/opt/nl/bin/" + std::string(program));
    arguments.erase(arguments.begin());
    arguments.emplace_back("--help");
    const auto [code, said] = run(program, arguments);
    EXPECT_EQ(code, 0) << said;
    arguments.back() = "--no-such-option";
    EXPECT_EQ(run(program, arguments).first, 2) << "so the test above can fail";
  }
}

TEST_F(InstallTest, systemdTakesTheUnitsAndFindsTheSandboxTight) {
  if (!fs::exists("/usr/bin/systemd-analyze")) GTEST_SKIP() << "systemd-analyze is not installed";
  // The programs are below our folder; systemd gets their path.
  std::vector<std::string> arguments = {"verify", "--man=no"};
  for (const char* name : {"needlelab-server.service", "needlelab-server.socket", "needlelab-backup.service",
                           "needlelab-backup.timer"}) {
    std::string text = *readWholeFile(unit(name));
    for (std::size_t at = 0; (at = text.find("/opt/nl", at)) != std::string::npos;
         at += root().string().size() + 7)
      text.insert(at, root().string());
    arguments.push_back(folder_.write(name, text));
  }
  const auto [code, said] = run("/usr/bin/systemd-analyze", arguments);
  EXPECT_EQ(code, 0) << said;
  EXPECT_THAT(said, testing::Not(HasSubstr("needlelab"))) << "no warning of any of ours";
  for (const char* name : {"needlelab-server.service", "needlelab-backup.service"}) {
    const auto rated = run("/usr/bin/systemd-analyze",
                           {"security", "--offline=true", "--no-pager", "--threshold=20", unit(name)});
    EXPECT_EQ(rated.first, 0) << rated.second;
    const auto at = rated.second.find("Overall exposure level");
    if (at != std::string::npos) std::printf("%s: %s", name, rated.second.substr(at).c_str());
  }
}

}  // namespace
}  // namespace needlelab
