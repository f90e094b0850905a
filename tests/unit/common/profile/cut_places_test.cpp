// The memory of the cut knows places: who goes through a structure twice meets both of its walls whole, and
// on the way back in finds both open.
#include <gtest/gtest.h>

#include "tests/unit/common/profile/patients_in_body.h"

namespace needlelab::patients_in_body::cut_places {
namespace {

constexpr double kStart_m = 0.006, kSpeed_mps = 0.02;

struct Membrane {
  double at_m = 0, stretch_m = 0, force_N = 0;
};
struct Way {
  Line line;
  double end_m = 0;
  std::vector<Membrane> membranes;
  bool goes_twice = false;  ///< through the membranes of one structure
};

// to 1 mm before bone, the far skin or the needle's end
Way wayAlong(const Patient& patient, const Line& line) {
  Way way{.line = line};
  const double most_m = 0.95 * patient.scene.needle_length_m;
  way.end_m = most_m;
  const Stretches layers = withoutSlivers(sampled(patient, line, 1e-5, most_m), patient.sliver_m);
  for (const Stretch& one : layers)
    if (one.structure == kOutside || patient.isBone(one.structure)) {
      way.end_m = one.from_m - 1e-3;
      break;
    }
  StructureMask seen = 0;
  for (const Stretch& one : layers) {
    const double stretch_m = patient.stretchOf(one.structure);
    if (stretch_m == 0 || one.from_m + stretch_m + 1e-3 > way.end_m) continue;
    way.membranes.push_back({one.from_m, stretch_m, patient.scene.layers[one.structure].membrane->force_N});
    way.goes_twice |= (seen & maskOf(one.structure)) != 0;
    seen |= maskOf(one.structure);
  }
  return way;
}

struct Passage {
  std::vector<double> peaks_N;
  long ruptures = 0;
  double most_N = 0;
};

Passage passage(Needle& needle, const Way& way) {
  Passage found;
  found.peaks_N.assign(way.membranes.size(), 0);
  needle.to(way.line.at(way.end_m), kSpeed_mps, [&](const StepReport& report) {
    const double s_m = dot(needle.tip() - way.line.origin_m, way.line.axis);
    if (report.layer < 0) return;
    found.ruptures += (report.flags & kFlagRupture) != 0;
    found.most_N = std::max(found.most_N, -report.puncture_N);
    for (std::size_t i = 0; i < way.membranes.size(); ++i)
      if (s_m > way.membranes[i].at_m - 0.3e-3 &&
          s_m < way.membranes[i].at_m + way.membranes[i].stretch_m + 1e-3)
        found.peaks_N[i] = std::max(found.peaks_N[i], -report.puncture_N);
  });
  return found;
}

TEST(CutPlaces, eachWallIsWholeForTheFirstPassageAndOpenForTheSecond) {
  const std::size_t wanted = test::longForm() ? 20 : 2;
  long twice = 0;
  for (const Patient& patient : patients()) {
    SceneSpec scene = patient.scene;
    scene.effects &= ~bitOf(Effect::kCutMemory);
    const auto without = std::make_unique<SceneModel>(*compile(scene, kRate_hz));
    scene.effects |= bitOf(Effect::kCutMemory);
    scene.stage_numbers[stageOf(Effect::kCutMemory)] = {0.23, 1e-3};
    const auto with = std::make_unique<SceneModel>(*compile(scene, kRate_hz));

    std::vector<Way> ways{wayAlong(patient, {{}, patient.planned})};
    test::Random random(611);
    for (int tries = 0; tries < (test::longForm() ? 3000 : 150) && ways.size() < 1 + wanted; ++tries)
      if (const auto line = randomLine(patient, random, 0.02, 0.6))
        if (Way way = wayAlong(patient, *line); way.goes_twice) ways.push_back(std::move(way));

    Share walls, open;
    double again_N = 0;
    for (const Way& way : ways) {
      twice += way.goes_twice;
      Needle whole(*without), needle(*with);
      for (Needle* one : {&whole, &needle}) one->rest(way.line.at(-kStart_m), way.line.axis);
      const Passage right = passage(whole, way), first = passage(needle, way);
      for (std::size_t i = 0; i < way.membranes.size(); ++i) {
        walls.count(std::fabs(first.peaks_N[i] - right.peaks_N[i]) < 1e-3 &&
                    first.peaks_N[i] > 0.9 * way.membranes[i].force_N);
        EXPECT_NEAR(first.peaks_N[i], right.peaks_N[i], 1e-3)
            << patient.name << ": first passage, the membrane at " << 1e3 * way.membranes[i].at_m
            << " mm is not as without CUT_MEMORY";
      }
      EXPECT_EQ(first.ruptures, right.ruptures) << patient.name;
      needle.to(way.line.at(-kStart_m), 0.05);
      needle.rest(way.line.at(-kStart_m), way.line.axis, 100);
      const Passage second = passage(needle, way);
      open.count(second.ruptures == 0 && second.most_N < 1e-6);
      again_N = std::max(again_N, second.most_N);
      EXPECT_EQ(second.ruptures, 0) << patient.name << ": the second passage";
      EXPECT_LT(second.most_N, 1e-6) << patient.name << ": the second passage";
    }
    std::printf(
        "cut memory: %-16s %zu lines, first passage: %ld of %ld walls whole; second: %ld of %ld lines open, up to %.2f N\n",
        patient.name.c_str(), ways.size(), walls.right, walls.all, open.right, open.all, again_N);
  }
  EXPECT_GE(twice, 8) << "lines that go through one structure's membranes twice";
}

}  // namespace
}  // namespace needlelab::patients_in_body::cut_places
