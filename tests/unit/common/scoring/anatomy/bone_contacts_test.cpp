#include "common/scoring/anatomy/bone_contacts.h"

#include <gtest/gtest.h>

#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

BoneContacts bonesOf(const pb::Profile& profile, const Pose& X_WL = {}) {
  return {profile, anatomyOf(profile, X_WL)};
}

void addBoneHazard(pb::Profile& profile, Vec3 center, double radius_m) {
  addBallHazard(profile, "bone " + std::to_string(profile.hazards_size()), center, radius_m);
  profile.mutable_hazards(profile.hazards_size() - 1)->set_kind(pb::Hazard::BONE);
}

/// Times at which a contact begins, in ms, for a tip that moves up and down below (0, 0) of halfSpace(), one
/// moment per ms.
std::vector<int> contactsOf(BoneContacts bones, int until_ms, const std::function<double(int)>& depth_m) {
  std::vector<int> found;
  for (int ms = 0; ms < until_ms; ++ms) {
    GestureSample sample;
    setDepth(sample, depth_m(ms));
    if (bones.add(1e-3 * ms, sample.layer, {0, 0, sample.p_WT_m[2]})) found.push_back(ms);
  }
  return found;
}

TEST(BoneContacts, aContactBeginsWhereTheTipEntersALayerOfBone) {
  // 10 mm/s from the skin on: the bone begins 20 mm deep
  EXPECT_EQ(contactsOf(bonesOf(halfSpace()), 2900, [](int ms) { return 1e-5 * (ms + 0.5); }),
            std::vector<int>{2000});
  pb::Profile soft = halfSpace();
  soft.mutable_layers(2)->set_tissue(pb::Layer::CARTILAGE);
  EXPECT_TRUE(contactsOf(bonesOf(soft), 2900, [](int ms) { return 1e-5 * (ms + 0.5); }).empty());
  EXPECT_TRUE(contactsOf({}, 2900, [](int ms) { return 1e-5 * (ms + 0.5); }).empty());
}

TEST(BoneContacts, tremorAtTheSurfaceIsOneContactAndAnotherTouchIsAnother) {
  // 10 Hz about the bone's surface for 3 s: out of the bone for 50 ms each time
  EXPECT_EQ(contactsOf(bonesOf(halfSpace()), 3000,
                       [](int ms) { return 0.02 + 1e-4 * std::sin(2 * 3.14159265358979 * ms / 100 + 0.1); })
                .size(),
            1u);
  // away from 500 ms on for `away` ms
  const auto touchedAgainAfter = [](int away) {
    return contactsOf(bonesOf(halfSpace()), 1500,
                      [away](int ms) { return ms < 500 || ms >= 500 + away ? 0.021 : 0.015; });
  };
  EXPECT_EQ(touchedAgainAfter(199), std::vector<int>{0});
  EXPECT_EQ(touchedAgainAfter(200), (std::vector<int>{0, 700}));
  // out of the body and in again
  EXPECT_EQ(
      contactsOf(bonesOf(halfSpace()), 1500, [](int ms) { return ms < 500 || ms >= 1000 ? 0.021 : -0.005; }),
      (std::vector<int>{0, 1000}));
}

TEST(BoneContacts, nothingIsAssumedAboutTheTimeBetweenTwoMoments) {
  BoneContacts bones = bonesOf(halfSpace());
  EXPECT_TRUE(bones.add(1, 2, {0, 0, -0.021}));
  EXPECT_FALSE(bones.add(50, 2, {0, 0, -0.021})) << "no one saw it leave";
  bones.restart();
  EXPECT_TRUE(bones.add(0, 2, {0, 0, -0.021})) << "another gesture";
}

TEST(BoneContacts, aHazardOfBoneIsEnteredByTheTip) {
  pb::Profile profile = halfSpace();
  addBoneHazard(profile, {0, 0, -0.015}, 0.002);
  addBallHazard(profile, "nerve", {0, 0, -0.005}, 0.002);
  // 13 to 17 mm deep
  EXPECT_EQ(contactsOf(bonesOf(profile), 1800, [](int ms) { return 1e-5 * (ms + 0.5); }),
            std::vector<int>{1300});
  const BoneContacts bones = bonesOf(profile);
  EXPECT_FALSE(bones.isIn(0, {0, 0, -0.005})) << "a nerve is not a bone";
  EXPECT_FALSE(bones.isIn(1, {0.0021, 0, -0.015})) << "beside it";
  EXPECT_FALSE(bones.isIn(-1, {0, 0, -0.015})) << "the engine has the tip outside";
  // moves with its limb
  const BoneContacts placed = bonesOf(profile, Pose{{0.3, 0.1, 0.5}, {}});
  EXPECT_TRUE(placed.isIn(1, {0.3, 0.1, 0.485}));
  EXPECT_FALSE(placed.isIn(1, {0, 0, -0.015}));
}

TEST(BoneContacts, aHeadThatLiesInALayerOfBoneIsOneBone) {
  pb::Profile profile = halfSpace();
  addBoneHazard(profile, {0, 0, -0.022}, 0.004);  // its top lies 18 mm deep, 2 mm above the layer
  EXPECT_EQ(contactsOf(bonesOf(profile), 2900, [](int ms) { return 1e-5 * (ms + 0.5); }),
            std::vector<int>{1800});
}

}  // namespace
}  // namespace needlelab
