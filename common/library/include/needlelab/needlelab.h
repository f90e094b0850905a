/// Profiles of patients, recordings and scores: libneedlelab.so.1, beside needlelab/haptics.h, whose rules
/// for errors, units and structs hold here, too. Nothing here is for a haptic thread.
#ifndef NEEDLELAB_NEEDLELAB_H
#define NEEDLELAB_NEEDLELAB_H

#include <needlelab/haptics.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct nl_profile nl_profile;      ///< of one thread at a time
typedef struct nl_recording nl_recording;  ///< immutable
typedef struct nl_scores nl_scores;        ///< immutable
typedef struct nl_curves nl_curves;        ///< immutable

// ---- a patient's profile, as `needlelab-admin profile export` writes it

NL_API nl_profile* nl_profile_read(const char* path, char* error, size_t error_size);
/// `name` stands for the file's in messages.
NL_API nl_profile* nl_profile_parse(const char* json, size_t size, const char* name, char* error,
                                    size_t error_size);
NL_API void nl_profile_destroy(nl_profile* profile);
/// Another axial model, "DIRECT"; its section gets usual numbers if it has none. 0: error.
NL_API int nl_profile_set_model(nl_profile* profile, const char* model, char* error, size_t error_size);
/// The scene with the profile's frame at `placement` in W; null: at W's origin. FEM computes for about a
/// second.
NL_API nl_scene* nl_scene_of_profile(const nl_profile* profile, double rate_hz, const nl_pose* placement,
                                     char* error, size_t error_size);

// ---- recordings (FORMAT.md)

/// A tick, as it is recorded. Fixed: another layout would be .so.2.
typedef struct {
  uint64_t tick;
  int64_t time_ns;
  double p_m[3], q[4], speed_m_s;   ///< of the tip
  double force_n[3], torque_nm[3];  ///< on the hand, about the tip, after the gate
  double wall_m[3];                 ///< NaN: no wall
  double insertion_m, lateral_error_m, plunger;
  int32_t device_ns, engine_ns;
  uint32_t flags, buttons;
  int8_t layer;
  uint8_t phase, fault;
} nl_sample;

/// `damaged`: 0 refuses a recording with holes, 1 reads what is left of it.
NL_API nl_recording* nl_recording_read(const char* path, int damaged, char* error, size_t error_size);
NL_API void nl_recording_destroy(nl_recording* recording);
NL_API const nl_sample* nl_recording_samples(const nl_recording* recording,
                                             size_t* count);              ///< as long as it lives
NL_API double nl_recording_rate_hz(const nl_recording* recording);        ///< 0: not known
NL_API const char* nl_recording_metadata(const nl_recording* recording);  ///< JSON
NL_API size_t nl_recording_hole_count(const nl_recording* recording);
NL_API const char* nl_recording_hole(const nl_recording* recording, size_t index);

// ---- scores: the measures of `needlelab-sim score` and of the server

typedef struct {
  uint32_t size;
  int32_t passed;      ///< of a requirement: 1, 0; −1: none
  int32_t incomplete;  ///< 1: a hole in the recording may hide a part of it
  const char *name, *unit, *words;
  double value;  ///< NaN: nothing was measured
} nl_measure;

/// `exercise`: JSON with requirements, or null.
NL_API nl_scores* nl_score(const nl_sample* samples, size_t count, double rate_hz, const nl_profile* profile,
                           const nl_pose* placement, const char* exercise, char* error, size_t error_size);
NL_API void nl_scores_destroy(nl_scores* scores);
NL_API size_t nl_scores_count(const nl_scores* scores);
/// `measure->size` is set by the caller; texts live as long as the scores. 0: no such index.
NL_API int nl_scores_get(const nl_scores* scores, size_t index, nl_measure* measure);

// ---- force curves: a folder of tables of force over depth or time (FIT.md beside the Python module)

/// A curve: rows of the way in, then at rest, then out. Texts and arrays live as long as the curves.
typedef struct {
  uint32_t size;
  const char *name, *specimen, *needle, *tissue;
  double speed_m_s;   ///< of the way in
  double diameter_m;  ///< the needle's; 0: not known
  size_t count;       ///< of rows
  const double *depth_m, *force_n;
  const double* t_s;     ///< since the first row, at the mean speeds of the way in and out
  const uint8_t* phase;  ///< 0 in, 1 at rest, 2 out
} nl_curve;

/// `options`: JSON (`common/curves/curve_set.h`), {"tare": true}, or null.
NL_API nl_curves* nl_curves_read(const char* folder, const char* options, char* error, size_t error_size);
NL_API void nl_curves_destroy(nl_curves* curves);
NL_API size_t nl_curves_count(const nl_curves* curves);
/// `curve->size` is set by the caller. 0: no such index.
NL_API int nl_curves_get(const nl_curves* curves, size_t index, nl_curve* curve);
/// JSON: name, licence, source of the set; notes on what was left out or changed.
NL_API const char* nl_curves_metadata(const nl_curves* curves);

#ifdef __cplusplus
}
#endif

#endif
