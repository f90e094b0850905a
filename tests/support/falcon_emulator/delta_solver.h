/// The Falcon's mechanism solved by brute force: every joint angle is an unknown, and Newton's method solves
/// the loop-closure equations of the legs. It shares lengths and frame with the device's code
/// (falcon_geometry.h), but no formula.
#pragma once

#include <Eigen/Core>
#include <array>

namespace needlelab::test {

/// Angles of one leg, all in rad: thigh against the base's plane, shin's direction in the leg's plane, shin's
/// inclination out of it (π/2: within it).
using LegAngles = Eigen::Vector3d;
using AllLegs = std::array<LegAngles, 3>;

/// The closure error of leg `leg` with the grip at `p_F_m`, in m: the foot by the angles minus the foot by
/// the grip, in the leg's own axes.
Eigen::Vector3d loopError(std::size_t leg, const LegAngles& angles, const Eigen::Vector3d& p_F_m);

/// Angles of a leg with the grip at `p_F_m`, reached in small steps from the middle of the workspace so that
/// the branch is the mechanism's own. Throws std::runtime_error where the mechanism does not reach.
AllLegs anglesAt(const Eigen::Vector3d& p_F_m);
/// The same, starting from the known angles of a nearby position; updates `angles`.
void follow(AllLegs& angles, const Eigen::Vector3d& p_F_m);

/// The grip's position in F for the thigh angles `thigh_rad`: nine unknowns, nine equations.
Eigen::Vector3d gripAt(const Eigen::Vector3d& thigh_rad);

/// ∂θ_i/∂p, row i of leg i, by the implicit-function theorem on `loopError`.
Eigen::Matrix3d thighRates(const AllLegs& angles);

/// The force at the grip produced by torques at the thighs, by virtual work: f·δp = τ·δθ for every δp.
Eigen::Vector3d forceOf(const AllLegs& angles, const Eigen::Vector3d& thigh_torque_Nm);

}  // namespace needlelab::test
