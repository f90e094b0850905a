#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "common/base/program.h"
#include "common/base/range.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/worker/path_worker.h"
#include "common/library/scene_handle.h"

struct nl_engine {
  std::shared_ptr<const needlelab::LibraryModel> model;
  std::unique_ptr<needlelab::PathWorker> worker;  // null: paths are found in the tick
  needlelab::SceneEngine engine;
  needlelab::StepReport report;
};

struct nl_gate {
  needlelab::ForceGate gate;
};

namespace needlelab {
namespace {

// of flags, phases and limbs: C has the same numbers
constexpr bool same(std::initializer_list<std::pair<int, StepFlag>> flags) {
  return std::all_of(flags.begin(), flags.end(),
                     [](const auto& one) { return one.first == static_cast<int>(one.second); });
}
static_assert(same({{NL_ENTRY, kFlagEntry},
                    {NL_EXIT, kFlagExit},
                    {NL_LAYER_CHANGE, kFlagLayerChange},
                    {NL_RUPTURE, kFlagRupture},
                    {NL_TURN, kFlagTurn},
                    {NL_CLAMP_CAPPED, kFlagClampCapped},
                    {NL_FORCE_CAPPED, kFlagForceCapped},
                    {NL_NOT_STEPPED, kFlagNotStepped},
                    {NL_STARTED_INSIDE, kFlagStartedInside},
                    {NL_BEYOND_NEEDLE, kFlagBeyondNeedle},
                    {NL_CAPPED, kFlagCapped}}));
static_assert(NL_FREE == static_cast<int>(Phase::kFree) &&
              NL_INSERTING == static_cast<int>(Phase::kInserting) &&
              NL_STOPPED == static_cast<int>(Phase::kStopped) &&
              NL_WITHDRAWING == static_cast<int>(Phase::kWithdrawing));

/// The part that the caller knows; the rest is 0.
template <typename T>
T knownPart(const T& given) {
  T whole{};
  std::memcpy(&whole, &given, std::min<std::size_t>(given.size, sizeof whole));
  return whole;
}

void put(Vec3 v, double out[3]) {
  out[0] = v.x, out[1] = v.y, out[2] = v.z;
}
void put(const Wrench& wrench, nl_wrench& out) {
  put(wrench.force_N, out.force_n);
  put(wrench.torque_Nm, out.torque_nm);
}
void put(const Pose& pose, nl_pose& out) {
  put(pose.p, out.p_m);
  out.q[0] = pose.q.x, out.q[1] = pose.q.y, out.q[2] = pose.q.z, out.q[3] = pose.q.w;
}
Wrench wrenchOf(const nl_wrench& wrench) {
  return {vec3Of(wrench.force_n), vec3Of(wrench.torque_nm)};
}
TipSample tipOf(const nl_pose& pose) {
  const Pose X_WT = poseOf(pose);
  return {X_WT.p, X_WT.q};
}

nl_report reportOf(const StepReport& report) {
  nl_report out{};
  out.flags = report.flags;
  out.layer = report.layer;
  out.phase = static_cast<std::int32_t>(report.phase);
  put(report.wrench_W, out.wrench);
  put(report.p_wall_W_m, out.wall_m);
  out.depth_m = report.depth_m;
  out.insertion_m = report.insertion_m;
  out.lateral_error_m = report.lateral_error_m;
  out.speed_m_s = report.speed_mps;
  out.cutting_n = report.cutting_N;
  out.attracted_n = report.attracted_N;
  out.friction_n = report.friction_N;
  out.puncture_n = report.puncture_N;
  out.clamping_n = report.clamping_N;
  out.hub_n = effectEntry(Effect::kHub).value(report);
  out.bone_n = effectEntry(Effect::kBone).value(report);
  out.palpation_n = effectEntry(Effect::kPalpation).value(report);
  return out;
}

/// Writes as much of it as the caller knows.
void putReport(const StepReport& report, nl_report* out, std::size_t size) {
  nl_report whole = reportOf(report);
  whole.size = static_cast<std::uint32_t>(size);
  std::memcpy(static_cast<void*>(out), &whole, std::min(size, sizeof whole));
}

Result<Limb> limbOf(const nl_scene_def& def) {
  switch (def.limb) {
    case NL_PLANE:
      return Limb(PlaneLimb{vec3Of(def.a_m), vec3Of(def.b_m)});
    case NL_SPHERE:
      return Limb(SphereLimb{vec3Of(def.a_m), def.radius_m});
    case NL_CAPSULE:
      return Limb(CapsuleLimb{vec3Of(def.a_m), vec3Of(def.b_m), def.radius_m});
  }
  return Error{ErrorCode::kInvalidInput,
               "limb: is " + std::to_string(def.limb) + ", allowed are NL_PLANE, NL_SPHERE, NL_CAPSULE"};
}

LayerSpec layerOf(const nl_layer& layer) {
  LayerSpec spec;
  spec.thickness_m = layer.thickness_m;
  spec.cutting_force_N = layer.cutting_force_n;
  spec.attracted_force_N = layer.attracted_force_n;
  spec.rejection_force_N = layer.rejection_force_n;
  spec.lateral_stiffness_N_per_m2 = layer.lateral_n_per_m2;
  spec.friction_N_per_m = layer.friction_n_per_m;
  if (layer.wall_stiffness_n_per_m != 0) spec.wall_stiffness_N_per_m = layer.wall_stiffness_n_per_m;
  const MembraneSpec membrane{layer.membrane_n_per_m, layer.membrane_n_per_m2, layer.membrane_force_n};
  if (membrane.linear_N_per_m != 0 || membrane.quadratic_N_per_m2 != 0 || membrane.force_N != 0)
    spec.membrane = membrane;
  return spec;
}

Result<SceneSpec> specOf(const nl_scene_def& def) {
  const auto refused = [](const char* field, const char* name) {
    return Error{ErrorCode::kInvalidInput, std::string(field) + ": there is no '" + name + "'"};
  };
  SceneSpec spec;
  ASSIGN_OR_RETURN(spec.limb, limbOf(def));
  const auto* layer = reinterpret_cast<const char*>(def.layers);
  for (std::uint32_t i = 0; i < def.layer_count; ++i) {
    const auto& one = *reinterpret_cast<const nl_layer*>(layer);
    if (one.size == 0)
      return Error{ErrorCode::kInvalidInput,
                   "layers[" + std::to_string(i) + "].size: is 0; begin with nl_default_layer()"};
    spec.layers.push_back(layerOf(knownPart(one)));
    layer += one.size;  // as the caller's compiler laid them out
  }
  if (def.axial_model != nullptr) {
    const auto found = std::find(kAxialModelNames.begin(), kAxialModelNames.end(), def.axial_model);
    if (found == kAxialModelNames.end()) return refused("axial_model", def.axial_model);
    spec.axial_model = static_cast<AxialModel>(found - kAxialModelNames.begin());
  }
  for (std::uint32_t i = 0; i < def.effect_count; ++i) {
    const auto entries = effectEntries();
    const auto found = std::find_if(entries.begin(), entries.end(),
                                    [&](const EffectEntry* entry) { return entry->name == def.effects[i]; });
    if (found == entries.end()) return refused("effects", def.effects[i]);
    spec.effects |= bitOf((*found)->effect);
  }
  spec.needle_length_m = def.needle_length_m;
  spec.tracking_wall.stiffness_N_per_m = def.wall_stiffness_n_per_m;
  spec.tracking_wall.stop_speed_mps = def.stop_speed_m_s;
  spec.virtual_fixture.max_stiffness_N_per_m = def.clamping_stiffness_n_per_m;
  spec.virtual_fixture.max_force_N = def.clamping_force_n;
  spec.orientation_limit = {def.tilt_stiffness_nm_per_rad, def.tilt_torque_nm};
  spec.friction_stiffness_N_per_m = def.friction_stiffness_n_per_m;
  spec.max_force_N = def.max_force_n;
  return spec;
}

Result<std::unique_ptr<nl_scene>> sceneOf(SceneSpec spec, double rate_hz) {
  constexpr NumberRange kRates{kMinRateHz, kMaxRateHz};
  if (!kRates.contains(rate_hz)) return outOfRange("rate_hz", rate_hz, kRates);
  auto compiled = compile(spec, rate_hz);
  if (!compiled.ok()) return compiled.error();
  auto model = std::make_shared<LibraryModel>();
  static_cast<SceneModel&>(*model) = std::move(*compiled);
  return std::make_unique<nl_scene>(nl_scene{std::make_shared<SceneSpec>(std::move(spec)), std::move(model)});
}

Result<std::unique_ptr<nl_engine>> engineOf(const nl_scene& scene, std::unique_ptr<PathWorker> worker) {
  PathMaker* const paths = worker.get();
  auto engine = std::make_unique<nl_engine>(
      nl_engine{scene.model, std::move(worker), SceneEngine(*scene.model, paths), {}});
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  engine->report.p_wall_W_m = {kNone, kNone, kNone};
  return engine;
}

}  // namespace

}  // namespace needlelab

