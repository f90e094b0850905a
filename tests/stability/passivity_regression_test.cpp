// The counter-examples in regressions/: each fails with its original force source, and the shipped wall
// passes it. gesture_search (search/) finds them and writes them again.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "common/profile/profile.h"
#include "tests/stability/planted_sources.h"
#include "tests/stability/search/counter_example.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;

constexpr AxialModel kKeptModel = AxialModel::kEnhancedTrackingWall;
const fs::path kFolder = NEEDLELAB_REGRESSIONS;

std::vector<fs::path> files() {
  std::vector<fs::path> all;
  for (const auto& entry : fs::directory_iterator(kFolder))
    if (entry.path().extension() == ".json") all.push_back(entry.path());
  std::sort(all.begin(), all.end());
  return all;
}

CounterExample loaded(const fs::path& path) {
  auto example = loadCounterExample(path);
  if (!example.ok()) throw std::runtime_error(example.error().message);
  return *std::move(example);
}

TEST(Regressions, thereAreSome) {
  EXPECT_GE(files().size(), 5u);
}

TEST(Regressions, failWithWhatTheyWereFoundWith) {
  for (const fs::path& path : files()) {
    SCOPED_TRACE(path.filename().string());
    const CounterExample example = loaded(path);
    const auto source = sourceNamed(example.source);
    ASSERT_TRUE(source) << "unknown source: " << example.source;
    const auto record = runGesture(example.gesture, example.model, *source);
    ASSERT_TRUE(record.ok()) << record.error().message;
    const auto finding = findingOf(*record, PassivityLimits{}, example.finding.check);
    ASSERT_TRUE(finding);
    EXPECT_NEAR(finding->measured, example.finding.measured, 1e-6 * std::abs(example.finding.measured));
    EXPECT_DOUBLE_EQ(finding->limit, example.finding.limit);
  }
}

TEST(Regressions, theShippedWallPassesThem) {
  for (const fs::path& path : files()) {
    SCOPED_TRACE(path.filename().string());
    CounterExample example = loaded(path);
    example.gesture.profile.mutable_virtual_fixture()->set_mode(pb::VirtualFixture::CONSERVATIVE);
    const auto record = runGesture(example.gesture, kKeptModel, engineSource());
    ASSERT_TRUE(record.ok()) << record.error().message;
    EXPECT_FALSE(findingOf(*record, PassivityLimits{}));
  }
}

TEST(CounterExampleFile, survivesARoundTrip) {
  for (const fs::path& path : files()) {
    const CounterExample example = loaded(path);
    const std::string text = counterExampleJson(example);
    const auto again = parseCounterExample(text, "again");
    ASSERT_TRUE(again.ok()) << again.error().message;
    EXPECT_EQ(counterExampleJson(*again), text);
    EXPECT_EQ(samplesOf(again->gesture).size(), samplesOf(example.gesture).size());
  }
}

TEST(CounterExampleFile, errorsNameFileFieldAndRange) {
  const std::string good = counterExampleJson(loaded(files().front()));
  const auto messageWith = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    const auto read = parseCounterExample(text, "file.json");
    return read.ok() ? std::string("accepted") : read.error().message;
  };
  EXPECT_EQ(messageWith("\"rate_hz\": 1000.0", "\"rate_hz\": 10"),
            "file.json: motion.rate_hz: 10 is out of range [50, 40000]");
  EXPECT_EQ(messageWith("\"kind\":\"insert", "\"kind\":\"push"),
            "file.json: motion.strokes[0].kind: \"push\" is not a kind of stroke");
  EXPECT_EQ(messageWith("\"tremor_m\"", "\"tremour_m\""), "file.json: motion.tremour_m: is unknown");
  EXPECT_EQ(messageWith("\"seconds\"", "\"second\""), "file.json: motion.strokes[0].seconds: is missing");
  EXPECT_EQ(messageWith("\"model\": \"", "\"model\": \"X"),
            "file.json: found.model: 'XENHANCED_TRACKING_WALL' is not a model");
  EXPECT_EQ(messageWith("{", "["), "file.json: is not JSON");
  EXPECT_EQ(loadCounterExample("/nowhere/x.json").error().message, "/nowhere/x.json: cannot be read");
}

}  // namespace
}  // namespace needlelab::test
