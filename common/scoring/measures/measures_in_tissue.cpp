// Measures of the needle in tissue: depth and forces, targets and hazards, the plan, the syringe.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <variant>

#include "common/haptics/engine.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/sim_state.h"
#include "common/haptics/surface.h"
#include "common/profile/layer_names.h"
#include "common/scoring/anatomy/bone_contacts.h"
#include "common/scoring/anatomy/contacts.h"
#include "common/scoring/anatomy/needle_way.h"
#include "common/scoring/anatomy/structure_region.h"
#include "common/scoring/measures/measure_groups.h"
#include "common/scoring/measures/syringe_events.h"

namespace needlelab {
namespace {

/// Turns closer together than this are one change of trajectory, because the limit on turning speed makes the
/// engine pause between them.
constexpr double kTurnPause_s = 0.2;
/// Shorter insertions have no straight path to compare with.
constexpr double kMinWay_m = 1e-3;
/// An insertion ends when within this distance of its greatest length, because at rest, tremor may reach the
/// greatest length at any time.
constexpr double kEndWithin_m = 0.25e-3;

/// For this time after a change of layer, the force counts for neither layer: the drop behind a boundary
/// takes several ticks, depending on the loop's rate.
constexpr double kLayerChange_s = 0.01;

double forceOf(const GestureSample& s) {
  return norm({s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]});
}

/// Entries, withdrawals and turns of a gesture.
class Counts {
 public:
  explicit Counts(double rate_hz) : rate_hz_(rate_hz) {}

  void add(const GestureSample& sample) {
    const bool inside = isInside(sample);
    // the flag reveals an entry whose preceding exit was lost in missing ticks
    const bool entered = inside && (!was_inside_ || (sample.flags & kFlagEntry) != 0);
    if (entered) {
      ++entries;
      was_withdrawing_ = false;
    }
    if (inside && sample.phase == static_cast<std::uint8_t>(Phase::kWithdrawing)) {
      if (!was_withdrawing_) ++withdrawals;
      was_withdrawing_ = true;
    } else if (inside && sample.phase == static_cast<std::uint8_t>(Phase::kInserting)) {
      was_withdrawing_ = false;
    }
    if ((sample.flags & kFlagTurn) != 0) {
      const bool goes_on = last_turn_ && secondsBetween(*last_turn_, sample, rate_hz_) <= kTurnPause_s;
      if (!goes_on) ++turns;
      last_turn_ = sample;
    }
    was_inside_ = inside;
  }

  int entries = 0, withdrawals = 0, turns = 0;

 private:
  const double rate_hz_;
  bool was_inside_ = false, was_withdrawing_ = false;
  std::optional<GestureSample> last_turn_;
};

/// The path length in tissue up to the end of the longest insertion, divided by the straight line from its
/// entry to that end. Paths before that entry (of abandoned insertions) count, too. The insertion ends where
/// it first comes within kEndWithin_m of its greatest length.
class Inefficiency {
 public:
  explicit Inefficiency(const Gesture& gesture) : gesture_(gesture) {}

  void add(std::size_t i) {
    const GestureSample& sample = gesture_.samples[i];
    const bool inside = isInside(sample);
    if (inside && (!was_inside_ || (sample.flags & kFlagEntry) != 0)) entry_ = i;
    if (inside && sample.insertion_m > greatest_m_) {
      greatest_m_ = sample.insertion_m;
      deepest_ = i;
      end_ = deepest_entry_ = entry_;
    }
    was_inside_ = inside;
  }

  /// Looks for the insertion's end. Returns true when found.
  bool finish(StepWork& work) {
    const auto& samples = gesture_.samples;
    while (end_ < deepest_ && samples[end_].insertion_m < greatest_m_ - kEndWithin_m) {
      if (work.isOver()) return false;
      work.spend(1);
      ++end_;
    }
    return true;
  }

  /// The inefficiency; 0 without an insertion.
  [[nodiscard]] double value() const {
    const auto& samples = gesture_.samples;
    if (samples.empty()) return 0;
    const double straight_m = norm(tipOf(samples[end_]) - tipOf(samples[deepest_entry_]));
    if (straight_m < kMinWay_m) return 0;
    const double end_s = secondsBetween(samples.front(), samples[end_], gesture_.rate_hz);
    double way_m = 0;
    for (const Run& run : gesture_.runs) {
      for (std::size_t i = 0; i < run.inside.size(); ++i) {
        // the last step counts partially
        const double from_s = run.start_s + static_cast<double>(i) * run.period_s;
        const double share = std::clamp((end_s - from_s) / run.period_s, 0.0, 1.0);
        way_m += share * run.inside[i] * norm(run.points[i + 1].p_WT_m - run.points[i].p_WT_m);
      }
    }
    return std::max(1.0, way_m / straight_m);
  }