using namespace needlelab;  // NOLINT(google-build-using-namespace): the functions below are C's

const char* nl_version(void) {
  static const std::string version = programVersion();
  return version.c_str();
}

nl_layer nl_default_layer(void) {
  nl_layer layer{};
  layer.size = sizeof layer;
  layer.thickness_m = 0.01;
  return layer;
}

nl_scene_def nl_default_scene_def(void) {
  const SceneSpec usual;
  nl_scene_def def{};
  def.size = sizeof def;
  def.b_m[2] = 1;
  def.axial_model = "ENHANCED_TRACKING_WALL";
  def.needle_length_m = usual.needle_length_m;
  def.wall_stiffness_n_per_m = usual.tracking_wall.stiffness_N_per_m;
  def.stop_speed_m_s = usual.tracking_wall.stop_speed_mps;
  def.clamping_stiffness_n_per_m = usual.virtual_fixture.max_stiffness_N_per_m;
  def.clamping_force_n = usual.virtual_fixture.max_force_N;
  def.friction_stiffness_n_per_m = usual.friction_stiffness_N_per_m;
  def.max_force_n = usual.max_force_N;
  return def;
}

nl_scene* nl_scene_create(const nl_scene_def* def, double rate_hz, char* error, size_t error_size) {
  return atBorder(error, error_size, [&]() -> Result<std::unique_ptr<nl_scene>> {
    ASSIGN_OR_RETURN(auto spec, specOf(knownPart(*def)));
    return sceneOf(std::move(spec), rate_hz);
  });
}

