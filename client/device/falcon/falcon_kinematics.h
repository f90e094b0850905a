/// Kinematics of the Falcon's delta (geometry, frame F and the legs' equation: falcon_geometry.h).
///
/// Inverse kinematics and the Jacobian are closed forms; forward kinematics starts at the intersection of
/// three spheres around the knees (exact except for the short links) and refines it by Newton's method. The
/// result depends only on the angles, never on an earlier position, and uses no library trigonometry: same
/// encoders, same bits. Real-time safe; never NaN: an unreachable position is replaced by a reachable one and
/// flagged.
#pragma once

#include <array>
#include <cstdint>

#include "common/haptics/geometry.h"

namespace needlelab::falcon {

using LegAngles = std::array<double, 3>;  ///< θ_i in rad

/// Corrections made to a result. 0: none.
enum KinematicFlag : std::uint8_t {
  kBeyondStop = 1u << 0,  ///< an angle was outside [kThetaMin_rad, kThetaMax_rad] and was clamped
  kOutOfReach =
      1u << 1,  ///< no position fits: legs too short, or too far to the side; the nearest one is used
  kNearSingular = 1u << 2,    ///< the legs cannot bear this force: its torques fade to zero
  kTorqueLimited = 1u << 3,   ///< beyond a motor's limit: all three are scaled down, keeping the direction
  kInputNotFinite = 1u << 4,  ///< NaN or infinity in the input; the result is the middle, or zero
};

struct Place {
  Vec3 p_F_m;  ///< the grip in F
  std::uint8_t flags = 0;
};
Place forwardKinematics(const LegAngles& theta_rad) noexcept;

struct Legs {
  LegAngles theta_rad{};
  std::uint8_t flags = 0;
};
Legs inverseKinematics(Vec3 p_F_m) noexcept;

/// Relates changes of the legs' angles and the grip's position: n_i · dp = m_i dθ_i. This is the leg's
/// equation differentiated: n_i is along the shin, m_i is the lever of a thigh on it (both in m², up to a
/// common factor).
struct LegJacobian {
  std::array<Vec3, 3> n;
  std::array<double, 3> m{};
  /// n_0 · (n_2 × n_1) of unit n (the legs run clockwise, seen by the user): 0 where the shins lie in a plane
  /// and cannot hold the grip; negative beyond such a position, which the device cannot reach.
  [[nodiscard]] double spread() const noexcept;
};
LegJacobian legJacobian(Vec3 p_F_m, const LegAngles& theta_rad) noexcept;

/// Returns the columns ∂p/∂θ_i of the Jacobian. Meaningful where spread() is not small.
std::array<Vec3, 3> placePerAngle(const LegJacobian& legs) noexcept;

struct Torques {
  std::array<double, 3> thigh_Nm{};  ///< positive raises θ
  std::uint8_t flags = 0;
};
/// Returns the torques at the thighs that exert `f_F_N` on the hand: τ = Jᵀ f (virtual work: Σ τ_i dθ_i = f ·
/// dp).
Torques torquesForForce(const LegJacobian& legs, Vec3 f_F_N) noexcept;

struct MotorUnits {
  std::array<std::int16_t, 3> value{};
  std::uint8_t flags = 0;
};
MotorUnits motorUnits(const Torques& torques) noexcept;

/// θ of a homed encoder.
double thetaOfCounts(std::int32_t counts) noexcept;
/// Returns the nearest count, clamped to an int16.
std::int16_t countsOfTheta(double theta_rad) noexcept;
LegAngles anglesOfEncoders(const std::array<std::int16_t, 3>& encoder) noexcept;

}  // namespace needlelab::falcon
