/// The force engine and its gate, for a device loop of your own: libneedlelab-haptics.so.1, which needs the
/// C++ library only. Plain C, so that C, C++, Python, Julia and MATLAB load it. FORCE_MODEL.md has the rules.
///
/// SI units. Frame W: right-handed, any origin. Quaternions are unit, x y z w. The needle points along +z of
/// its tip's frame. Forces act on the hand. Functions marked [tick] do not lock, allocate, block or throw.
///
/// Errors: a function that can fail returns null or 0 and writes a message for people (field, value, range)
/// into `error`, cut to `error_size` bytes; `error` may be null. ABI: structs that begin with `size` only
/// grow at their end. Set it to sizeof, as nl_default_… does; the library neither reads nor writes beyond it.
/// Functions and enumerators are only added. Anything else: .so.2.
#ifndef NEEDLELAB_HAPTICS_H
#define NEEDLELAB_HAPTICS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define NL_API __attribute__((visibility("default")))

typedef struct nl_scene nl_scene;    ///< immutable; any number of threads and engines may use it
typedef struct nl_engine nl_engine;  ///< of one thread at a time
typedef struct nl_gate nl_gate;      ///< of one thread at a time

typedef struct {
  double p_m[3], q[4];
} nl_pose;
typedef struct {
  double force_n[3], torque_nm[3];
} nl_wrench;

/// The version of the library that is loaded, "1.0.0~git…".
NL_API const char* nl_version(void);

// ---- a scene from numbers. needlelab/needlelab.h makes one of a patient's profile, bodies included.

/// From the skin inwards; all in N and m. Zeros: the layer has none of it.
typedef struct {
  uint32_t size;
  double thickness_m;                                            ///< (0, 1]
  double cutting_force_n, attracted_force_n;                     ///< [0, 50]: on the way in, on the way out
  double rejection_force_n;                                      ///< at most the lesser of both
  double lateral_n_per_m2, friction_n_per_m;                     ///< per inserted length
  double wall_stiffness_n_per_m;                                 ///< 0: the scene's
  double membrane_n_per_m, membrane_n_per_m2, membrane_force_n;  ///< on its top; ruptures at that force
} nl_layer;

typedef enum { NL_PLANE = 0, NL_SPHERE = 1, NL_CAPSULE = 2 } nl_limb;

typedef struct {
  uint32_t size;
  nl_limb limb;
  double a_m[3],
      b_m[3];  ///< plane: point, normal out of the tissue; sphere: centre; capsule: ends of its axis
  double radius_m;
  const nl_layer* layers;
  uint32_t layer_count;        ///< 1 to 32
  const char* axial_model;     ///< "ENHANCED_TRACKING_WALL", "TRACKING_WALL", "DIRECT", "VOIGT", "GOD_OBJECT"
  const char* const* effects;  ///< "CUTTING", "ATTRACTED", "CLAMPING", …; others cost nothing
  uint32_t effect_count;
  double needle_length_m;
  double wall_stiffness_n_per_m, stop_speed_m_s;        ///< the tracking wall's
  double clamping_stiffness_n_per_m, clamping_force_n;  ///< the virtual fixture's greatest
  double tilt_stiffness_nm_per_rad, tilt_torque_nm;     ///< ORIENTATION_LIMIT
  double friction_stiffness_n_per_m;
  double max_force_n;  ///< caps the sum
} nl_scene_def;

NL_API nl_layer nl_default_layer(void);
/// A plane through W's origin with its normal along z, the tracking wall, no layers.
NL_API nl_scene_def nl_default_scene_def(void);
/// For a loop of `rate_hz`, 50 to 40,000. Copies all that it needs.
NL_API nl_scene* nl_scene_create(const nl_scene_def* def, double rate_hz, char* error, size_t error_size);
NL_API void nl_scene_destroy(nl_scene* scene);  ///< engines that use it keep what they need
NL_API double nl_scene_rate_hz(const nl_scene* scene);
NL_API double nl_scene_needle_length_m(const nl_scene* scene);
/// The greatest stiffness along the needle: what a device must hold (FORCE_MODEL.md, "Stiffnesses").
NL_API double nl_scene_stiffness_n_per_m(const nl_scene* scene);
/// How deep a point is under the skin; negative outside.
NL_API double nl_scene_depth_m(const nl_scene* scene, const double p_m[3]);

// ---- a law of your own along the needle, instead of the scene's axial model

typedef struct {
  double x_m;          ///< along the trajectory, from the entry
  double speed_m_s;    ///< of x, over 100 ms
  double depth_m;      ///< under the skin
  double insertion_m;  ///< inserted length
  int32_t layer;
} nl_law_input;
/// The force in N: negative resists the way in, positive the way out. Called in ticks in the tissue, so keep
/// the rules of [tick] for a real-time loop. What it must remember is behind `user`.
typedef double (*nl_law)(const nl_law_input* input, void* user);
/// `steepest_n_per_m`: the law's greatest slope over x. Scenes of layers only, no bodies.
NL_API nl_scene* nl_scene_with_law(const nl_scene* scene, nl_law law, void* user, double steepest_n_per_m,
                                   char* error, size_t error_size);

// ---- the engine

