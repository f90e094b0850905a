// The memory of the cut as bytes: every number is restored, and hostile bytes are refused.
#include "common/haptics/cut_snapshot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace needlelab::test {
namespace {

CutSnapshot snapshotOf(std::uint32_t tracks) {
  CutSnapshot snapshot;
  snapshot.tick = 123'456'789'012;
  snapshot.insertions = 98'765'432'109;
  CutMemory& cuts = snapshot.cuts;
  cuts.count = tracks;
  cuts.next = tracks % static_cast<std::uint32_t>(kMaxCutTracks);
  for (std::uint32_t i = 0; i < tracks; ++i)
    cuts.tracks[i] = {{0.1 * i, -0.2, 0.3}, {0.6, 0, -0.8}, 0.01 * (i + 1), 1u << i};
  return snapshot;
}

bool refused(const Bytes& bytes, ErrorCode code = ErrorCode::kCorrupt) {
  const auto snapshot = decodeCuts(bytes);
  return !snapshot.ok() && snapshot.error().code == code;
}

TEST(CutSnapshot, givesBackEveryNumber) {
  for (std::uint32_t tracks = 0; tracks <= kMaxCutTracks; ++tracks) {
    const CutSnapshot sent = snapshotOf(tracks);
    const Bytes bytes = encodeCuts(sent);
    EXPECT_EQ(bytes.size(), 20 + 60 * tracks);
    EXPECT_LE(bytes.size(), kMaxCutSnapshotBytes);
    const auto got = decodeCuts(bytes);
    ASSERT_TRUE(got.ok()) << got.error().message;
    EXPECT_EQ(got->tick, sent.tick);
    EXPECT_EQ(got->insertions, sent.insertions);
    EXPECT_EQ(got->cuts.count, sent.cuts.count);
    EXPECT_EQ(got->cuts.next, sent.cuts.next);
    for (std::uint32_t i = 0; i < tracks; ++i) {
      EXPECT_EQ(got->cuts.tracks[i].p_entry_W_m, sent.cuts.tracks[i].p_entry_W_m);
      EXPECT_EQ(got->cuts.tracks[i].u_W, sent.cuts.tracks[i].u_W);
      EXPECT_EQ(got->cuts.tracks[i].length_m, sent.cuts.tracks[i].length_m);
      EXPECT_EQ(got->cuts.tracks[i].membranes, sent.cuts.tracks[i].membranes);
    }
    EXPECT_EQ(encodeCuts(*got), bytes);
  }
}

TEST(CutSnapshot, givesBackTheHolesOfABody) {
  CutSnapshot sent = snapshotOf(3);
  sent.cuts.tracks[1].hole_count = 2;
  sent.cuts.tracks[1].holes[0] = {7, 0.0391};
  sent.cuts.tracks[1].holes[1] = {7, -0.0566};
  const Bytes bytes = encodeCuts(sent);
  EXPECT_EQ(bytes.size(), 20 + 61 * 3 + 9 * 2);
  const auto got = decodeCuts(bytes);
  ASSERT_TRUE(got.ok()) << got.error().message;
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(got->cuts.tracks[i].holes, sent.cuts.tracks[i].holes);
  Bytes many = bytes;
  many[20 + 60] = kMaxCutHoles + 1;  // of the first track
  EXPECT_TRUE(refused(many));
}

TEST(CutSnapshot, anotherLengthIsRefused) {
  const Bytes bytes = encodeCuts(snapshotOf(3));
  for (std::size_t length = 0; length < bytes.size(); ++length)
    EXPECT_TRUE(refused({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(length)})) << length;
  Bytes longer = bytes;
  longer.push_back(0);
  EXPECT_TRUE(refused(longer));
}

TEST(CutSnapshot, anotherVersionAndPlacesBeyondTheRingAreRefused) {
  for (const std::uint8_t version : {0, 1, 4}) {
    Bytes bytes = encodeCuts(snapshotOf(3));
    bytes[0] = version;
    EXPECT_TRUE(refused(bytes, ErrorCode::kVersion)) << int{version};
    EXPECT_FALSE(cutsIn(bytes)) << "who asks for no error gets no memory";
  }
  EXPECT_TRUE(cutsIn(encodeCuts(snapshotOf(3))));
  EXPECT_FALSE(cutsIn({}));
  const auto with = [](std::size_t at, std::uint8_t value) {
    Bytes changed = encodeCuts(snapshotOf(3));
    changed[at] = value;
    return changed;
  };
  for (const std::uint8_t count : {2, 4, 17, 255}) EXPECT_TRUE(refused(with(1, count))) << int{count};
  for (const std::uint8_t next : {0, 4, 16, 255}) EXPECT_TRUE(refused(with(2, next))) << int{next};
  EXPECT_TRUE(refused(with(3, 1))) << "for a later version";
}

TEST(CutSnapshot, numbersThatAreNoLineAreRefused) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double inf = std::numeric_limits<double>::infinity();
  const auto with = [](auto change) {
    CutSnapshot snapshot = snapshotOf(3);
    change(snapshot.cuts);
    return encodeCuts(snapshot);
  };
  EXPECT_TRUE(refused(with([&](CutMemory& cuts) { cuts.tracks[1].p_entry_W_m.y = inf; })));
  EXPECT_TRUE(refused(with([&](CutMemory& cuts) { cuts.tracks[1].u_W.z = nan; })));
  EXPECT_TRUE(refused(with([&](CutMemory& cuts) { cuts.tracks[2].u_W = {0, 0, 0}; })));
  EXPECT_TRUE(refused(with([&](CutMemory& cuts) { cuts.tracks[2].u_W = {0, 0, 1.001}; })));
  EXPECT_TRUE(refused(with([&](CutMemory& cuts) { cuts.tracks[0].length_m = -1e-9; })));
  EXPECT_TRUE(refused(with([&](CutMemory& cuts) { cuts.tracks[0].length_m = inf; })));
}

}  // namespace
}  // namespace needlelab::test
