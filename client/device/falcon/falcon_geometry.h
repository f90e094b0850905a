/// The Novint Falcon as data: lengths, angles, encoders, motors, packet bits, limits, each with its source.
/// Kinematics (falcon_kinematics.h) and its tests' own equations share only this file.
///
/// Sources. [MH] Martin and Hillier, Characterisation of the Novint Falcon haptic device for application as a
/// robot manipulator, ACRA 2009 (values as cited in public code; we did not have the paper itself). [TS]
/// Tsai, Robot Analysis, 1999, and Stamper, A three degree of freedom parallel manipulator with only
/// translational degrees of freedom, thesis PhD 97-4, Maryland 1997: the mechanism. [LN] documentation of the
/// libnifalcon project, 2007-2010. [ND] Novint's own data sheet. [A] an assumption of ours.
///
/// Device frame F: origin in the middle of the base; x to the user's right, y up, z out of the base toward
/// the user. The grip G only translates. Leg i has its own axes: u_i = (cos φ_i, sin φ_i, 0) outward, v_i =
/// (−sin φ_i, cos φ_i, 0), w = z.
///
///   p_u = p·u_i,  p_v = p·v_i − kFootAside_m,  p_w = p·z                    (p = p_FG_m, the grip in F)
///   knee:  u = kBaseRadius_m − kPlatformRadius_m + a cos θ_i,   w = a sin θ_i
///   shin:  (p_u − u_knee)² + (p_w − w_knee)² = (d + e + √(b² − p_v²))²
///
/// a thigh, b long side of the shin's parallelogram, d and e the two short links in line with it: θ_i = 0 is
/// a thigh in the base's plane pointing outward, θ_i = π/2 one that points to the user. Two θ_i fit a
/// position; the device uses the one with the knee bent outward: θ_i = atan2(p_w, p_u − r + c) − acos(…).
/// Near its stops a leg may lock; forward kinematics chooses the grip in front of the knees (largest p_w).
#pragma once

#include <array>
#include <cstdint>
#include <numbers>

#include "common/base/units.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/geometry.h"

namespace needlelab::falcon {

inline constexpr std::uint16_t kUsbVendor = 0x0403;   ///< FTDI
inline constexpr std::uint16_t kUsbProduct = 0xcb48;  ///< FTDI's number for the Falcon

// the mechanism: [MH]
inline constexpr double kThigh_m = 0.060;            ///< a
inline constexpr double kShin_m = 0.1025;            ///< b
inline constexpr double kShortLinks_m = 2 * 0.0115;  ///< d + e
inline constexpr double kBaseRadius_m = 0.0366;      ///< r: from the middle of the base to a thigh's axis
inline constexpr double kPlatformRadius_m = 0.0157;  ///< c: from the middle of the grip's plate to a shin
/// s − f: 27.2 mm less 26.2 mm; a leg's plane passes the middle at this distance. Its sign is [A].
inline constexpr double kFootAside_m = 0.0010;

/// φ_i, leg 0 nearly on top, 1 on the user's right, 2 on the left below: [MH] 15°, 255°, 135° from the upward
/// axis's view, [LN] 105°, −15°, −135° from x. All legs are turned by 15° ([LN]).
inline constexpr std::array<double, 3> kLegAngle_rad = {radOf(105), radOf(-15), radOf(-135)};

// encoders: on the motors' shafts
inline constexpr int kEncoderSlots = 320;                 ///< FACTS, [MH], [LN]
inline constexpr int kCountsPerTurn = 4 * kEncoderSlots;  ///< quadrature
inline constexpr double kGearRatio = 7.62;                ///< motor turns per turn of a thigh: [MH]
/// θ = kThetaAtZero_rad + counts / kCountsPerRad, both growing together.
inline constexpr double kCountsPerRad = kCountsPerTurn * kGearRatio / (2 * std::numbers::pi);
/// θ where a homed encoder reads 0. [LN] 35°, [MH] 50°, a user of both measured 40°: we use 40°, and ±10° of
/// it is [A]. That moves the origin along z by about 5 mm and changes lengths by a few per cent.
inline constexpr double kThetaAtZero_rad = radOf(40);
/// A thigh's stops, slightly outside the range in [MH] (±1600 counts, ±59°).
inline constexpr double kThetaMin_rad = kThetaAtZero_rad - 1700 / kCountsPerRad;
inline constexpr double kThetaMax_rad = kThetaAtZero_rad + 1700 / kCountsPerRad;

// motors
inline constexpr int kMotorMax = 4095;  ///< greatest magnitude of a motor's int16: [LN]
/// Torque of a motor per unit at rest: [MH]. 4095 units are 0.62 N·m at a thigh, about 10 N at its end.
inline constexpr double kMotorNm_per_unit = 1.9835e-5;
/// A positive torque at a thigh, which raises θ, is a negative number to the motor: [MH], [LN].
inline constexpr double kMotorSign = -1;

/// Middle of the workspace in F, and origin of W: at pose 0 the grip is in the middle. [LN] gives z from 75
/// to 175 mm.
inline constexpr Vec3 kOrigin_F_m = {0, 0, 0.125};
/// Half an edge of the maker's specified cube, 4 inches wide: [ND].
inline constexpr double kWorkspaceHalf_m = 0.0508;

/// W from F (ARCHITECTURE.md, "Frames and units": X toward the user, Y to the user's right, Z up): a
/// permutation of the axes.
constexpr Vec3 vectorToW(Vec3 v_F) {
  return {v_F.z, v_F.x, v_F.y};
}
constexpr Vec3 vectorToF(Vec3 v_W) {
  return {v_W.y, v_W.z, v_W.x};
}
constexpr Vec3 pointToW(Vec3 p_F_m) {
  return vectorToW(p_F_m - kOrigin_F_m);
}
constexpr Vec3 pointToF(Vec3 p_W_m) {
  return vectorToF(p_W_m) + kOrigin_F_m;
}

// byte 13, less 0x41: FACTS, bits from [LN]
inline constexpr std::uint8_t kOutHome = 0x01;  ///< to the device: look for zero when a thigh passes its mark
inline constexpr std::uint8_t kOutGreen = 0x02, kOutBlue = 0x04, kOutRed = 0x08;  ///< its lights
inline constexpr std::uint8_t kInButtons = 0x0F;  ///< from the device: bit i, button i of the grip
inline constexpr std::uint8_t kInHomed = 0x70;  ///< from the device: bit 4 + i, encoder i has found its zero

/// [ND] peak 2 lbf = 8.9 N; no torque at all. The rest is [A]: continuous force is 0.3 of the peak as for the
/// Virtuose, stiffness is the limit without chatter for its friction at 1 kHz, mass and damping are as a hand
/// feels them. The device has no speed fault of its own: 2 m/s is beyond normal hand motion.
inline constexpr DeviceLimits kLimits = {
    .peak_force_N = 8.9,
    .continuous_force_N = 2.7,
    .peak_torque_Nm = 0,
    .continuous_torque_Nm = 0,
    .max_stiffness_N_per_m = 1000,
    .max_rotational_stiffness_Nm_per_rad = 0,
    .fault_speed_mps = 2.0,
    .apparent_mass_kg = 0.25,
    .damping_Ns_per_m = 1.0,
};
inline constexpr double kMaxRate_hz = 1000;

}  // namespace needlelab::falcon