nl_scene* nl_private_scene_of_spec(const SceneSpec* spec, double rate_hz, char* error, size_t error_size) {
  return atBorder(error, error_size, [&] { return sceneOf(*spec, rate_hz); });
}

nl_scene* nl_scene_with_law(const nl_scene* scene, nl_law law, void* user, double steepest_n_per_m,
                            char* error, size_t error_size) {
  return atBorder(error, error_size, [&] { return sceneWithLaw(*scene, law, user, steepest_n_per_m); });
}

void nl_scene_destroy(nl_scene* scene) {
  delete scene;
}
double nl_scene_rate_hz(const nl_scene* scene) {
  return scene->model->rate_hz;
}
double nl_scene_needle_length_m(const nl_scene* scene) {
  return scene->model->needle_length_m;
}
double nl_scene_stiffness_n_per_m(const nl_scene* scene) {
  return scene->model->axialStiffness_N_per_m();
}
double nl_scene_depth_m(const nl_scene* scene, const double p_m[3]) {
  return signedDepth(scene->spec->limb, vec3Of(p_m));
}

nl_engine* nl_engine_create(const nl_scene* scene, char* error, size_t error_size) {
  return atBorder(error, error_size, [&] { return engineOf(*scene, nullptr); });
}

nl_engine* nl_engine_create_realtime(const nl_scene* scene, int priority, char* error, size_t error_size) {
  return atBorder(error, error_size, [&] {
    std::unique_ptr<PathWorker> worker;
    if (scene->model->body_spec)
      worker = std::make_unique<PathWorker>(*scene->model, [priority] {
        const sched_param parameters{priority};
        if (priority > 0) ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters);
      });
    return engineOf(*scene, std::move(worker));
  });
}

void nl_engine_destroy(nl_engine* engine) {
  delete engine;
}

void nl_step(nl_engine* engine, const nl_pose* tip, nl_wrench* wrench) {
  engine->engine.step(tipOf(*tip), engine->report);
  put(engine->report.wrench_W, *wrench);
}

void nl_get_report(const nl_engine* engine, nl_report* report) {
  putReport(engine->report, report, report->size);
}

void nl_want_cap(nl_engine* engine, int on) {
  engine->engine.wantCap(on != 0);
}
void nl_leave_tissue(nl_engine* engine) {
  engine->engine.leaveTissue();
}

