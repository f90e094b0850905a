/// A volume's drawing for the console: its runs against the field at each point, its plane against a
/// session's needle.
#include "db/service/requests/lessons/profile_section.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "common/anatomy/field.h"
#include "common/profile/profile.h"
#include "common/profile/volume.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab::test {
namespace {

Vec3 vectorAt(const google::protobuf::RepeatedField<double>& numbers) {
  return {numbers.Get(0), numbers.Get(1), numbers.Get(2)};
}

Vec3 outOf(const pb::ProfileSection& section) {
  return cross(vectorAt(section.across()), vectorAt(section.upward()));
}
double offPlane_m(const pb::ProfileSection& section, Vec3 p_m) {
  return dot(p_m - vectorAt(section.corner_m()), outOf(section));
}

/// The skin at x, y of L, by bisection along z.
Vec3 skinAt(const Field& field, double x, double y) {
  Vec3 outside{x, y, 0.03}, inside{x, y, -0.01};
  EXPECT_EQ(field.at(outside).structure, kOutside);
  EXPECT_NE(field.at(inside).structure, kOutside);
  for (int i = 0; i < 50; ++i) {
    const Vec3 middle = 0.5 * (outside + inside);
    (field.at(middle).structure == kOutside ? outside : inside) = middle;
  }
  return inside;
}
/// The skin's normal there, from its height around.
Vec3 normalAt(const Field& field, double x, double y) {
  constexpr double kStep_m = 5e-4;
  const double along_x = skinAt(field, x + kStep_m, y).z - skinAt(field, x - kStep_m, y).z,
               along_y = skinAt(field, x, y + kStep_m).z - skinAt(field, x, y - kStep_m).z;
  return normalized(Vec3{-along_x, -along_y, 2 * kStep_m});
}

TEST(ProfileSection, hasTheFieldsStructureAtEachPointOfItsRuns) {
  const auto profile = loadProfile(NEEDLELAB_VOLUME);
  ASSERT_TRUE(profile) << profile.error().message;
  const auto field = fieldOf(profile->volume());
  ASSERT_TRUE(field);
  pb::ProfileSection section;
  ASSERT_TRUE(handlers::addSection(*profile, section));
  ASSERT_EQ(section.structures_size(), profile->volume().structures_size());
  const Vec3 corner_m = vectorAt(section.corner_m()), across = vectorAt(section.across()),
             upward = vectorAt(section.upward());
  EXPECT_NEAR(dot(across, upward), 0, 1e-12);
  std::uint32_t x = 0, y = 0;
  for (int i = 0; i + 1 < section.runs_size(); i += 2) {
    const StructureIndex wanted =
        section.runs(i) == 0 ? kOutside : static_cast<StructureIndex>(section.runs(i) - 1);
    for (std::uint32_t k = 0; k < section.runs(i + 1); ++k, ++x) {
      const Vec3 p_m =
          corner_m + across * ((x + 0.5) * section.point_m()) + upward * ((y + 0.5) * section.point_m());
      // a rounding of the frame may move a boundary by less than a nanometre
      if (field->at(p_m).clearance_m > 1e-9) {
        ASSERT_EQ(field->at(p_m).structure, wanted) << x << ", " << y;
      }
    }
    ASSERT_LE(x, section.columns());
    if (x == section.columns()) {
      x = 0;
      ++y;
    }
  }
  EXPECT_EQ(y, section.rows());
}

TEST(ProfileSection, holdsTheTargetInItsPlane) {
  const auto profile = loadProfile(NEEDLELAB_VOLUME);
  ASSERT_TRUE(profile);
  pb::ProfileSection section;
  ASSERT_TRUE(handlers::addSection(*profile, section));
  const auto& center = profile->targets(0).center_m();
  EXPECT_NEAR(offPlane_m(section, {center.x(), center.y(), center.z()}), 0, 1e-9);
}

TEST(ProfileSection, ofANeedleAlongTheNormalHoldsTheTarget) {
  const auto profile = loadProfile(NEEDLELAB_VOLUME);
  ASSERT_TRUE(profile);
  const auto field = fieldOf(profile->volume());
  ASSERT_TRUE(field);
  const Vec3 skin_m = skinAt(*field, 0.012, 0.004), normal = normalAt(*field, 0.012, 0.004);
  pb::ProfileSection section;
  ASSERT_TRUE(
      handlers::addSection(*profile, section, handlers::NeedleEntry{skin_m - 1e-4 * normal, -normal}));
  const auto& center = profile->targets(0).center_m();
  EXPECT_NEAR(offPlane_m(section, {center.x(), center.y(), center.z()}), 0, 1e-9);
  EXPECT_NEAR(offPlane_m(section, skin_m), 0, 1e-5);
}

class SessionSection : public ServiceTest {
 protected:
  void SetUp() override {
    addStation();
    const auto profile = loadProfile(NEEDLELAB_VOLUME);
    ASSERT_OK(profile);
    profile_ = *profile;
  }
  static pb::Request sectionOf(const Uuid& id) {
    pb::Request request;
    request.mutable_get_section()->set_session_id(bytesOfId(id));
    return request;
  }
  /// A session at the body where X_WL puts it. `tips`: poses X_LT, each for 20 samples, and the layer there.
  Uuid sessionOf(const Pose& X_WL, const std::vector<std::pair<Pose, std::int8_t>>& tips) {
    const Uuid id = makeUuidV7();
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto d = describe(id);
      d.set_profile_json(profileJson(profile_));
      for (const double number : {X_WL.p.x, X_WL.p.y, X_WL.p.z, X_WL.q.x, X_WL.q.y, X_WL.q.z, X_WL.q.w})
        d.add_placement(number);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      for (std::uint64_t seq = 0; seq < tips.size(); ++seq) {
        auto samples = someSamples(seq * 20, 20);
        const auto [p, q] = X_WL * tips[seq].first;
        for (GestureSample& s : samples) {
          std::ranges::copy(std::array{p.x, p.y, p.z}, s.p_WT_m);
          std::ranges::copy(std::array{q.x, q.y, q.z, q.w}, s.q_WT);
          s.layer = tips[seq].second;
        }
        auto appended = SessionStore(c).append(id, seq, encodeChunk(Resolution{}, samples));
        if (!appended) return appended.error();
      }
      return {};
    }));
    return id;
  }
  /// X_LT of a needle with its tip at `tip_m`, from hub to tip along `axis`.
  static Pose needleAt(Vec3 tip_m, Vec3 axis) {
    const Vec3 turn = cross({0, 0, 1}, axis);
    return {tip_m, normalized(Quat{turn.x, turn.y, turn.z, 1 + axis.z})};
  }
  pb::Profile profile_;
};