 private:
  const Gesture& gesture_;
  std::size_t entry_ = 0, deepest_ = 0, deepest_entry_ = 0, end_ = 0;
  double greatest_m_ = 0;
  bool was_inside_ = false;
};

/// The point where the tip passed through the skin, as in the engine (FORCE_MODEL.md, "Contact"): where the
/// depth is 0 on the straight line between the last tick outside and the first one inside (sample `first`).
/// If the previous tick is missing, back along the needle by its inserted length.
Vec3 entryAt(const Gesture& gesture, std::size_t first) {
  const auto& samples = gesture.samples;
  if (first > 0 && gesture.anatomy.has_limb &&
      secondsBetween(samples[first - 1], samples[first], gesture.rate_hz) <= kLongestBridge_s) {
    const Vec3 before = tipOf(samples[first - 1]), tip = tipOf(samples[first]);
    const double outside_m = -signedDepth(gesture.anatomy.limb, before),
                 inside_m = signedDepth(gesture.anatomy.limb, tip);
    if (outside_m >= 0 && inside_m > 0) return before + outside_m / (outside_m + inside_m) * (tip - before);
  }
  return wayOf(samples[first]).skin_W_m;
}

/// Distance of the tip from the nearest target's centre.
double fromCentre(const Anatomy& anatomy, Vec3 tip_W_m) {
  double distance_m = std::numeric_limits<double>::infinity();
  for (const Target& target : anatomy.targets)
    distance_m = std::min(distance_m, norm(tip_W_m - target.ball.a_W_m));
  return distance_m;
}

}  // namespace

double Gesture::weight_s(std::size_t i) const {
  const auto half = [&](std::size_t a, std::size_t b) {
    const double gap_s = secondsBetween(samples[a], samples[b], rate_hz);
    return gap_s <= kLongestBridge_s ? 0.5 * gap_s : 0.0;
  };
  return (i > 0 ? half(i - 1, i) : 0) + (i + 1 < samples.size() ? half(i, i + 1) : 0);
}

namespace {

/// What was recorded, and since when the needle was used.
/// - `needle_s`: from the first tick in which the uncapped tip was in tissue to the last one.
/// - `missing_s`: time of the holes. `incomplete`: the needle was in tissue before or behind a hole, or a
///   hole was long enough for an insertion.
class WholeGroup : public SampleGroup {
 public:
  explicit WholeGroup(GestureFacts& facts) : gesture_(*facts.gesture), facts_(facts) {}

  void add(std::size_t i) override {
    constexpr double kInsertion_s = 1;
    const GestureSample& sample = gesture_.samples[i];
    const double gap_s = i > 0 ? secondsBetween(before_, sample, gesture_.rate_hz) : 0;
    if (gap_s > kLongestBridge_s) {
      facts_.missing_s += gap_s;
      if (isInside(before_) || isInside(sample) || gap_s >= kInsertion_s) facts_.incomplete = true;
    }
    if (isInside(sample) || facts_.ends_inside) facts_.ends_inside = isInside(sample);
    before_ = sample;
    if (!contact_ && isInside(sample) && (sample.flags & kFlagCapped) == 0) contact_ = sample;
    if (contact_) facts_.needle_s = secondsBetween(*contact_, sample, gesture_.rate_hz);
  }

  bool finish(StepWork& /*work*/) override { return true; }

 private:
  const Gesture& gesture_;
  GestureFacts& facts_;
  GestureSample before_;
  std::optional<GestureSample> contact_;
};

/// - `depth_m`: of the tip below the nearest skin. `insertion_m`: along the trajectory.
/// - `peak_N`: greatest force on the hand in any tick. `impulse_Ns`, `weight_s`: over the time in tissue.
///   `layers`: while the tip was in the layer.
/// - `lateral_m`: distance of the tip from its own trajectory, the line begun at its entry.
/// - `entries`: number of times the tip went in. `withdrawals`: number of times it was drawn back (a stop on
///   the way does not begin another). `trajectory_changes`: runs of turns, including pauses up to 0.2 s.
/// - `inefficiency`: path in tissue over the straight line to within 0.25 mm of the furthest point; 1 is
///   straight.
class TissueGroup : public SampleGroup {
 public:
  explicit TissueGroup(GestureFacts& facts)
      : gesture_(*facts.gesture), facts_(facts), counts_(gesture_.rate_hz), inefficiency_(gesture_) {
    facts_.layers.resize(profileLayers(*gesture_.profile).size());
  }

