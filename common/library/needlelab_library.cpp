#include <algorithm>
#include <cstddef>
#include <cstring>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/range.h"
#include "common/curves/curve_set.h"
#include "common/fem/needle_mesh.h"
#include "common/gesture/sample.h"
#include "common/gesture/whole_recording.h"
#include "common/library/include/needlelab/needlelab.h"
#include "common/library/scene_handle.h"
#include "common/profile/planned_line.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/motion/motion_cost.h"

struct nl_profile {
  needlelab::pb::Profile profile;
};
struct nl_recording {
  needlelab::ReadRecording read;
};
struct nl_scores {
  std::vector<needlelab::Measure> measures;
};
struct nl_curves {
  std::vector<needlelab::ForceCurve> curves;
  std::vector<needlelab::CurveColumns> rows;  // of each
  std::string metadata;
};

namespace needlelab {
namespace {

// a recording's samples are handed out as they are
#define NL_SAME_PLACE(c_member, member) \
  static_assert(offsetof(nl_sample, c_member) == offsetof(GestureSample, member))
static_assert(sizeof(nl_sample) == sizeof(GestureSample));
NL_SAME_PLACE(tick, tick);
NL_SAME_PLACE(time_ns, time_ns);
NL_SAME_PLACE(p_m, p_WT_m);
NL_SAME_PLACE(q, q_WT);
NL_SAME_PLACE(speed_m_s, speed_mps);
NL_SAME_PLACE(force_n, force_W_N);
NL_SAME_PLACE(torque_nm, torque_W_Nm);
NL_SAME_PLACE(wall_m, wall_W_m);
NL_SAME_PLACE(insertion_m, insertion_m);
NL_SAME_PLACE(lateral_error_m, lateral_error_m);
NL_SAME_PLACE(plunger, plunger);
NL_SAME_PLACE(device_ns, device_ns);
NL_SAME_PLACE(engine_ns, engine_ns);
NL_SAME_PLACE(flags, flags);
NL_SAME_PLACE(buttons, buttons);
NL_SAME_PLACE(layer, layer);
NL_SAME_PLACE(phase, phase);
NL_SAME_PLACE(fault, fault);
#undef NL_SAME_PLACE

Result<std::unique_ptr<nl_profile>> handleOf(Result<pb::Profile> profile) {
  if (!profile.ok()) return profile.error();
  return std::make_unique<nl_profile>(nl_profile{std::move(*profile)});
}

Result<std::unique_ptr<nl_scores>> scored(std::span<const GestureSample> samples, double rate_hz,
                                          const pb::Profile& profile, const Pose& X_WL,
                                          const char* exercise_json) {
  constexpr NumberRange kRates{kMinRateHz, kMaxRateHz};
  if (!kRates.contains(rate_hz)) return outOfRange("rate_hz", rate_hz, kRates);
  RETURN_IF_ERROR(checkMotion(RecordedSamples(samples), rate_hz));
  pb::Exercise exercise;
  if (exercise_json != nullptr) {
    ASSIGN_OR_RETURN(exercise, parseExercise(exercise_json, "exercise"));
    RETURN_IF_ERROR(checkRequirements(exercise));
    RETURN_IF_ERROR(checkPlan(exercise, profile, ""));
  }
  return std::make_unique<nl_scores>(nl_scores{
      scoreGesture(samples, rate_hz, profile, X_WL, exercise_json != nullptr ? &exercise : nullptr)});
}

Result<std::unique_ptr<nl_curves>> readCurves(const char* folder, const char* options_json) {
  CurveOptions options;
  if (options_json != nullptr) {
    ASSIGN_OR_RETURN(options, parseCurveOptions(options_json));
  }
  ASSIGN_OR_RETURN(auto set, readCurveSet(folder, options.description, options.reading));
  auto made = std::make_unique<nl_curves>();
  for (const ForceCurve& curve : set.curves) made->rows.push_back(columnsOf(curve));
  made->curves = std::move(set.curves);
  made->metadata = nlohmann::json{
      {"name", set.name},
      {"licence", set.licence},
      {"source", set.source},
      {"notes",
       set.notes}}.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return made;
}

}  // namespace

}  // namespace needlelab

using namespace needlelab;  // NOLINT(google-build-using-namespace): the functions below are C's

nl_profile* nl_profile_read(const char* path, char* error, size_t error_size) {
  return atBorder(error, error_size, [&] { return handleOf(loadProfile(path)); });
}
nl_profile* nl_profile_parse(const char* json, size_t size, const char* name, char* error,
                             size_t error_size) {
  return atBorder(error, error_size, [&] { return handleOf(parseProfile({json, size}, name)); });
}
void nl_profile_destroy(nl_profile* profile) {
  delete profile;
}

int nl_profile_set_model(nl_profile* profile, const char* model, char* error, size_t error_size) {
  const auto chosen =
      std::unique_ptr<nl_profile>(atBorder(error, error_size, [&]() -> Result<std::unique_ptr<nl_profile>> {
        auto changed = std::make_unique<nl_profile>(*profile);
        RETURN_IF_ERROR(chooseModel(changed->profile, model));
        return changed;
      }));
  if (chosen) profile->profile.Swap(&chosen->profile);
  return chosen ? 1 : 0;
}

