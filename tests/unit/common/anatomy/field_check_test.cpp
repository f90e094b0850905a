/// What is wrong in a field is named: path, value, what would be right.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <ostream>
#include <string>

#include "tests/support/anatomy/fields.h"

namespace needlelab::test {
namespace {

struct Fault {
  const char* name;
  std::function<void(FieldSpec&)> plant;
  const char* message;
};
std::ostream& operator<<(std::ostream& out, const Fault& fault) {
  return out << fault.name;
}

CapsulePart& firstBone(FieldSpec& spec) {
  return std::get<CapsulePart>(spec.groups[1].parts[0].shape);
}
EllipsoidPart& carpus(FieldSpec& spec) {
  return std::get<EllipsoidPart>(spec.groups[1].parts[2].shape);
}
TubePart& artery(FieldSpec& spec) {
  return std::get<TubePart>(spec.groups[4].parts[0].shape);
}

const Fault kFaults[] = {
    {"noGroup", [](FieldSpec& spec) { spec.groups.clear(); }, "groups: has 0 entries; 1 to 32 are allowed"},
    {"noPart", [](FieldSpec& spec) { spec.groups[2].parts.clear(); },
     "groups[2].parts: a group needs at least one part"},
    {"twoGroupsOfOneId", [](FieldSpec& spec) { spec.groups[2].id = "bone"; },
     "groups[2].id: 'bone' is used twice"},
    {"noId", [](FieldSpec& spec) { spec.structures[3].id.clear(); }, "structures[3].id: is empty"},
    {"tooManyParts", [](FieldSpec& spec) { spec.groups[1].parts.resize(257, spec.groups[1].parts[0]); },
     "groups: has 274 parts; 1 to 256 are allowed"},
    {"radiusOfNothing", [](FieldSpec& spec) { firstBone(spec).radius_a_m = 0; },
     "groups[1].parts[0].capsule.radius_a_m: 0 is out of range (0, 1]"},
    {"notANumber", [](FieldSpec& spec) { firstBone(spec).a_m.y = std::numeric_limits<double>::quiet_NaN(); },
     "groups[1].parts[0].capsule.a_m.y: nan is out of range [-1000, 1000]"},
    {"aCone",
     [](FieldSpec& spec) { firstBone(spec).radius_b_m = 0.007, firstBone(spec).b_m = firstBone(spec).a_m; },
     "groups[1].parts[0].capsule.radius_b_m: the radius changes from 0.006 to 0.007 m over 0 m: at most half the length is "
     "allowed"},
    {"aNeedleOfAnEllipsoid", [](FieldSpec& spec) { carpus(spec).radii_m = mm(50, 10, 2); },
     "groups[1].parts[2].ellipsoid.radii_m: the greatest, 0.05, is more than 20 times the least, 0.002: use a capsule"},
    {"parallelAxes", [](FieldSpec& spec) { carpus(spec).y_axis = carpus(spec).x_axis * -2.0; },
     "groups[1].parts[2].ellipsoid.y_axis: is parallel to x_axis"},
    {"aNormalOfNothing",
     [](FieldSpec& spec) { std::get<HalfSpacePart>(spec.groups[5].parts[0].shape).normal = {}; },
     "groups[5].parts[0].half_space.normal: has no direction: its length is 0"},
    {"aTubeOfOnePoint", [](FieldSpec& spec) { artery(spec).points.resize(1); },
     "groups[4].parts[0].tube.points: has 1 entries; 2 to 64 are allowed"},
    {"aPointTwice", [](FieldSpec& spec) { artery(spec).points[2] = artery(spec).points[1]; },
     "groups[4].parts[0].tube.points[2].at_m: is the same point as the one before"},
    {"aWideBlend", [](FieldSpec& spec) { spec.groups[0].parts[1].blend_m = 0.2; },
     "groups[0].parts[1].blend_m: 0.2 is out of range [0, 0.1]"},
    {"anUnknownSkin", [](FieldSpec& spec) { spec.skin = "hide"; },
     "skin: 'hide' is not one of: skin, bone, tendons, nerve, artery, distal"},
    {"anUnknownGroup", [](FieldSpec& spec) { spec.rules[2].range.group = "nreve"; },
     "rules[2].group: 'nreve' is not one of: skin, bone, tendons, nerve, artery, distal"},
    {"anUnknownClip", [](FieldSpec& spec) { spec.rules[4].clips[0].group = "proximal"; },
     "rules[4].clips[0].group: 'proximal' is not one of: skin, bone, tendons, nerve, artery, distal"},
    {"anUnknownStructure", [](FieldSpec& spec) { spec.rules[7].structure = "facsia"; },
     "rules[7].structure: 'facsia' is not one of: dermis, fat, fascia, muscle, tendon, sheath, nerve, artery, bone"},
    {"aRangeOfNothing", [](FieldSpec& spec) { spec.rules[5].range.from_m = spec.rules[5].range.to_m = -0.5; },
     "rules[5].to_m: -0.5 is not greater than from_m, -0.5"},
    {"aBoundOfMetres", [](FieldSpec& spec) { spec.rules[6].range.from_m = -3.6; },
     "rules[6].from_m: -3.6 is out of range [-1, 1]"},
    {"manyClips", [](FieldSpec& spec) { spec.rules[4].clips.resize(4, spec.rules[4].clips[0]); },
     "rules[4].clips: has 4 entries; 0 to 3 are allowed"},
};

class FieldCheck : public testing::TestWithParam<Fault> {};
TEST_P(FieldCheck, namesTheFault) {
  FieldSpec spec = forearm();
  ASSERT_TRUE(checkField(spec).ok());
  GetParam().plant(spec);
  const Status status = checkField(spec);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(status.error().message, GetParam().message);
  EXPECT_FALSE(Field::make(spec).ok());
}
INSTANTIATE_TEST_SUITE_P(Checks, FieldCheck, testing::ValuesIn(kFaults),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace needlelab::test