enum {  ///< flags of a tick
  NL_ENTRY = 1 << 0,
  NL_EXIT = 1 << 1,
  NL_LAYER_CHANGE = 1 << 2,
  NL_RUPTURE = 1 << 3,
  NL_TURN = 1 << 4,
  NL_CLAMP_CAPPED = 1 << 5,
  NL_FORCE_CAPPED = 1 << 6,
  NL_NOT_STEPPED = 1 << 8,     ///< the pose was not finite: no force, state as before
  NL_STARTED_INSIDE = 1 << 9,  ///< no force until the tip was outside once
  NL_BEYOND_NEEDLE = 1 << 10,
  NL_CAPPED = 1 << 14
};
typedef enum { NL_FREE = 0, NL_INSERTING = 1, NL_STOPPED = 2, NL_WITHDRAWING = 3 } nl_phase;

typedef struct {
  uint32_t size, flags;
  int32_t layer, phase;  ///< layer −1 outside; in a body the structure's index
  nl_wrench wrench;      ///< force, and torque about the tip, before the gate
  double wall_m[3];      ///< NaN: no wall
  double depth_m, insertion_m, lateral_error_m, speed_m_s;
  double cutting_n, attracted_n, friction_n, puncture_n;  ///< along the needle, signed
  double clamping_n, hub_n, bone_n, palpation_n;          ///< magnitudes
} nl_report;

/// In a body, finds the paths in the tick that asks for them: for work that is not in real time.
NL_API nl_engine* nl_engine_create(const nl_scene* scene, char* error, size_t error_size);
/// In a body, finds the paths on a thread of its own with this SCHED_FIFO priority (0, or not permitted:
/// ordinary). Same forces as nl_engine_create while the thread keeps up with the loop.
NL_API nl_engine* nl_engine_create_realtime(const nl_scene* scene, int priority, char* error,
                                            size_t error_size);
NL_API void nl_engine_destroy(nl_engine* engine);
/// One tick. `wrench` is before the gate.
NL_API void nl_step(nl_engine* engine, const nl_pose* tip, nl_wrench* wrench);  ///< [tick]
/// Of the last tick. `report->size` is set by the caller.
NL_API void nl_get_report(const nl_engine* engine, nl_report* report);  ///< [tick]
/// Puts the needle's cap on or takes it off, in a scene with PALPATION, once the tip is clear of the skin.
NL_API void nl_want_cap(nl_engine* engine, int on);  ///< [tick]
/// Ends an insertion without a tick, after a fault: no force until the tip was outside.
NL_API void nl_leave_tissue(nl_engine* engine);  ///< [tick]
/// The same bits as `count` calls of nl_step. `poses`: rows of seven doubles, p_m then q. `forces`: rows of
/// three, or null. `reports`: null, or `count` reports, each `report_size` bytes.
NL_API void nl_run(nl_engine* engine, const double* poses, size_t count, double* forces, nl_report* reports,
                   size_t report_size);
/// Snapshots: `to` continues as `from` would. Both are of one scene and from nl_engine_create; 0 otherwise.
NL_API int nl_engine_copy(nl_engine* to, const nl_engine* from);
/// As before the first tick; only after nl_engine_create, 0 otherwise.
NL_API int nl_engine_restart(nl_engine* engine);
NL_API uint64_t nl_engine_hash(const nl_engine* engine);  ///< equal states have equal hashes

// ---- the gate between the engine and a motor (FORCE_MODEL.md, "Gate")

typedef struct {
  uint32_t size;
  double peak_force_n, continuous_force_n, peak_torque_nm, continuous_torque_nm;
  double fault_speed_m_s;
} nl_limits;

NL_API nl_limits nl_default_limits(void);
NL_API nl_gate* nl_gate_create(const nl_limits* limits, double rate_hz, char* error, size_t error_size);
NL_API void nl_gate_destroy(nl_gate* gate);
/// In a fault, before nl_gate_admit: whether the tip is outside the tissue.
NL_API void nl_gate_note_outside(nl_gate* gate, int outside);  ///< [tick]
/// Checks a pose before the engine. `fresh`: the device gave a new one. `speed_m_s`: the device's own, or 0.
/// `elapsed_ticks`: 1, or more after missed ticks. 0: do not step.
NL_API int nl_gate_admit(nl_gate* gate, const nl_pose* tip, int fresh, double speed_m_s,
                         int64_t elapsed_ticks);  ///< [tick]
/// What the motors may do: in every tick, also where nl_gate_admit returned 0.
NL_API void nl_gate_apply(nl_gate* gate, const nl_wrench* wanted, nl_wrench* allowed);  ///< [tick]
NL_API int nl_gate_fault(const nl_gate* gate);                                          ///< [tick] 0: none
NL_API const char* nl_fault_text(int fault);
NL_API void nl_gate_acknowledge(nl_gate* gate);  ///< [tick] by a person, once the cause is over

// ---- a tool on a handle

NL_API void nl_tip_of_handle(const nl_pose* handle, const nl_pose* tip_in_handle, nl_pose* tip);  ///< [tick]
/// The same wrench about the handle.
NL_API void nl_wrench_at_handle(const nl_wrench* at_tip, const nl_pose* tip, const nl_pose* handle,
                                nl_wrench* at_handle);  ///< [tick]

#ifdef __cplusplus
}
#endif

#endif