  void add(std::size_t i) override {
    const GestureSample& sample = gesture_.samples[i];
    counts_.add(sample);
    inefficiency_.add(i);
    if ((sample.flags & (kFlagKeptPath | kFlagSkipped)) != 0) {
      GestureScore::LatePaths& late = facts_.late_paths;
      if (late.kept + late.skipped == 0) late.first_tick = sample.tick;
      late.kept += (sample.flags & kFlagKeptPath) != 0;
      late.skipped += (sample.flags & kFlagSkipped) != 0;
    }
    const double force_N = forceOf(sample);
    if ((sample.flags & kFlagCapped) == 0) facts_.peak_N = std::max(facts_.peak_N, force_N);
    if (sample.layer != layer_before_) {
      changed_ = sample;
      has_changed_ = layer_before_ >= 0 && isInside(sample);
    }
    layer_before_ = sample.layer;
    if (!isInside(sample)) return;
    if (gesture_.anatomy.has_limb) addDepth(tipOf(sample));
    facts_.insertion_m = std::max(facts_.insertion_m, sample.insertion_m);
    facts_.lateral_m = std::max(facts_.lateral_m, sample.lateral_error_m);
    const double weight_s = gesture_.weight_s(i);
    facts_.impulse_Ns += force_N * weight_s;
    facts_.weight_s += weight_s;
    const auto layer =
        static_cast<std::size_t>(static_cast<unsigned char>(sample.layer));  // not negative here
    const bool changing =
        has_changed_ && secondsBetween(changed_, sample, gesture_.rate_hz) < kLayerChange_s * (1 - 1e-9);
    if (layer >= facts_.layers.size() || changing) return;
    LayerFacts& in = facts_.layers[layer];
    in.peak_N = std::max(in.peak_N, force_N);
    in.impulse_Ns += force_N * weight_s;
    in.weight_s += weight_s;
  }

  bool finish(StepWork& work) override {
    askDepths();
    if (!inefficiency_.finish(work)) return false;
    facts_.entries = counts_.entries;
    facts_.withdrawals = counts_.withdrawals;
    facts_.trajectory_changes = counts_.turns;
    const double inefficiency = inefficiency_.value();
    if (inefficiency > 0) facts_.inefficiency = inefficiency;
    return true;
  }

 private:
  void addDepth(Vec3 tip_W_m) {
    const Anatomy& anatomy = gesture_.anatomy;
    if (!std::holds_alternative<BodyLimb>(anatomy.limb)) {
      facts_.depth_m = std::max(facts_.depth_m, depthAt(anatomy, tip_W_m));
      return;
    }
    tips_W_m_[tips_++] = tip_W_m;
    if (tips_ == tips_W_m_.size()) askDepths();
  }

  // In a body it takes a search: not where the tip cannot be deeper than the greatest depth so far, by the
  // way to where it was asked last, or by one way to the skin, first of all to where the last one led: a tip
  // that rests has the same. The last tip first: on the way in it is the deepest.
  void askDepths() {
    while (tips_ > 0) {
      const Vec3 tip_W_m = tips_W_m_[--tips_];
      if (norm(tip_W_m - depth_at_W_m_) + depth_there_m_ <= facts_.depth_m) continue;
      if (norm(skin_W_m_ - tip_W_m) <= facts_.depth_m) continue;
      skin_W_m_ = nearestSkin(gesture_.anatomy.limb, tip_W_m, {0, 0, -1});
      if (norm(skin_W_m_ - tip_W_m) <= facts_.depth_m) continue;
      depth_at_W_m_ = tip_W_m;
      depth_there_m_ = depthAt(gesture_.anatomy, tip_W_m);
      facts_.depth_m = std::max(facts_.depth_m, depth_there_m_);
    }
  }

