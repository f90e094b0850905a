// Past a bone's edge the tissue goes on: lines that graze a bone, and needles that are redirected from one,
// feel the layers that the field has beyond.
#include <gtest/gtest.h>

#include <numbers>

#include "tests/unit/common/profile/patients_in_body.h"

namespace needlelab::patients_in_body::past_bone {
namespace {

constexpr double kStart_m = 0.007, kBeyond_m = 1e-3;

struct Chord {
  Line line;
  double bone_m = 0, beyond_m = 0;  ///< where bone begins and ends
  double end_m = 0;                 ///< 1 mm before the next bone, the far skin or the needle's end
  Stretches layers;
};

// where the next bone begins, or the line comes out, or the needle ends
double endOfTissue(const Patient& patient, const Stretches& stretches, double from_m) {
  for (const Stretch& one : stretches)
    if (one.from_m >= from_m && (one.structure == kOutside || patient.isBone(one.structure)))
      return one.from_m - kBeyond_m;
  return 0.95 * patient.scene.needle_length_m;
}

// whether a parallel line 1.2 mm aside misses the bone that a line meets
bool grazes(const Patient& patient, const Chord& chord) {
  const Vec3 axis = chord.line.axis;
  const Vec3 side = normalized(cross(axis, {0.3, 0.5, 0.81})), other = cross(axis, side);
  for (int i = 0; i < 24; ++i) {
    const double around = i * std::numbers::pi / 12;
    const Line aside{chord.line.origin_m + (side * std::cos(around) + other * std::sin(around)) * 1.2e-3,
                     axis};
    bool misses = true;
    for (double s_m = chord.bone_m - 2e-3; s_m < chord.beyond_m + 2e-3 && misses; s_m += 5e-5)
      misses = !patient.isBone(patient.body->structureAt(aside.at(s_m)));
    if (misses) return true;
  }
  return false;
}

// bone for 0.5 to 5 mm along the line, at its edge, then tissue for at least 4 mm
std::optional<Chord> grazing(const Patient& patient, const Line& line) {
  const double most_m = 0.95 * patient.scene.needle_length_m;
  const Stretches rough = sampled(patient, line, 1e-5, most_m, 5e-5);
  Chord chord{.line = line};
  for (const Stretch& one : rough) {
    const bool is_bone = patient.isBone(one.structure);
    if (!is_bone && (one.structure == kOutside || chord.beyond_m > 0)) break;
    if (!is_bone) continue;
    if (chord.beyond_m == 0) chord.bone_m = one.from_m;
    chord.beyond_m = one.to_m;
  }
  const double bone_m = chord.beyond_m - chord.bone_m;
  if (bone_m < 0.5e-3 || bone_m > 5e-3 || chord.bone_m < 2e-3) return std::nullopt;
  chord.end_m = endOfTissue(patient, rough, chord.beyond_m);
  if (chord.end_m < chord.beyond_m + 4e-3) return std::nullopt;
  if (!grazes(patient, chord)) return std::nullopt;
  chord.layers = withoutSlivers(sampled(patient, line, 1e-5, most_m), patient.sliver_m);
  return chord;
}

std::vector<Chord> chordsOf(const Patient& patient, std::size_t wanted) {
  test::Random random(601);
  std::vector<Chord> chords;
  for (int tries = 0; tries < 60'000 && chords.size() < wanted; ++tries)
    if (const auto line = randomLine(patient, random, 0.035, 0.8))
      if (auto chord = grazing(patient, *line)) chords.push_back(std::move(*chord));
  return chords;
}

// whether the layer of this tick is the field's, at the tip on the needle's own line. Ticks on a bone that
// its own line meets are not judged
// (`at_tip`: or the field's at the tip itself; printed, to tell a boundary that is met a little early from a
// wrong layer)
void judge(const Patient& patient, const Needle& needle, Share& share, Share* at_tip = nullptr) {
  const StructureIndex there = felt(patient, needle.ownLine(), needle.onOwnLine());
  if (there == kOutside || patient.isBone(there)) return;
  const int layer = needle.report().layer;
  share.count(layer == there);
  if (at_tip != nullptr) at_tip->count(layer == there || layer == patient.body->structureAt(needle.tip()));
}

// the membranes between two places of a line, of which each must be felt
class Membranes {
 public:
  Membranes(const Patient& patient, const Stretches& layers, double from_m, double to_m) {
    for (const Stretch& one : layers)
      if (const double stretch_m = patient.stretchOf(one.structure);
          stretch_m > 0 && one.from_m > from_m && one.from_m + stretch_m + 1e-3 < to_m)
        all_.push_back({one.from_m, stretch_m, patient.scene.layers[one.structure].membrane->force_N});
  }
  void tick(double s_m, const StepReport& report) {
    for (One& one : all_)
      if (s_m > one.at_m - 0.3e-3 && s_m < one.at_m + one.stretch_m + 1e-3)
        one.is_felt |= (report.flags & kFlagRupture) != 0 || report.puncture_N < -0.9 * one.force_N;
  }
  void count(Share& share) const {
    for (const One& one : all_) share.count(one.is_felt);
  }

 private:
  struct One {
    double at_m, stretch_m, force_N;
    bool is_felt = false;
  };
  std::vector<One> all_;
};

TEST(PastBone, aLineThatGrazesABoneFeelsAllLayersBeyond) {
  const std::size_t wanted = test::longForm() ? 200 : 5;
  for (const Patient& patient : patients()) {
    const auto chords = chordsOf(patient, wanted);
    EXPECT_GE(chords.size(), test::longForm() ? 40 : wanted)
        << patient.name << ": too few lines graze a bone";
    Share ticks, membranes, lines;
    for (std::size_t i = 0; i < chords.size(); ++i) {
      const Chord& chord = chords[i];
      const double speed_mps = test::longForm() && i % 2 == 1 ? 0.01 : 0.02;
      Needle needle(patient);
      Membranes beyond(patient, chord.layers, chord.beyond_m + kBeyond_m, chord.end_m);
      Share here;
      needle.rest(chord.line.at(-kStart_m), chord.line.axis);
      needle.to(chord.line.at(chord.end_m), speed_mps, [&](const StepReport& report) {
        const double s_m = dot(needle.tip() - chord.line.origin_m, chord.line.axis);
        if (s_m < chord.beyond_m + kBeyond_m) return;
        judge(patient, needle, here);
        beyond.tick(s_m, report);
      });
      // one that meets a flat face within the friction's cone, not a rounded edge, is held there
      const bool is_held = needle.state().bone.touching;
      lines.count(!is_held && here.percent() >= 90);
      if (is_held) continue;
      beyond.count(membranes);
      ticks.right += here.right, ticks.all += here.all;
    }
    std::printf(
        "past bone, in one go: %-16s %zu chords, right in %.1f %% of %ld ticks, %ld of %ld lines right, %ld of %ld membranes\n",
        patient.name.c_str(), chords.size(), ticks.percent(), ticks.all, lines.right, lines.all,
        membranes.right, membranes.all);
    EXPECT_GE(ticks.percent(), 98) << patient.name << ": beyond the bone the layer is not the field's";
    EXPECT_GE(lines.percent(), 95) << patient.name << ": held, or with less than 90 % of the ticks right";
    EXPECT_EQ(membranes.right, membranes.all) << patient.name << ": membranes beyond the bone are not felt";
  }
}

// the bone turns the tip aside, or holds it: only ticks past the bone count
TEST(PastBone, aHandThatIsTurnedAsideByABoneFeelsAllLayersBeyond) {
  const std::size_t wanted = test::longForm() ? 40 : 2;
  long passed = 0;
  for (const Patient& patient : patients()) {
    Share ticks;
    int through = 0;
    for (const Chord& chord : chordsOf(patient, wanted)) {
      Needle needle(patient);
      needle.rest(chord.line.at(-kStart_m), chord.line.axis);
      Hand hand{.place_m = needle.tip(), .speed_mps = {}};
      const long before = ticks.all;
      const double most_m = chord.end_m + 0.02;  // the tissue holds it back
      for (int k = 0; - kStart_m + 2e-5 * k < most_m; ++k) {
        hand.tick(chord.line.at(-kStart_m + 2e-5 * k), needle.report().wrench_W.force_N);
        needle.at(hand.place_m, chord.line.axis);
        const double s_m = dot(needle.tip() - chord.line.origin_m, chord.line.axis);
        if (s_m > chord.end_m) break;
        if (s_m > chord.beyond_m + kBeyond_m && patient.fromBone(needle.tip()) > kBeyond_m &&
            !needle.state().bone.touching)
          judge(patient, needle, ticks);
      }
      through += ticks.all > before;
    }
    passed += through;
    std::printf("past bone, with a hand: %-16s %d needles passed, right in %.1f %% of %ld ticks\n",
                patient.name.c_str(), through, ticks.percent(), ticks.all);
    EXPECT_GE(ticks.percent(), 98) << patient.name << ": beyond the bone the layer is not the field's";
  }
  EXPECT_GE(passed, static_cast<long>(10 * wanted)) << "needles come past a bone";
}

// the membranes that a needle meets on its own line, which may turn: where the field's structure there
// becomes one with a membrane, it must be felt
class MembranesMet {
 public:
  explicit MembranesMet(const Patient& patient) : patient_(patient) {}
  void tick(const Needle& needle) {
    const double s_m = needle.onOwnLine();
    const StructureIndex here = felt(patient_, needle.ownLine(), s_m);
    const double stretch_m = patient_.stretchOf(here);
    if (before_ != kOutside && here != before_ && !patient_.isBone(before_) && stretch_m > 0)
      all_.push_back({s_m, stretch_m, patient_.scene.layers[here].membrane->force_N});
    before_ = here;
    for (One& one : all_) {
      if (s_m < one.at_m + one.stretch_m + 1e-3)
        one.is_felt |=
            (needle.report().flags & kFlagRupture) != 0 || needle.report().puncture_N < -0.9 * one.force_N;
      else
        one.is_passed = true;
    }
  }
  void count(Share& share) const {
    for (const One& one : all_)
      if (one.is_passed) share.count(one.is_felt);
  }

 private:
  struct One {
    double at_m, stretch_m, force_N;
    bool is_felt = false, is_passed = false;
  };
  const Patient& patient_;
  StructureIndex before_ = kOutside;
  std::vector<One> all_;
};

struct Redirection {
  Line first, second;
  double bone_m = 0, back_m = 0, end_m = 0;
};

// onto bone, back to 3 to 15 mm, 8 degrees about the hole, and on beside the bone for at least 5 mm
std::vector<Redirection> redirectionsOf(const Patient& patient, std::size_t wanted) {
  test::Random random(602);
  std::vector<Redirection> found;
  for (int tries = 0; tries < 40'000 && found.size() < wanted; ++tries) {
    const auto line = randomLine(patient, random, 0.035, 0.6);
    if (!line) continue;
    const double most_m = 0.95 * patient.scene.needle_length_m, around = random.in(0, 6.283185307);
    Redirection one{.first = *line, .second = *line};
    for (const Stretch& stretch : sampled(patient, *line, 1e-5, most_m, 5e-5)) {
      if (stretch.structure == kOutside) break;
      if (!patient.isBone(stretch.structure)) continue;
      if (stretch.length_m() > 2e-3) one.bone_m = stretch.from_m;
      break;
    }
    one.back_m = std::min(random.in(0.003, 0.015), one.bone_m - 2e-3);
    if (one.back_m < 0.003) continue;
    const Vec3 side = normalized(cross(line->axis, {0.3, 0.5, 0.81})), other = cross(line->axis, side);
    const auto tilted = [&](double degrees) {
      const double tilt = degrees * std::numbers::pi / 180;
      return line->axis * std::cos(tilt) +
             (side * std::cos(around) + other * std::sin(around)) * std::sin(tilt);
    };
    one.second.axis = tilted(8);
    const Stretches rough = sampled(patient, one.second, 1e-5, most_m, 5e-5);
    one.end_m = endOfTissue(patient, rough, 0);
    if (one.end_m < one.bone_m + 5e-3) continue;
    // one in two goes along the bone's edge: the needle, which turns a little less, meets the bone
    const Line between{line->origin_m, tilted(6)};
    if (found.size() % 2 == 0 &&
        endOfTissue(patient, sampled(patient, between, 1e-5, most_m, 5e-5), 0) > one.end_m - 1e-3)
      continue;
    found.push_back(one);
  }
  return found;
}

TEST(PastBone, aNeedleThatIsRedirectedFromABoneFeelsTheLayersOfItsSecondWay) {
  const std::size_t wanted = test::longForm() ? 60 : 3;
  constexpr int kTurnTicks = 400;
  for (const Patient& patient : patients()) {
    const auto redirections = redirectionsOf(patient, wanted);
    EXPECT_EQ(redirections.size(), wanted) << patient.name;
    Share ticks, at_tip, membranes;
    int touched = 0;
    for (const Redirection& way : redirections) {
      Needle needle(patient);
      needle.rest(way.first.at(-kStart_m), way.first.axis);
      needle.to(way.first.at(way.bone_m + 1e-3), 0.02);
      touched += needle.state().bone.touching;
      needle.to(way.first.at(way.back_m), 0.02);
      for (int k = 1; k <= kTurnTicks; ++k) {
        const Vec3 axis = normalized(way.first.axis + (way.second.axis - way.first.axis) *
                                                          (static_cast<double>(k) / kTurnTicks));
        needle.at(way.first.origin_m + axis * way.back_m, axis);
      }
      needle.rest(way.second.at(way.back_m), way.second.axis, 100);
      MembranesMet ahead(patient);
      needle.to(way.second.at(way.end_m), 0.02, [&](const StepReport&) {
        const double s_m = dot(needle.tip() - way.second.origin_m, way.second.axis);
        if (s_m < way.back_m + kBeyond_m || patient.fromBone(needle.tip()) < kBeyond_m) return;
        judge(patient, needle, ticks, &at_tip);
        if (s_m > 0.02) ahead.tick(needle);  // nearer, a membrane may have the first way's hole
      });
      ahead.count(membranes);
    }
    std::printf(
        "past bone, redirected: %-16s %d of %zu rested on bone, right in %.1f %% of %ld ticks (or at the tip itself in %.1f %%), %ld of %ld membranes\n",
        patient.name.c_str(), touched, redirections.size(), ticks.percent(), ticks.all, at_tip.percent(),
        membranes.right, membranes.all);
    EXPECT_EQ(touched, static_cast<int>(redirections.size()))
        << patient.name << ": the first way ends on bone";
    EXPECT_GE(ticks.percent(), 98) << patient.name << ": the second way's layer is not the field's";
    EXPECT_EQ(membranes.right, membranes.all) << patient.name << ": membranes of the second way are not felt";
  }
}

}  // namespace
}  // namespace needlelab::patients_in_body::past_bone
