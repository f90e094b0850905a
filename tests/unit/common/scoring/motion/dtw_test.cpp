#include "common/scoring/motion/dtw.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "tests/unit/common/scoring/continuous_gesture.h"

namespace needlelab {
namespace {

TipPath along(const std::vector<double>& x) {
  TipPath path;
  for (const double v : x) path.push_back({v, 0, 0});
  return path;
}

/// Enumerates all alignments by the definition, without a table. Points (i, j) with |j − straight line| >
/// band are excluded; `a` is the longer path.
double bruteForce(const TipPath& a, const TipPath& b, std::size_t band) {
  const auto allowed = [&](std::size_t i, std::size_t j) {
    const double straight =
        a.size() == 1 ? 0 : static_cast<double>(i * (b.size() - 1)) / static_cast<double>(a.size() - 1);
    return std::abs(std::floor(straight + 0.5) - static_cast<double>(j)) <= static_cast<double>(band);
  };
  double best = std::numeric_limits<double>::infinity();
  const std::function<void(std::size_t, std::size_t, double)> go = [&](std::size_t i, std::size_t j,
                                                                       double sum) {
    if (i + 1 == a.size() && j + 1 == b.size()) {
      best = std::min(best, sum);
      return;
    }
    const auto step = [&](std::size_t di, std::size_t dj) {
      if (i + di >= a.size() || j + dj >= b.size() || !allowed(i + di, j + dj)) return;
      go(i + di, j + dj, sum + static_cast<double>(di + dj) * norm(a[i + di] - b[j + dj]));
    };
    step(1, 0);
    step(0, 1);
    step(1, 1);
  };
  go(0, 0, 2 * norm(a[0] - b[0]));
  return best / static_cast<double>(a.size() + b.size());
}

TEST(Dtw, handMadeAlignments) {
  // dwelling costs nothing: 0 1 1 1 2 and 0 1 2
  EXPECT_DOUBLE_EQ(*dtwDistance(along({0, 1, 1, 1, 2}), along({0, 1, 2}), 5), 0);
  // everywhere shifted aside by 3
  TipPath aside = along({0, 1, 2, 3});
  for (Vec3& p : aside) p.y = 3;
  EXPECT_DOUBLE_EQ(*dtwDistance(along({0, 1, 2, 3}), aside, 5), 3);
  // single points: 2·5/(1 + 1)
  EXPECT_DOUBLE_EQ(*dtwDistance(along({0}), along({5}), 5), 5);
  // one point against three: 2·1 at the start, then 1·1 and 1·2, over 4 points
  EXPECT_DOUBLE_EQ(*dtwDistance(along({0}), along({1, 1, 2}), 5), (2 + 1 + 2) / 4.0);
  // 0 2 and 0 1 2: the middle point is 1 from either neighbour, reached by a single step
  EXPECT_DOUBLE_EQ(*dtwDistance(along({0, 2}), along({0, 1, 2}), 5), 1 / 5.0);
}

TEST(Dtw, theBandForbidsLargeTimeShifts) {
  // a pause of 30 points early in one and late in the other: free without a band, expensive with a narrow one
  TipPath early, late;
  for (int i = 0; i < 90; ++i) {
    early.push_back({i < 30 ? 0.0 : i - 30.0, 0, 0});
    late.push_back({i < 60 ? static_cast<double>(i) : 59.0, 0, 0});
  }
  EXPECT_DOUBLE_EQ(*dtwDistance(early, late, 90), 0);
  EXPECT_DOUBLE_EQ(*dtwDistance(early, late, 30), 0);
  EXPECT_GT(*dtwDistance(early, late, 10), 5);
}

TEST(Dtw, agreesWithEveryAlignmentCounted) {
  std::mt19937_64 random(11);
  for (int i = 0; i < 400; ++i) {
    const std::size_t n = 1 + random() % 7, m = 1 + random() % n, band = 1 + random() % 4;
    const auto path = [&](std::size_t length) {
      TipPath points;
      for (std::size_t k = 0; k < length; ++k)
        points.push_back({static_cast<double>(random() % 10), static_cast<double>(random() % 10), 0});
      return points;
    };
    const TipPath a = path(n), b = path(m);
    const auto distance = dtwDistance(a, b, band);
    ASSERT_TRUE(distance.has_value()) << n << " " << m << " " << band;
    EXPECT_NEAR(*distance, bruteForce(a, b, band), 1e-12) << n << " points and " << m << ", band " << band;
    EXPECT_EQ(*distance, *dtwDistance(b, a, band)) << "in either order";
  }
}

TEST(Dtw, refusesIncomparablePaths) {
  EXPECT_FALSE(dtwDistance({}, along({1})).has_value());
  EXPECT_FALSE(dtwDistance(along({1}), {}).has_value());
  EXPECT_FALSE(dtwDistance(TipPath(kMaxPathPoints + 1), along({1})).has_value());
  EXPECT_FALSE(dtwDistance(along({std::nan("")}), along({1})).has_value());
}

TEST(Dtw, costsTheLongerPathTimesItsBand) {
  EXPECT_EQ(dtwCells(1200, 1200), 1200u * 481u) << "a minute: the band is 240 points to both sides";
  EXPECT_EQ(dtwCells(1200, 300), dtwCells(300, 1200));
  EXPECT_EQ(dtwCells(1200, 300), 1200u * 300u) << "the band is wider than the shorter path";
  EXPECT_EQ(dtwCells(100, 90), 100u * 41u) << "the least band";
  EXPECT_EQ(dtwCells(kMaxPathPoints + 1, 1), 0u);
  EXPECT_EQ(dtwCells(0, 1), 0u);
}

TEST(GesturePaths, goFromTheFirstEntryToTheLastExit) {
  const auto samples = inAndOut(1000);
  const TipPath path = tipPathOf(samples, 1000, {});
  // in tissue from the ease's share 4/9 on, s ≈ 0.4703: 5 s − 2·0.9406 s at 20 points per second
  EXPECT_NEAR(static_cast<double>(path.size()), (5 - 2 * 0.9406) * kPathRateHz + 1, 1.01);
  for (const Vec3& p : path) {
    EXPECT_LE(p.z, 1e-3);
    EXPECT_GE(p.z, -0.0251);
  }
  // in the limb's frame: the positions of limb and device do not matter
  const Pose X_WL{{1, 2, 3}, normalized(Quat{0.5, 0, 0, 1})};
  auto moved = samples;
  for (GestureSample& s : moved) setTip(s, X_WL * Vec3{s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]});
  const TipPath same = tipPathOf(moved, 1000, X_WL);
  ASSERT_EQ(same.size(), path.size());
  for (std::size_t i = 0; i < path.size(); ++i) EXPECT_NEAR(norm(same[i] - path[i]), 0, 1e-12);
  // never in tissue: no path
  EXPECT_TRUE(tipPathOf(gesture(1000, 1, [](double, GestureSample&) {}), 1000, {}).empty());
}

TEST(GesturePaths, aScoreHasTheDistanceFromTheNearestReference) {
  auto samples = inAndOut(1000);
  const TipPath itself = tipPathOf(samples, 1000, {});
  TipPath aside = itself, far = itself;
  for (Vec3& p : aside) p.x += 0.002;
  for (Vec3& p : far) p.x += 0.05;
  const auto with = [&](const std::vector<TipPath>& references) {
    return scoreGesture(samples, 1000, halfSpace(), {}, nullptr, references);
  };
  EXPECT_EQ(find(with({}), "dtw_distance_m"), nullptr);
  EXPECT_EQ(find(with({TipPath()}), "dtw_distance_m"), nullptr) << "a reference that was never in tissue";
  EXPECT_NEAR(valueOf(with({itself}), "dtw_distance_m"), 0, 1e-15);
  EXPECT_NEAR(valueOf(with({far, aside}), "dtw_distance_m"), 0.002, 1e-12);
}

/// Returns the sum of an alignment as defined in the header.
double costOf(const DtwAlignment& alignment, const TipPath& a, const TipPath& b) {
  double sum = 2 * norm(a[0] - b[0]);
  for (std::size_t k = 1; k < alignment.pairs.size(); ++k) {
    const auto& [i, j] = alignment.pairs[k];
    const auto steps = (i - alignment.pairs[k - 1].a) + (j - alignment.pairs[k - 1].b);
    sum += static_cast<double>(steps) * norm(a[i] - b[j]);
  }
  return sum / static_cast<double>(a.size() + b.size());
}

TEST(DtwAlignment, aHandMadeOne) {
  // 0 1 1 2 and 0 1 2: the second dwells on 1
  const auto alignment = dtwAlignment(along({0, 1, 1, 2}), along({0, 1, 2}), 5);
  ASSERT_TRUE(alignment);
  EXPECT_EQ(alignment->pairs, (std::vector<DtwPair>{{0, 0}, {1, 1}, {2, 1}, {3, 2}}));
  EXPECT_DOUBLE_EQ(alignment->distance_m, 0);
  // in reverse order the pairs are swapped
  const auto turned = dtwAlignment(along({0, 1, 2}), along({0, 1, 1, 2}), 5);
  EXPECT_EQ(turned->pairs, (std::vector<DtwPair>{{0, 0}, {1, 1}, {1, 2}, {2, 3}}));
}

TEST(DtwAlignment, isAWalkFromStartToEndThatCostsTheDistance) {
  std::mt19937 random(20261121);
  std::uniform_real_distribution<double> place(-1, 1);
  std::uniform_int_distribution<std::size_t> length(1, 90);
  for (int trial = 0; trial < 200; ++trial) {
    TipPath a(length(random)), b(length(random));
    for (auto* path : {&a, &b})
      for (Vec3& p : *path) p = {place(random), place(random), place(random)};
    const std::size_t band = 1 + trial % 30;
    const auto distance = dtwDistance(a, b, band);
    const auto alignment = dtwAlignment(a, b, band);
    ASSERT_EQ(distance.has_value(), alignment.has_value());
    if (!alignment) continue;
    EXPECT_EQ(alignment->distance_m, *distance);
    EXPECT_EQ(alignment->pairs.front(), (DtwPair{0, 0}));
    EXPECT_EQ(alignment->pairs.back(), (DtwPair{a.size() - 1, b.size() - 1}));
    for (std::size_t k = 1; k < alignment->pairs.size(); ++k) {
      const std::size_t di = alignment->pairs[k].a - alignment->pairs[k - 1].a;
      const std::size_t dj = alignment->pairs[k].b - alignment->pairs[k - 1].b;
      ASSERT_TRUE(di <= 1 && dj <= 1 && di + dj >= 1);
    }
    EXPECT_NEAR(costOf(*alignment, a, b), *distance, 1e-12);
  }
}

TEST(DtwAlignment, whatHasNoDistanceHasNone) {
  EXPECT_FALSE(dtwAlignment({}, along({1}), 3));
  EXPECT_FALSE(dtwAlignment(TipPath(kMaxPathPoints + 1), along({1}), 3));
}

}  // namespace
}  // namespace needlelab
