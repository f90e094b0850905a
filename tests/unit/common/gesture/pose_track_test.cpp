#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "common/gesture/pose_track.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
constexpr char kHeader[] = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw";

class PoseTrackFile : public testing::Test {
 protected:
  // Writes a file and reads it as a track.
  Result<PoseTrack> read(const std::string& text) {
    path_ = std::filesystem::temp_directory_path() /
            ("needlelab_track_" + std::to_string(testing::UnitTest::GetInstance()->random_seed()) +
             testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv");
    std::ofstream(path_) << text;
    auto track = readPoseTrack(path_);
    std::filesystem::remove(path_);
    return track;
  }
  std::string refusal(const std::string& text) {
    auto track = read(text);
    EXPECT_FALSE(track.ok());
    if (track.ok()) return "";
    EXPECT_EQ(track.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(track.error().message, HasSubstr(path_.string()));
    return track.error().message;
  }
  std::filesystem::path path_;
};

Quat aboutX(double angle_rad) {
  return {std::sin(angle_rad / 2), 0, 0, std::cos(angle_rad / 2)};
}

PoseTrack trackOf(std::vector<double> t_s, std::vector<Pose> poses) {
  return {std::move(t_s), std::move(poses), {}, {}};
}

TEST_F(PoseTrackFile, columnsAreFoundByNameInAnyOrder) {
  auto track = read("qw,plunger,other,qz,qy,qx,pz_m,py_m,px_m,t_s\n1,0.5,9,0,0,0,3,2,1,7\n");
  ASSERT_TRUE(track.ok()) << track.error().message;
  EXPECT_EQ(track->t_s, std::vector<double>{7});
  EXPECT_EQ(track->X_WH.front(), (Pose{{1, 2, 3}, {0, 0, 0, 1}}));
  EXPECT_EQ(track->plunger, std::vector<double>{0.5});
}

TEST_F(PoseTrackFile, quaternionsNearUnitLengthAreNormalisedOthersRefused) {
  auto near = read(std::string(kHeader) + "\n0,0,0,0,0,0,0,1.0009\n");
  ASSERT_TRUE(near.ok());
  EXPECT_EQ(near->X_WH.front().q, (Quat{0, 0, 0, 1}));
  EXPECT_THAT(refusal(std::string(kHeader) + "\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,1.0011\n"),
              testing::AllOf(HasSubstr("line 3"), HasSubstr("1.0011"), HasSubstr("0.999 to 1.001")));
  EXPECT_THAT(refusal(std::string(kHeader) + "\n0,0,0,0,0,0,0,0\n"), HasSubstr("length 0"));
}

TEST_F(PoseTrackFile, badRowsAreRefusedByLine) {
  const std::string good = std::string(kHeader) + "\n1,0,0,0,0,0,0,1\n";
  EXPECT_THAT(refusal(good + "0.5,0,0,0,0,0,0,1\n"),
              testing::AllOf(HasSubstr("row 2 (line 3)"), HasSubstr("before 1 of the row before")));
  EXPECT_THAT(refusal(good + "\n1,0,0,0,0,0,0,1\n"),
              testing::AllOf(HasSubstr("row 2 (line 4)"), HasSubstr("the same as 1"), HasSubstr("digits")));
  EXPECT_THAT(refusal(good + "2,0,2000,0,0,0,0,1\n"), testing::AllOf(HasSubstr("line 3"), HasSubstr("py_m")));
  EXPECT_THAT(refusal(good + "2,0,1e300,0,0,0,0,1\n"), HasSubstr("py_m is 1e+300, allowed"));
  EXPECT_THAT(refusal(good + "2,0,0,0,0,0,0,1.00100001\n"), HasSubstr("length 1.00100001, allowed"));
  EXPECT_THAT(refusal(good + "2,0,nan,0,0,0,0,1\n"), HasSubstr("'nan'"));
  EXPECT_THAT(refusal(good + "2,0,0,0,0,0,0\n"), HasSubstr("7 cells"));
  EXPECT_THAT(refusal("t_s,px_m,py_m,pz_m,qx,qy,qz\n0,0,0,0,0,0,1\n"), HasSubstr("'qw' is missing"));
  EXPECT_THAT(refusal(std::string(kHeader) + "\n"), HasSubstr("no rows"));
  EXPECT_THAT(refusal(std::string(kHeader) + ",plunger\n0,0,0,0,0,0,0,1,1.5\n"), HasSubstr("plunger"));
}

TEST_F(PoseTrackFile, timesMayBeLateByThreePeriodsOrTenMilliseconds) {
  const auto rows = [](double period_s, double gap_s) {
    std::string text = std::string(kHeader) + "\n";
    double t_s = 0;
    for (int i = 0; i < 10; ++i) {
      text += std::to_string(t_s) + ",0,0,0,0,0,0,1\n";
      t_s += i == 5 ? gap_s : period_s;
    }
    return text;
  };
  for (const auto& [period_s, max_s] : {std::pair{0.001, 0.01}, {0.01, 0.03}, {1.0, 3.0}}) {
    EXPECT_TRUE(read(rows(period_s, max_s)).ok()) << period_s;
    EXPECT_THAT(refusal(rows(period_s, 1.1 * max_s)),
                testing::AllOf(HasSubstr("row 7 (line 8)"), HasSubstr("jumps from")))
        << period_s;
  }
}

TEST(ResamplePoses, rowsOnTheTicksAreTakenBitForBit) {
  // k/1000 from a decimal file differs from t0 + k/1000.0 by rounding: the result is still the row, not an
  // interpolation
  std::vector<double> t_s;
  std::vector<Pose> poses;
  for (int k = 0; k < 1000; ++k) {
    t_s.push_back(12.345 + k * 0.001);
    poses.push_back(
        {{std::sqrt(2.0) * k, 1.0 / (k + 1), -k * 1e-7}, normalized(Quat{0.1, 0.2, 0.3, 1.0 + k})});
  }
  EXPECT_EQ(resamplePoses(trackOf(t_s, poses), 1000), poses);
}

TEST(ResamplePoses, betweenIrregularRowsThePositionIsLinearInTime) {
  // x = 0.2·t at irregular times stays x = 0.2·t on the ticks
  const std::vector<double> t_s = {0.5, 0.50022, 0.5013, 0.5014, 0.50895, 0.5101};
  std::vector<Pose> poses;
  for (const double t : t_s) poses.push_back({{0.2 * (t - 0.5), 1, 0}, {}});
  const auto ticks = resamplePoses(trackOf(t_s, poses), 1000);
  ASSERT_EQ(ticks.size(), 11u);  // 0 … 10 ms; 10.1 ms is past the last full tick
  for (std::size_t k = 0; k < ticks.size(); ++k)
    EXPECT_NEAR(ticks[k].p.x, 0.2 * static_cast<double>(k) * 1e-3, 1e-15) << k;
}

TEST(ResamplePoses, orientationTakesTheShorterWayAtUnitLength) {
  const Quat b = aboutX(0.02);
  const Quat negative{-b.x, -b.y, -b.z, -b.w};  // the same rotation
  for (const Quat end : {b, negative}) {
    const auto ticks = resamplePoses(trackOf({0, 0.001}, {{{}, aboutX(0)}, {{}, end}}), 4000);
    ASSERT_EQ(ticks.size(), 5u);
    for (std::size_t k = 0; k < 4; ++k) {
      // nlerp of a small angle: the angle is linear in time up to a cubic term
      const Quat expected = aboutX(0.02 * static_cast<double>(k) / 4);
      EXPECT_NEAR(std::abs(dot(ticks[k].q, expected)), 1, 1e-12);
      EXPECT_NEAR(ticks[k].q.x, expected.x, 1e-6);
      EXPECT_NEAR(dot(ticks[k].q, ticks[k].q), 1, 1e-15);
    }
  }
}

TEST(ResamplePoses, oneRowIsOneTick) {
  EXPECT_EQ(resamplePoses(trackOf({3}, {{{1, 2, 3}, {}}}), 1000).size(), 1u);
}

TEST(ResamplePoses, plungerIsLinearBetweenRows) {
  PoseTrack track = trackOf({0, 0.002}, {{}, {}});
  track.plunger = {0.25, 0.75};
  EXPECT_EQ(resamplePlunger(track, 1000), (std::vector<double>{0.25, 0.5, 0.75}));
  EXPECT_TRUE(resamplePlunger(trackOf({0}, {{}}), 1000).empty());
}

}  // namespace
}  // namespace needlelab
