// The rows of the table of measures: each names everything that the program knows of one measure, and the
// function that computes it. A new measure is a row here (CONTRIBUTING.md, "How to add a measure").
#include <algorithm>

#include "common/scoring/measures/measure_groups.h"
#include "common/scoring/measures/measure_table.h"

namespace needlelab {

// Increase it by one whenever the value of any measure of any gesture changes, or a measure is added or
// removed; a test over committed gestures (definition_test.cpp) detects such a change.
// 2: movements, turns, mean force per layer, work against clamping, distance from references.
// 3: contacts with bone.
// 4: errors against the exercise's plan; a gesture without one scores as in 3.
// 5: mean SPARC of the movements, weighted by distance; until then SPARC from first entry to last exit.
// 6: contacts of the hub with the skin.
// 7: being in a target requires being in its tissues; a profile whose targets name none scores as in 6.
// 8: time to the landmark; forces with the cap on do not count as peak force. A patient without PALPATION
// scores as in 7.
// 9: the greatest depth in a body is the distance from the nearest skin (10: to 0.1 mm); layers score as
// in 8.
// 11: a step that only touches the tick of an entry or exit is outside tissue (ldlj; turns and movements
// there).
// 12: a needle that came through a hazard behind the target's near side is not in the target; a target is
// reached by a stay (0.5 s unless the exercise says otherwise); time from the first contact, which time
// limits refer to; holes in the recording; no peak force of a layer that the tip was never in.
const std::uint32_t kScoreDefinitionVersion = 12;

namespace {

using Value = std::optional<double>;
using Facts = GestureFacts;

/// A measure that is a fact as it is; nothing if the fact is empty.
template <auto kMember>
Value fact(const Facts& facts, std::size_t /*layer*/) {
  return facts.*kMember;
}

Value missing(const Facts& facts, std::size_t /*layer*/) {
  return facts.missing_s > 0 ? Value(facts.missing_s) : std::nullopt;
}

Value meanSpeed(const Facts& facts, std::size_t /*layer*/) {
  return facts.time_s > 0 ? facts.path_m / facts.time_s : 0;
}

/// Σ max(0, −F·Δp) over the track's steps in tissue, F the force on the hand averaged over the step and Δp
/// the tip's movement, both across the needle's axis: the forces along it (cutting, friction, puncture) do
/// not count.
Value clampingWork(const Facts& facts, std::size_t /*layer*/) {
  double work_J = 0;
  for (const Run& run : facts.gesture->runs) {
    for (std::size_t i = 0; i < run.inside.size(); ++i) {
      const TrackPoint &a = run.points[i], &b = run.points[i + 1];
      const Vec3 step_m = b.p_WT_m - a.p_WT_m;
      const Vec3 sum = a.axis_W + b.axis_W;
      if (!(run.inside[i] > 0) || !(normSquared(sum) > 1e-12)) continue;
      const Vec3 axis = normalized(sum);
      const auto across = [&](Vec3 v) { return v - dot(v, axis) * axis; };
      work_J += run.inside[i] * std::max(0.0, -dot(across(run.force_W_N[i]), across(step_m)));
    }
  }
  return work_J;
}

Value meanForceInTissue(const Facts& facts, std::size_t /*layer*/) {
  return facts.weight_s > 0 ? facts.impulse_Ns / facts.weight_s : 0;
}

Value peakForceInLayer(const Facts& facts, std::size_t layer) {
  return facts.layers[layer].peak_N;
}

Value meanForceInLayer(const Facts& facts, std::size_t layer) {
  const LayerFacts& in = facts.layers[layer];
  return in.weight_s > 0 ? Value(in.impulse_Ns / in.weight_s) : std::nullopt;
}

Value hazardsTouched(const Facts& facts, std::size_t /*layer*/) {
  return static_cast<double>(facts.hazards_touched.size());
}

/// " (nerve, artery)"
std::string hazardNames(const Facts& facts) {
  std::string names;
  for (const std::string& name : facts.hazards_touched) names += (names.empty() ? " (" : ", ") + name;
  return names.empty() ? names : names + ")";
}

Value meanPlannedLine(const Facts& facts, std::size_t /*layer*/) {
  const bool has_mean = facts.planned_line_m && facts.weight_s > 0;
  return has_mean ? Value(facts.planned_line_ms / facts.weight_s) : std::nullopt;
}

Value injectedInTarget(const Facts& facts, std::size_t /*layer*/) {
  if (facts.injections == 0 || !facts.target_reached) return std::nullopt;
  return facts.injected > 0 ? std::min(1.0, facts.injected_in_target / facts.injected) : 0;
}

constexpr MeasureKind kMeasureKinds[] = {
    {.name = "elapsed_s",
     .unit = "s",
     .words = "Elapsed time",
     .better = Better::kLess,
     .definition = "from the first tick to the last",
     .value = fact<&Facts::elapsed_s>,
     .in_lists = 1,
     .in_reports = 1,
     .over_holes = true},
    {.name = "needle_time_s",
     .unit = "s",
     .words = "Time from the first contact",
     .better = Better::kLess,
     .definition =
         "from the first contact of the uncapped needle with tissue to the last tick; an exercise's "
         "time limit refers to it",
     .value = fact<&Facts::needle_s>,
     .need = MeasureNeed::kTissue,
     .role = MeasureRole::kTime},
    {.name = "missing_s",
     .unit = "s",
     .words = "Missing from the recording",
     .better = Better::kLess,
     .definition = "holes of more than 0.1 s, in which the station stood still; no row without holes. If the "
                   "needle was in tissue before or behind a hole, or the hole lasts 1 s, the other measures "
                   "are incomplete, and a requirement on one is not passed",
     .value = missing,
     .over_holes = true},
    {.name = "ends_in_tissue",
     .words = "Ended with the needle in tissue",
     .better = Better::kLess,
     .definition =
         "1: at the last tick the tip was in tissue, else 0; the rest of the gesture is not recorded",
     .value = fact<&Facts::ends_inside>,
     .need = MeasureNeed::kTissue,
     .form = MeasureForm::kYesNo,
     .over_holes = true,
     .yes_no = {"The needle was out at the end", "it had to be out"}},
    {.name = "path_length_m",
     .unit = "m",
     .words = "Path of the tip",
     .better = Better::kLess,
     .definition = "sum of the tip's steps on the smoothed track",
     .value = fact<&Facts::path_m>},
    {.name = "time_in_tissue_s",
     .unit = "s",
     .words = "Time in tissue",
     .better = Better::kLess,
     .definition = "while the engine had the tip in a layer",
     .value = fact<&Facts::time_in_s>},
    {.name = "path_in_tissue_m",
     .unit = "m",
     .words = "Path in tissue",
     .better = Better::kLess,
     .definition = "the part of the path during that time",
     .value = fact<&Facts::path_in_m>},
    {.name = "mean_speed_m_s",
     .unit = "m/s",
     .words = "Mean speed",
     .better = Better::kNeither,
     .definition = "path over recorded time",
     .value = meanSpeed},
    {.name = "peak_speed_m_s",
     .unit = "m/s",
     .words = "Peak speed",
     .better = Better::kLess,
     .definition = "greatest speed on the smoothed track",
     .value = fact<&Facts::peak_mps>,
     .role = MeasureRole::kSpeed},
    {.name = "tissue_damage_m2",
     .unit = "m^2",
     .words = "Tissue swept by the shaft",
     .better = Better::kLess,
     .definition = "area that the shaft's part in tissue sweeps by moving across itself; straight in and out "
                   "sweeps none",
     .value = fact<&Facts::swept_m2>,
     .in_reports = 8},
    {.name = "sparc",
     .words = "Smoothness (SPARC)",
     .better = Better::kMore,
     .definition =
         "mean spectral arc length of the speed in each movement of the tip that reaches into tissue, "
         "weighted by their ways; rests between movements do not count; below 0, nearer to 0 is smoother",
     .value = fact<&Facts::sparc>,
     .need = MeasureNeed::kMovement,
     .rate_tolerance = 0.5},
    {.name = "ldlj",
     .words = "Smoothness (LDLJ)",
     .better = Better::kMore,
     .definition = "log dimensionless jerk of the speed from first entry to last exit, rests included; "
                   "nearer to 0 is smoother",
     .value = fact<&Facts::ldlj>,
     .need = MeasureNeed::kMovement,
     .rate_tolerance = 0.5},
    {.name = "translational_actions",
     .words = "Movements of the tip",
     .better = Better::kLess,
     .definition = "stretches of 2 mm or more that begin above 3 mm/s and end when the tip stays below 1.5 "
                   "mm/s for 0.1 s; speeds are measured over 0.1 s, so that tremor does not count",
     .value = fact<&Facts::movements>},
    {.name = "rotational_actions",
     .words = "Turns of the needle",
     .better = Better::kLess,
     .definition = "stretches of 0.05 rad or more that begin above 0.1 rad/s and end when the axis stays "
                   "below 0.05 rad/s for 0.1 s; rolling about the axis does not count",
     .value = fact<&Facts::turns>},
    {.name = "clamping_work_j",
     .unit = "J",
     .words = "Work against clamping",
     .better = Better::kLess,
     .definition = "done in tissue by moving the tip across the needle's axis against the force on the hand; "
                   "energy that the tissue returns is not subtracted",
     .value = clampingWork},
    {.name = "greatest_depth_m",
     .unit = "m",
     .words = "Greatest depth",
     .better = Better::kNeither,
     .definition = "of the tip below the nearest skin",
     .value = fact<&Facts::depth_m>,
     .role = MeasureRole::kDepth,
     .in_lists = 3},
    {.name = "greatest_insertion_m",
     .unit = "m",
     .words = "Greatest insertion",
     .better = Better::kNeither,
     .definition = "length of needle in tissue",
     .value = fact<&Facts::insertion_m>},
    {.name = "peak_force_n",
     .unit = "N",
     .words = "Peak force",
     .better = Better::kLess,
     .definition = "greatest force on the hand, with the cap off the needle",
     .value = fact<&Facts::peak_N>,
     .role = MeasureRole::kForce,
     .in_lists = 2,
     .in_reports = 2},
    {.name = "mean_force_in_tissue_n",
     .unit = "N",
     .words = "Mean force in tissue",
     .better = Better::kLess,
     .definition = "over the time in tissue",
     .value = meanForceInTissue},
    {.name = "peak_force_layer_K_n",
     .unit = "N",
     .words = "Peak force in layer K",
     .better = Better::kLess,
     .definition = "while the tip was in layer K (1 is the skin's); no row where it never was, unless the "
                   "exercise asks for it: 0; not in the first 10 ms behind a boundary between layers",
     .value = peakForceInLayer,
     .need = MeasureNeed::kLayer},
    {.name = "mean_force_layer_K_n",
     .unit = "N",
     .words = "Mean force in layer K",
     .better = Better::kLess,
     .definition = "over the same time; no row where the tip never was",
     .value = meanForceInLayer,
     .need = MeasureNeed::kLayer},
    {.name = "largest_lateral_error_m",
     .unit = "m",
     .words = "Largest distance from the needle's own line",
     .better = Better::kLess,
     .definition = "of the tip from the trajectory that its own entry began, not from a plan",
     .value = fact<&Facts::lateral_m>,
     .role = MeasureRole::kOwnLine,
     .in_lists = 4,
     .in_reports = 3},
    {.name = "entries",
     .words = "Entries",
     .better = Better::kLess,
     .definition = "times that the tip went in",
     .value = fact<&Facts::entries>},
    {.name = "withdrawals",
     .words = "Withdrawals",
     .better = Better::kLess,
     .definition = "times that it was drawn back; a stop on the way does not begin another",
     .value = fact<&Facts::withdrawals>},
    {.name = "trajectory_changes",
     .words = "Changes of trajectory",
     .better = Better::kLess,
     .definition = "runs of turns in tissue, pauses up to 0.2 s included",
     .value = fact<&Facts::trajectory_changes>},
    {.name = "path_inefficiency",
     .words = "Way over its own straight way",
     .better = Better::kLess,
     .definition = "way in tissue up to 0.25 mm before the furthest point over the straight line from its "
                   "entry; 1 is straight",
     .value = fact<&Facts::inefficiency>,
     .need = MeasureNeed::kTissue,
     .rate_tolerance = 5e-3},
    {.name = "hazards_touched",
     .words = "Hazards touched",
     .better = Better::kLess,
     .definition = "how many hazards the tip or the shaft in tissue touched",
     .value = hazardsTouched,
     .role = MeasureRole::kHazard,
     .in_lists = 6,
     .fault = {"touched 1 hazard", "touched {} hazards"},
     .detail = hazardNames},
    {.name = "bone_contacts",
     .words = "Bone contacts",
     .better = Better::kLess,
     .definition = "how often the tip touched a bone layer or bone hazard; less than 0.2 s out of bone does "
                   "not begin another contact",
     .value = fact<&Facts::bone_contacts>,
     .role = MeasureRole::kBone,
     .fault = {"1 contact with bone", "{} contacts with bone"}},
    {.name = "hub_contacts",
     .words = "Contacts of the hub with the skin",
     .better = Better::kLess,
     .definition = "how often the needle went in to its hub; less than 0.2 s off the skin does not begin "
                   "another contact",
     .value = fact<&Facts::hub_contacts>,
     .role = MeasureRole::kHub},
    {.name = "target_reached",
     .words = "Target reached",
     .better = Better::kMore,
     .definition =
         "1: the tip stayed in a target, in one of its tissues, for as long as the exercise says, else "
         "for 0.5 s; else 0. Behind a hazard that the needle came through after it was in the target, "
         "it is in no target",
     .value = fact<&Facts::target_reached>,
     .need = MeasureNeed::kTarget,
     .form = MeasureForm::kYesNo,
     .role = MeasureRole::kTarget,
     .yes_no = {"Target not reached", "it had to be avoided"}},
    {.name = "time_at_target_s",
     .unit = "s",
     .words = "Time at the target",
     .better = Better::kNeither,
     .definition = "time of the tip in a target, in one of its tissues, all stays together",
     .value = fact<&Facts::at_target_s>,
     .need = MeasureNeed::kTarget},
    {.name = "target_distance_m",
     .unit = "m",
     .words = "Distance from the target's centre at the deepest point",
     .better = Better::kLess,
     .definition = "at the furthest point of the last insertion",
     .value = fact<&Facts::target_distance_m>,
     .need = MeasureNeed::kTargetAndTissue,
     .in_lists = 5,
     .in_reports = 7},
    {.name = "target_nearest_m",
     .unit = "m",
     .words = "Least distance from the target's centre",
     .better = Better::kLess,
     .definition = "at any time in tissue",
     .value = fact<&Facts::target_nearest_m>,
     .need = MeasureNeed::kTargetAndTissue},
    {.name = "planned_entry_error_m",
     .unit = "m",
     .words = "Entry-site error",
     .better = Better::kLess,
     .definition = "of the first entry through the skin from the planned one; where the exercise has a plan",
     .value = fact<&Facts::planned_entry_m>,
     .need = MeasureNeed::kPlan,
     .in_reports = 4},
    {.name = "planned_angle_error_rad",
     .unit = "rad",
     .words = "Angle to the planned line",
     .better = Better::kLess,
     .definition =
         "of the needle's axis at the furthest point of the last insertion; where the exercise has a plan",
     .value = fact<&Facts::planned_angle_rad>,
     .need = MeasureNeed::kPlan,
     .in_reports = 5},
    {.name = "mean_planned_line_error_m",
     .unit = "m",
     .words = "Mean distance from the planned line",
     .better = Better::kLess,
     .definition = "of the tip, over the time in tissue; where the exercise has a plan",
     .value = meanPlannedLine,
     .need = MeasureNeed::kPlan,
     .in_reports = 6},
    {.name = "largest_planned_line_error_m",
     .unit = "m",
     .words = "Largest distance from the planned line",
     .better = Better::kLess,
     .definition = "of the tip in tissue; where the exercise has a plan",
     .value = fact<&Facts::planned_line_m>,
     .need = MeasureNeed::kPlan,
     .role = MeasureRole::kPlannedLine},
    {.name = "aspirations",
     .words = "Aspirations",
     .better = Better::kNeither,
     .definition = "strokes of the plunger outwards",
     .value = fact<&Facts::aspirations>},
    {.name = "injections",
     .words = "Injections",
     .better = Better::kNeither,
     .definition = "strokes of the plunger inwards",
     .value = fact<&Facts::injections>},
    {.name = "injected_share",
     .words = "Share of the syringe injected",
     .better = Better::kNeither,
     .definition = "of the syringe, all injections together",
     .value = fact<&Facts::injected>,
     .form = MeasureForm::kShare,
     .rate_tolerance = 5e-3},
    {.name = "injected_in_target_share",
     .words = "Share of the injection in the target",
     .better = Better::kMore,
     .definition =
         "of what was injected, by where the needle's opening was; where there is a target and an injection",
     .value = injectedInTarget,
     .need = MeasureNeed::kInjectionAtTarget,
     .form = MeasureForm::kShare,
     .rate_tolerance = 5e-3},
    {.name = "aspirated_before_injection",
     .words = "Aspirated before the injection",
     .better = Better::kMore,
     .definition = "1: an aspiration that began in tissue came before the first injection in tissue, else 0",
     .value = fact<&Facts::aspirated_before>,
     .need = MeasureNeed::kInjectionInTissue,
     .form = MeasureForm::kYesNo,
     .yes_no = {"Not aspirated before the injection", "this was not allowed"}},
    {.name = "dtw_distance_m",
     .unit = "m",
     .words = "Distance from the nearest reference gesture",
     .better = Better::kLess,
     .definition = "mean distance between the paths of the tips in tissue, time warped (DTW), of the nearest "
                   "reference; where references are given",
     .value = fact<&Facts::expert_path_m>,
     .need = MeasureNeed::kReference,
     .role = MeasureRole::kExpertPath,
     .in_reports = 9},
    {.name = "landmark_s",
     .unit = "s",
     .words = "Time to the landmark",
     .better = Better::kLess,
     .definition = "from the first tick until the capped tip first pressed on the bone to be found by feel",
     .value = fact<&Facts::landmark_s>,
     .need = MeasureNeed::kLandmark},
};

}  // namespace

std::span<const MeasureKind> measureKinds() {
  return kMeasureKinds;
}

}  // namespace needlelab
