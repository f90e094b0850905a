/// A volume's drawing for the console: its runs against the field at each point.
#include "db/service/requests/lessons/profile_section.h"

#include <gtest/gtest.h>

#include "common/anatomy/field.h"
#include "common/profile/profile.h"
#include "common/profile/volume.h"

namespace needlelab::test {
namespace {

Vec3 vectorAt(const google::protobuf::RepeatedField<double>& numbers) {
  return {numbers.Get(0), numbers.Get(1), numbers.Get(2)};
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
  const Vec3 out = cross(vectorAt(section.across()), vectorAt(section.upward()));
  const double off_m = dot(Vec3{center.x(), center.y(), center.z()} - vectorAt(section.corner_m()), out);
  EXPECT_NEAR(off_m, 0, 1e-9);
}

}  // namespace
}  // namespace needlelab::test