  const Gesture& gesture_;
  GestureFacts& facts_;
  std::array<Vec3, 256> tips_W_m_;  // not yet asked, in order
  std::size_t tips_ = 0;
  Vec3 depth_at_W_m_;  // where it was asked last
  double depth_there_m_ = std::numeric_limits<double>::infinity();
  Vec3 skin_W_m_ = {std::numeric_limits<double>::infinity(), 0, 0};  // where the last way to it led
  int layer_before_ = -1;
  GestureSample changed_;  // sample at the tip's last change of layer
  bool has_changed_ = false;
  Counts counts_;
  Inefficiency inefficiency_;
};

/// Asks for a hazard's distance from the shaft only when the shaft has moved by as much as the last one.
class Clearance {
 public:
  bool touches(const Region& hazard, Vec3 tip_W_m, Vec3 skin_W_m) {
    // no point of the shaft has moved by more than its ends
    const double moved_m = std::max(norm(tip_W_m - tip_W_m_), norm(skin_W_m - skin_W_m_));
    if (moved_m < clear_m_) return false;
    tip_W_m_ = tip_W_m;
    skin_W_m_ = skin_W_m;
    // a structure's distance may be too great by a ninth (field.h), and between the places of a shaft that
    // were asked it may be half of theirs (StructureRegion::distanceFromShaft)
    clear_m_ = 0.45 * distanceTo(hazard, tip_W_m, skin_W_m);
    return clear_m_ <= 0;
  }

 private:
  Vec3 tip_W_m_, skin_W_m_;
  double clear_m_ = 0;
};

/// Counted while the tip is in tissue.
/// - `target_reached`: the tip stayed in a target (InTarget) for the exercise's dwell; up to 0.1 s outside
///   does not end a stay. `at_target_s`: the total time there.
/// - `target_distance_m`: distance of the tip from the nearest target's centre at the furthest point of the
///   last insertion; `target_nearest_m`: the least distance at any time.
/// - `hazards_touched`: hazards touched by the tip or by the shaft in tissue (straight back along the
///   needle). `bone_contacts`: how often the tip met bone (bone_contacts.h). `hub_contacts`: how often the
///   hub met the skin (contacts.h).
/// - `landmark_s`: when the capped tip was first no farther from the landmark than the cap is thick.
class AimGroup : public SampleGroup {
 public:
  explicit AimGroup(GestureFacts& facts)
      : gesture_(*facts.gesture),
        facts_(facts),
        touched_(gesture_.anatomy.hazards.size(), false),
        clearances_(gesture_.anatomy.hazards.size()),
        bones_(*gesture_.profile, gesture_.anatomy),
        in_target_(gesture_.anatomy) {
    facts_.has_landmark = gesture_.anatomy.landmark != nullptr;
    if (gesture_.anatomy.targets.empty()) return;
    facts_.target_reached = false;
    facts_.at_target_s = 0;
  }

  void add(std::size_t i) override {
    const std::vector<Region>& hazards = gesture_.anatomy.hazards;
    const GestureSample& sample = gesture_.samples[i];
    const Vec3 tip = tipOf(sample);
    const double time_s = secondsBetween(gesture_.samples.front(), sample, gesture_.rate_hz);
    if (bones_.add(time_s, sample.layer, tip)) ++facts_.bone_contacts;
    if (hub_.add(time_s, sample.flags)) ++facts_.hub_contacts;
    final_.add(sample, i);
    if (!facts_.landmark_s && (sample.flags & kFlagCapped) != 0 && gesture_.anatomy.landmark != nullptr &&
        gesture_.anatomy.landmark->distance(tip) <= gesture_.profile->palpation().radius_m())
      facts_.landmark_s = time_s;
    if (!isInside(sample)) return;
    const NeedleWay way = wayOf(sample);
    for (std::size_t h = 0; h < hazards.size(); ++h)
      if (!touched_[h]) touched_[h] = clearances_[h].touches(hazards[h], tip, way.skin_W_m);
    if (gesture_.anatomy.targets.empty()) return;
    nearest_m_ = std::min(nearest_m_, fromCentre(gesture_.anatomy, tip));
    if (!in_target_(way)) return;
    *facts_.at_target_s += gesture_.weight_s(i);
    if (!stayed_until_ || secondsBetween(*stayed_until_, sample, gesture_.rate_hz) > kLongestBridge_s)
      stay_s_ = 0;
    stay_s_ += gesture_.weight_s(i);
    stayed_until_ = sample;
    if (stay_s_ >= gesture_.dwell_s * (1 - 1e-9)) facts_.target_reached = true;
  }