void nl_run(nl_engine* engine, const double* poses, size_t count, double* forces, nl_report* reports,
            size_t report_size) {
  auto* out = reinterpret_cast<char*>(reports);
  for (size_t i = 0; i < count; ++i, poses += 7) {
    engine->engine.step({vec3Of(poses), {poses[3], poses[4], poses[5], poses[6]}}, engine->report);
    if (forces != nullptr) put(engine->report.wrench_W.force_N, forces + 3 * i);
    if (out != nullptr)
      putReport(engine->report, reinterpret_cast<nl_report*>(out + i * report_size), report_size);
  }
}

int nl_engine_copy(nl_engine* to, const nl_engine* from) {
  if (to->model != from->model || to->worker || from->worker) return 0;
  to->engine.continueFrom(from->engine);
  to->report = from->report;
  return 1;
}

int nl_engine_restart(nl_engine* engine) {
  if (engine->worker) return 0;
  engine->engine.restart();
  return 1;
}

uint64_t nl_engine_hash(const nl_engine* engine) {
  return hashOf(engine->engine.state());
}

nl_limits nl_default_limits(void) {
  const DeviceLimits usual;
  return {sizeof(nl_limits),    usual.peak_force_N,         usual.continuous_force_N,
          usual.peak_torque_Nm, usual.continuous_torque_Nm, usual.fault_speed_mps};
}

nl_gate* nl_gate_create(const nl_limits* limits, double rate_hz, char* error, size_t error_size) {
  return atBorder(error, error_size, [&]() -> Result<std::unique_ptr<nl_gate>> {
    constexpr NumberRange kRates{kMinRateHz, kMaxRateHz}, kLimit{0, 1000};
    if (!kRates.contains(rate_hz)) return outOfRange("rate_hz", rate_hz, kRates);
    const nl_limits known = knownPart(*limits);
    for (const auto& [name, value] : {std::pair{"peak_force_n", known.peak_force_n},
                                      {"continuous_force_n", known.continuous_force_n},
                                      {"peak_torque_nm", known.peak_torque_nm},
                                      {"continuous_torque_nm", known.continuous_torque_nm},
                                      {"fault_speed_m_s", known.fault_speed_m_s}})
      if (!kLimit.contains(value)) return outOfRange(name, value, kLimit);
    DeviceLimits own;
    own.peak_force_N = known.peak_force_n;
    own.continuous_force_N = known.continuous_force_n;
    own.peak_torque_Nm = known.peak_torque_nm;
    own.continuous_torque_Nm = known.continuous_torque_nm;
    own.fault_speed_mps = known.fault_speed_m_s;
    return std::make_unique<nl_gate>(nl_gate{ForceGate(own, rate_hz)});
  });
}

void nl_gate_destroy(nl_gate* gate) {
  delete gate;
}
void nl_gate_note_outside(nl_gate* gate, int outside) {
  gate->gate.noteOutside(outside != 0);
}
int nl_gate_admit(nl_gate* gate, const nl_pose* tip, int fresh, double speed_m_s, int64_t elapsed_ticks) {
  return gate->gate.admit(tipOf(*tip), fresh != 0, speed_m_s, elapsed_ticks) ? 1 : 0;
}
void nl_gate_apply(nl_gate* gate, const nl_wrench* wanted, nl_wrench* allowed) {
  put(gate->gate.guard(wrenchOf(*wanted)).wrench(), *allowed);
}
int nl_gate_fault(const nl_gate* gate) {
  return static_cast<int>(gate->gate.fault());
}
const char* nl_fault_text(int fault) {
  return faultText(static_cast<Fault>(fault));
}
void nl_gate_acknowledge(nl_gate* gate) {
  gate->gate.acknowledge();
}

void nl_tip_of_handle(const nl_pose* handle, const nl_pose* tip_in_handle, nl_pose* tip) {
  put(tipFromHandle(poseOf(*handle), poseOf(*tip_in_handle)), *tip);
}
void nl_wrench_at_handle(const nl_wrench* at_tip, const nl_pose* tip, const nl_pose* handle,
                         nl_wrench* at_handle) {
  put(wrenchAtHandle(wrenchOf(*at_tip), vec3Of(tip->p_m), vec3Of(handle->p_m)), *at_handle);
}
