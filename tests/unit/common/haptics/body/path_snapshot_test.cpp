/// Paths as bytes.
#include "common/haptics/body/path_snapshot.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "tests/support/random.h"

namespace needlelab::test {
namespace {

PathSnapshot example() {
  PathSnapshot snapshot;
  snapshot.tick = 12345;
  PathLayers& path = snapshot.path;
  path.point_W_m = {0.01, -0.02, 0.03};
  path.normal_W = {0.6, 0, 0.8};
  path.ball_W_m = {0.01, -0.02, 0.02};
  path.ball_radius_m = 0.012;
  path.asked_depth_m = 0.004;
  path.count = 3;
  path.layers[0] = {5, 0};
  path.layers[1] = {0, 0.002};
  path.layers[2] = {kOutside, 0.011};
  return snapshot;
}

TEST(PathSnapshot, comesBackBitForBit) {
  const PathSnapshot before = example();
  const Bytes bytes = encodePath(before);
  EXPECT_LE(bytes.size(), kMaxPathBytes);
  const auto after = decodePath(bytes);
  ASSERT_TRUE(after.ok()) << after.error().message;
  EXPECT_EQ(after->tick, before.tick);
  EXPECT_EQ(after->path.point_W_m, before.path.point_W_m);
  EXPECT_EQ(after->path.normal_W, before.path.normal_W);
  EXPECT_EQ(after->path.ball_W_m, before.path.ball_W_m);
  EXPECT_EQ(after->path.ball_radius_m, before.path.ball_radius_m);
  EXPECT_EQ(after->path.asked_depth_m, before.path.asked_depth_m);
  EXPECT_EQ(after->path.layers, before.path.layers);
  EXPECT_EQ(encodePath(*after), bytes);
}

TEST(PathSnapshot, refusesWhatIsNoPath) {
  const auto refused = [](PathSnapshot snapshot, const std::string& words) {
    const auto decoded = decodePath(encodePath(snapshot));
    ASSERT_FALSE(decoded.ok()) << words;
    EXPECT_NE(decoded.error().message.find(words), std::string::npos) << decoded.error().message;
  };
  PathSnapshot bad = example();
  bad.path.normal_W = {0, 0, 2};
  refused(bad, "not a plane");
  bad = example();
  bad.path.point_W_m.x = std::numeric_limits<double>::quiet_NaN();
  refused(bad, "not a plane");
  bad = example();
  bad.path.layers[0].top_m = 1e-9;
  refused(bad, "layer 0");
  bad = example();
  bad.path.layers[2].top_m = 0.002;
  refused(bad, "layer 2");
  bad = example();
  bad.path.layers[1].structure = kOutside;
  refused(bad, "layer 1");
  bad = example();
  bad.path.layers[1].structure = 40;
  refused(bad, "layer 1");
  bad = example();
  bad.path.count = 0;
  refused(bad, "0 layers");
  bad = example();
  bad.path.asked_depth_m = -1;
  refused(bad, "not a depth");
  bad = example();
  bad.path.ball_radius_m = 2;
  refused(bad, "not a ball");
}

TEST(PathSnapshot, refusesEveryShorterAndLongerText) {
  Bytes bytes = encodePath(example());
  for (std::size_t length = 0; length < bytes.size(); ++length)
    EXPECT_FALSE(decodePath(ByteView(bytes).first(length)).ok()) << length;
  bytes.push_back(0);
  EXPECT_FALSE(decodePath(bytes).ok());
}

TEST(PathSnapshot, aPathThatBeginsOutsideIsRefused) {
  PathSnapshot outside = example();
  outside.path.count = 1;
  outside.path.layers[0] = {kOutside, 0};
  EXPECT_FALSE(decodePath(encodePath(outside)).ok());
}

TEST(PathList, hasItsPathsInOrderUpToItsRoom) {
  PathSnapshot path = example();
  Bytes list;
  std::size_t added = 0;
  for (path.tick = 0; appendPath(path, list); ++path.tick) ++added;
  EXPECT_EQ(added, kMaxPathListBytes / (2 + encodePath(path).size()));
  EXPECT_LE(list.size(), kMaxPathListBytes);
  const auto paths = pathsIn(list);
  ASSERT_EQ(paths.size(), added);
  for (std::size_t i = 0; i < added; ++i) EXPECT_EQ(paths[i].tick, i);
  EXPECT_EQ(encodePath(paths.back()).size(), encodePath(example()).size());
}

TEST(PathList, leavesOutWhatCannotBeRead) {
  Bytes list;
  for (const std::uint64_t tick : {1, 2, 3}) {
    PathSnapshot path = example();
    path.tick = tick;
    ASSERT_TRUE(appendPath(path, list));
  }
  const std::size_t one = list.size() / 3;
  Bytes damaged = list;
  damaged[one + 2] = 9;  // the second one's version
  const auto left = pathsIn(damaged);
  ASSERT_EQ(left.size(), 2u);
  EXPECT_EQ(left[0].tick, 1u);
  EXPECT_EQ(left[1].tick, 3u);
  for (std::size_t length = 0; length < list.size(); ++length)
    EXPECT_EQ(pathsIn(ByteView(list).first(length)).size(), length / one) << length;
  EXPECT_TRUE(pathsIn(Bytes(kMaxPathListBytes + 1)).empty());
}

TEST(PathSnapshot, survivesAnyBytes) {
  Random random(3);
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes = encodePath(example());
    for (int k = 0; k < 3; ++k)
      bytes[static_cast<std::size_t>(random.in(0, static_cast<double>(bytes.size()) - 1e-6))] =
          static_cast<std::uint8_t>(random.in(0, 255.99));
    if (const auto decoded = decodePath(bytes); decoded.ok()) {
      EXPECT_EQ(encodePath(*decoded), bytes);
    }
  }
}

}  // namespace
}  // namespace needlelab::test