TEST_F(SessionSection, holdsTheSkinsNormalAndTheNeedleOfTheFirstInsertion) {
  const auto field = fieldOf(profile_.volume());
  ASSERT_TRUE(field);
  const Pose X_WL{{0.1, -0.2, 0.3}, normalized(Quat{0.1, -0.3, 0.2, 0.9})};
  const Vec3 skin_m = skinAt(*field, 0.008, 0.004), normal = normalAt(*field, 0.008, 0.004);
  // 25 degrees off the normal: neither towards the target nor along y
  const Vec3 side = normalized(cross(normal, {0.3, 1, 0}));
  const Vec3 axis = side * std::sin(0.436) - normal * std::cos(0.436);
  const Vec3 tip_m = skin_m + 2e-4 * axis;
  const Uuid id = sessionOf(X_WL, {{needleAt(skin_m - 0.01 * axis, axis), -1},
                                   {needleAt(tip_m, axis), 0},
                                   {needleAt(skin_m - 0.01 * axis, axis), -1},
                                   {needleAt(skin_m - 1e-4 * normal, {0, 0, -1}), 0}});
  const pb::ProfileSection section = get(instructor, sectionOf(id)).section();
  // samples are stored to 1e-6 m and 2^-15
  EXPECT_NEAR(offPlane_m(section, tip_m), 0, 5e-6);
  EXPECT_NEAR(offPlane_m(section, tip_m + 0.05 * axis), 0, 5e-5);
  EXPECT_GT(dot(vectorAt(section.upward()), normal), 0.9995);
  EXPECT_GT(dot(vectorAt(section.across()), axis), 0.3) << "the needle goes to the right";
  const Vec3 middle_m = vectorAt(section.corner_m()) +
                        vectorAt(section.across()) * (0.5 * section.columns() * section.point_m());
  EXPECT_NEAR(dot(skin_m - middle_m, vectorAt(section.across())), 0, 2e-4) << "the entry is in the middle";
}

TEST_F(SessionSection, withoutAnInsertionIsThatOfTheEditor) {
  pb::ProfileSection wanted;
  ASSERT_OK(handlers::addSection(profile_, wanted));
  const Pose above = needleAt({0, 0, 0.02}, {0, 0, -1});
  for (const Uuid& id : {sessionOf({}, {}), sessionOf({}, {{above, -1}, {above, -1}})}) {
    const pb::ProfileSection section = get(instructor, sectionOf(id)).section();
    EXPECT_EQ(section.SerializeAsString(), wanted.SerializeAsString());
  }
}

TEST_F(SessionSection, isForThoseWhoSeeTheSessionAndOfABody) {
  addPerson("anna", pb::TRAINEE);
  const Uuid own = sessionOf({}, {});
  EXPECT_GT(get(trainee, sectionOf(own)).section().runs_size(), 0);
  EXPECT_EQ(refusal({"ben", pb::TRAINEE}, sectionOf(own)), ErrorCode::kNotFound);
  EXPECT_EQ(refusal(instructor, sectionOf(makeUuidV7())), ErrorCode::kNotFound);
  pb::Request knee;
  knee.mutable_get_profile()->set_id("knee-adult");
  const Outcome layers =
      ask(instructor, sectionOf(addSession("anna", 1, 20, get(instructor, knee).profile().json())));
  ASSERT_TRUE(layers.error.has_value());
  EXPECT_EQ(layers.error->code, ErrorCode::kInvalidInput);
  EXPECT_THAT(layers.error->message, testing::HasSubstr("only a body can be cut"));
}

}  // namespace
}  // namespace needlelab::test