nl_scene* nl_scene_of_profile(const nl_profile* profile, double rate_hz, const nl_pose* placement,
                              char* error, size_t error_size) {
  return atBorder(error, error_size, [&]() -> Result<std::unique_ptr<nl_scene>> {
    ASSIGN_OR_RETURN(auto spec,
                     sceneSpecOf(profile->profile, placement != nullptr ? poseOf(*placement) : Pose{}));
    RETURN_IF_ERROR(addCompliance(spec));
    std::string message(1000, '\0');
    nl_scene* const scene = nl_private_scene_of_spec(&spec, rate_hz, message.data(), message.size());
    if (scene == nullptr) return Error{ErrorCode::kInvalidInput, message.c_str()};
    return std::unique_ptr<nl_scene>(scene);
  });
}

nl_recording* nl_recording_read(const char* path, int damaged, char* error, size_t error_size) {
  return atBorder(error, error_size, [&]() -> Result<std::unique_ptr<nl_recording>> {
    ASSIGN_OR_RETURN(auto read,
                     readRecording(path, damaged != 0 ? DamagedRecording::kRead : DamagedRecording::kRefuse));
    if (read.rate_hz == 0) read.rate_hz = wholeRate_hz(tickOf_s(read.samples));
    return std::make_unique<nl_recording>(nl_recording{std::move(read)});
  });
}
void nl_recording_destroy(nl_recording* recording) {
  delete recording;
}
const nl_sample* nl_recording_samples(const nl_recording* recording, size_t* count) {
  *count = recording->read.samples.size();
  return reinterpret_cast<const nl_sample*>(recording->read.samples.data());
}
double nl_recording_rate_hz(const nl_recording* recording) {
  return recording->read.rate_hz;
}
const char* nl_recording_metadata(const nl_recording* recording) {
  return recording->read.metadata.c_str();
}
size_t nl_recording_hole_count(const nl_recording* recording) {
  return recording->read.holes.size();
}
const char* nl_recording_hole(const nl_recording* recording, size_t index) {
  return index < recording->read.holes.size() ? recording->read.holes[index].c_str() : nullptr;
}

nl_scores* nl_score(const nl_sample* samples, size_t count, double rate_hz, const nl_profile* profile,
                    const nl_pose* placement, const char* exercise, char* error, size_t error_size) {
  return atBorder(error, error_size, [&] {
    return scored({reinterpret_cast<const GestureSample*>(samples), count}, rate_hz, profile->profile,
                  placement != nullptr ? poseOf(*placement) : Pose{}, exercise);
  });
}
void nl_scores_destroy(nl_scores* scores) {
  delete scores;
}
size_t nl_scores_count(const nl_scores* scores) {
  return scores->measures.size();
}
int nl_scores_get(const nl_scores* scores, size_t index, nl_measure* measure) {
  if (index >= scores->measures.size()) return 0;
  const Measure& found = scores->measures[index];
  nl_measure whole{};
  whole.size = measure->size;
  whole.passed = found.passed ? static_cast<int32_t>(*found.passed) : -1;
  whole.incomplete = found.incomplete ? 1 : 0;
  whole.name = found.name.c_str();
  whole.unit = found.unit.c_str();
  whole.words = found.words.c_str();
  whole.value = found.measured ? found.value : std::numeric_limits<double>::quiet_NaN();
  std::memcpy(measure, &whole, std::min<std::size_t>(measure->size, sizeof whole));
  return 1;
}

nl_curves* nl_curves_read(const char* folder, const char* options, char* error, size_t error_size) {
  return atBorder(error, error_size, [&] { return readCurves(folder, options); });
}
void nl_curves_destroy(nl_curves* curves) {
  delete curves;
}
size_t nl_curves_count(const nl_curves* curves) {
  return curves->curves.size();
}
int nl_curves_get(const nl_curves* curves, size_t index, nl_curve* curve) {
  static_assert(sizeof(CurvePhase) == sizeof(uint8_t));
  if (index >= curves->curves.size()) return 0;
  const ForceCurve& found = curves->curves[index];
  const CurveColumns& rows = curves->rows[index];
  nl_curve whole{};
  whole.size = curve->size;
  whole.name = found.name.c_str();
  whole.specimen = found.specimen.c_str();
  whole.needle = found.needle.c_str();
  whole.tissue = found.tissue.c_str();
  whole.speed_m_s = found.speed_mps;
  whole.diameter_m = found.diameter_m;
  whole.count = rows.depth_m.size();
  whole.depth_m = rows.depth_m.data();
  whole.force_n = rows.force_N.data();
  whole.t_s = rows.t_s.data();
  whole.phase = reinterpret_cast<const uint8_t*>(rows.phase.data());
  std::memcpy(curve, &whole, std::min<std::size_t>(curve->size, sizeof whole));
  return 1;
}
const char* nl_curves_metadata(const nl_curves* curves) {
  return curves->metadata.c_str();
}