  bool finish(StepWork& /*work*/) override {
    for (std::size_t h = 0; h < touched_.size(); ++h)
      if (touched_[h]) facts_.hazards_touched.push_back(gesture_.anatomy.hazards[h].name);
    if (gesture_.anatomy.targets.empty() || !final_.index) return true;
    facts_.target_distance_m = fromCentre(gesture_.anatomy, tipOf(gesture_.samples[*final_.index]));
    facts_.target_nearest_m = nearest_m_;
    return true;
  }

 private:
  const Gesture& gesture_;
  GestureFacts& facts_;
  std::vector<bool> touched_;          // by hazard
  std::vector<Clearance> clearances_;  // likewise
  BoneContacts bones_;
  HubContacts hub_;
  InTarget in_target_;
  std::optional<GestureSample> stayed_until_;  // last tick in a target
  double stay_s_ = 0;
  FinalPoint final_;
  double nearest_m_ = std::numeric_limits<double>::infinity();  // of targets
};

/// E is the planned entry and d the planned direction (unit, into the tissue), both in W; no facts without a
/// plan, nor if the needle was never in tissue.
/// - `planned_entry_m`: |P − E|, where P is where the tip first passed through the skin. The straight
///   distance: on a limb of radius R it is shorter than along the skin by less than 0.2 % up to R/5.
/// - `planned_angle_rad`: atan2(|a × d|, a · d), with a the needle's axis (hub to tip) at the furthest point
///   of the last insertion (as for `target_distance_m`). 0 along the plan, π for a needle that points back.
/// - `planned_line_ms`: Σ w |r − (r·d) d| over the ticks in tissue, r = tip − E and w a tick's time, the
///   parts of `weight_s`. `planned_line_m`: the greatest |r − (r·d) d| in tissue. The line is infinite.
class PlanGroup : public SampleGroup {
 public:
  explicit PlanGroup(GestureFacts& facts) : gesture_(*facts.gesture), facts_(facts) {}

  void add(std::size_t i) override {
    if (!gesture_.plan_W) return;
    const GestureSample& sample = gesture_.samples[i];
    final_.add(sample, i);
    if (!isInside(sample)) return;
    if (!entry_m_) entry_m_ = entryAt(gesture_, i);
    const double off_m = distanceFrom(*gesture_.plan_W, tipOf(sample));
    largest_m_ = std::max(largest_m_, off_m);
    facts_.planned_line_ms += off_m * gesture_.weight_s(i);
  }

  bool finish(StepWork& /*work*/) override {
    if (!entry_m_ || !final_.index) return true;
    const PlannedLine& plan = *gesture_.plan_W;
    facts_.planned_entry_m = norm(*entry_m_ - plan.entry_m);
    facts_.planned_angle_rad = angleTo(plan, wayOf(gesture_.samples[*final_.index]).axis_W);
    facts_.planned_line_m = largest_m_;
    return true;
  }

 private:
  const Gesture& gesture_;
  GestureFacts& facts_;
  std::optional<Vec3> entry_m_;
  FinalPoint final_;
  double largest_m_ = 0;
};

}  // namespace

std::vector<std::unique_ptr<SampleGroup>> sampleGroups(GestureFacts& facts) {
  std::vector<std::unique_ptr<SampleGroup>> groups;
  groups.push_back(std::make_unique<WholeGroup>(facts));
  groups.push_back(std::make_unique<TissueGroup>(facts));
  groups.push_back(std::make_unique<AimGroup>(facts));
  groups.push_back(std::make_unique<PlanGroup>(facts));
  return groups;
}

/// - `aspirations`, `injections`: strokes of the plunger (syringe_events.h). `injected`: share of the
///   syringe pressed out by all injections together, in or outside tissue; above 1 if it was drawn
///   up and pressed again. `injected_in_target`: the part of it that left the needle's opening in a target.
/// - `aspirated_before`: an aspiration that began in tissue came before the first injection with a part in
///   tissue.
void findSyringe(std::span<const pb::SyringeEvent> events, GestureFacts& facts) {
  bool aspirated = false;
  for (const pb::SyringeEvent& event : events) {
    if (event.kind() == pb::SyringeEvent::ASPIRATION) {
      ++facts.aspirations;
      aspirated = aspirated || event.begin().in_tissue();
      continue;
    }
    ++facts.injections;
    const double stroke = event.plunger_to() - event.plunger_from();
    facts.injected += stroke;
    facts.injected_in_target += stroke * event.in_target_share();
    if (!facts.aspirated_before && event.in_tissue_share() > 0) facts.aspirated_before = aspirated;
  }
}

}  // namespace needlelab
