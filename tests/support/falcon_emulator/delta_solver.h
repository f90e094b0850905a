/// The Falcon's mechanism solved by brute force: every joint angle an unknown, Newton's method on the
/// equations that close the legs' loops. It shares lengths and frame with the device's code
/// (falcon_geometry.h), no formula.
#pragma once

#include <Eigen/Core>
#include <array>

namespace needlelab::test {

/// Angles of one leg, all in rad: thigh against the base's plane, shin's direction in the leg's plane, shin's
/// inclination out of it (π/2: within it).
using LegAngles = Eigen::Vector3d;
using AllLegs = std::array<LegAngles, 3>;

/// How far leg `leg` is from being closed with the grip at `p_F_m`, in m: the foot that the angles give less
/// the foot that the grip has, in the leg's own axes.
Eigen::Vector3d loopError(std::size_t leg, const LegAngles& angles, const Eigen::Vector3d& p_F_m);

/// Angles of a leg with the grip at `p_F_m`, reached in small steps from the middle of the workspace so that
/// the branch is the mechanism's own. Throws std::runtime_error where the mechanism does not reach.
AllLegs anglesAt(const Eigen::Vector3d& p_F_m);
/// The same from a place nearby that is known already; `angles` go in and come out.
void follow(AllLegs& angles, const Eigen::Vector3d& p_F_m);

/// Where the grip is, in F, when the thighs stand at `thigh_rad`: nine unknowns, nine equations.
Eigen::Vector3d gripAt(const Eigen::Vector3d& thigh_rad);

/// ∂θ_i/∂p, row i of leg i, by the implicit-function theorem on `loopError`.
Eigen::Matrix3d thighRates(const AllLegs& angles);

/// The force at the grip that torques at the thighs make, by virtual work: f·δp = τ·δθ for every δp.
Eigen::Vector3d forceOf(const AllLegs& angles, const Eigen::Vector3d& thigh_torque_Nm);

}  // namespace needlelab::test
