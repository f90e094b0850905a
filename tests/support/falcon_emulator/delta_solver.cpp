#include "tests/support/falcon_emulator/delta_solver.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "client/device/falcon/falcon_geometry.h"

namespace needlelab::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// rows: the leg's own axes u, v, w in F
Matrix3d legAxes(std::size_t leg) {
  const double phi = falcon::kLegAngle_rad.at(leg);
  Matrix3d axes;
  axes << std::cos(phi), std::sin(phi), 0, -std::sin(phi), std::cos(phi), 0, 0, 0, 1;
  return axes;
}

// ∂(foot position)/∂(angles)
Matrix3d footRates(const LegAngles& angles) {
  const double c1 = std::cos(angles[0]), s1 = std::sin(angles[0]);
  const double c2 = std::cos(angles[1]), s2 = std::sin(angles[1]);
  const double c3 = std::cos(angles[2]), s3 = std::sin(angles[2]);
  const double reach = falcon::kShortLinks_m + falcon::kShin_m * s3;
  Matrix3d rates;
  rates << -falcon::kThigh_m * s1, -reach * s2, falcon::kShin_m * c3 * c2,  //
      0, 0, -falcon::kShin_m * s3,                                          //
      falcon::kThigh_m * c1, reach * c2, falcon::kShin_m * c3 * s2;
  return rates;
}

void closeLeg(std::size_t leg, LegAngles& angles, const Vector3d& p_F_m) {
  for (int iteration = 0; iteration < 50; ++iteration) {
    const Vector3d error = loopError(leg, angles, p_F_m);
    if (error.norm() < 1e-14) return;
    Vector3d step = footRates(angles).partialPivLu().solve(error);
    if (!step.allFinite()) break;
    // far from the solution a whole step may land on the other branch
    step *= std::min(1.0, 0.2 / std::max(step.norm(), 1e-12));
    angles -= step;
    if (step.norm() < 1e-13) return;
  }
  if (loopError(leg, angles, p_F_m).norm() > 1e-10)
    throw std::runtime_error("the emulated Falcon cannot reach there");
}

// thighs forward and outward, shins inward: the pose of the device on a table
AllLegs anglesInTheMiddle() {
  AllLegs angles;
  const Vector3d middle(falcon::kOrigin_F_m.x, falcon::kOrigin_F_m.y, falcon::kOrigin_F_m.z);
  for (std::size_t leg = 0; leg < 3; ++leg) {
    angles[leg] = {falcon::kThetaAtZero_rad, 2.0, std::numbers::pi / 2};
    closeLeg(leg, angles[leg], middle);
  }
  return angles;
}

}  // namespace

Vector3d loopError(std::size_t leg, const LegAngles& angles, const Vector3d& p_F_m) {
  // through the joints: hip, knee, the shin between its short links, foot
  const double in_plane = falcon::kShortLinks_m + falcon::kShin_m * std::sin(angles[2]);
  const Vector3d hip(falcon::kBaseRadius_m, 0, 0);
  const Vector3d thigh = falcon::kThigh_m * Vector3d(std::cos(angles[0]), 0, std::sin(angles[0]));
  const Vector3d shin(in_plane * std::cos(angles[1]), falcon::kShin_m * std::cos(angles[2]),
                      in_plane * std::sin(angles[1]));
  // through the grip, which only translates
  const Vector3d foot = legAxes(leg) * p_F_m + Vector3d(falcon::kPlatformRadius_m, -falcon::kFootAside_m, 0);
  return hip + thigh + shin - foot;
}

void follow(AllLegs& angles, const Vector3d& p_F_m) {
  for (std::size_t leg = 0; leg < 3; ++leg) closeLeg(leg, angles[leg], p_F_m);
}

AllLegs anglesAt(const Vector3d& p_F_m) {
  AllLegs angles = anglesInTheMiddle();
  const Vector3d middle(falcon::kOrigin_F_m.x, falcon::kOrigin_F_m.y, falcon::kOrigin_F_m.z);
  const int steps = 1 + static_cast<int>((p_F_m - middle).norm() / 0.005);
  for (int i = 1; i <= steps; ++i)
    follow(angles, middle + (p_F_m - middle) * (static_cast<double>(i) / steps));
  return angles;
}

Vector3d gripAt(const Vector3d& thigh_rad) {
  using Vector9d = Eigen::Matrix<double, 9, 1>;
  using Matrix9d = Eigen::Matrix<double, 9, 9>;
  AllLegs angles = anglesInTheMiddle();
  Vector3d p(falcon::kOrigin_F_m.x, falcon::kOrigin_F_m.y, falcon::kOrigin_F_m.z);
  const Vector3d from(angles[0][0], angles[1][0], angles[2][0]);
  // the thighs turn from the middle to the requested angles; the other joints follow
  const int steps = 1 + static_cast<int>((thigh_rad - from).norm() / 0.05);
  for (int i = 1; i <= steps; ++i) {
    const Vector3d now = from + (thigh_rad - from) * (static_cast<double>(i) / steps);
    double size = 1;
    for (int iteration = 0; iteration < 50 && size > 1e-14; ++iteration) {
      Vector9d error;
      Matrix9d rates = Matrix9d::Zero();
      for (std::size_t leg = 0; leg < 3; ++leg) {
        const Eigen::Index row = 3 * static_cast<Eigen::Index>(leg),
                           column = 3 + 2 * static_cast<Eigen::Index>(leg);
        angles[leg][0] = now[static_cast<Eigen::Index>(leg)];
        error.segment<3>(row) = loopError(leg, angles[leg], p);
        rates.block<3, 3>(row, 0) = -legAxes(leg);
        rates.block<3, 2>(row, column) = footRates(angles[leg]).rightCols<2>();
      }
      const Vector9d step = rates.partialPivLu().solve(error);
      p -= step.head<3>();
      for (std::size_t leg = 0; leg < 3; ++leg)
        angles[leg].tail<2>() -= step.segment<2>(3 + 2 * static_cast<Eigen::Index>(leg));
      size = step.norm();
    }
    if (!(size < 1e-10)) throw std::runtime_error("the emulated Falcon's thighs cannot stand like that");
  }
  return p;
}

Matrix3d thighRates(const AllLegs& angles) {
  // loopError(angles, p) = 0 along any motion: footRates·dangles = axes·dp
  Matrix3d rates;
  for (std::size_t leg = 0; leg < 3; ++leg) {
    const Matrix3d all = footRates(angles[leg]).partialPivLu().solve(legAxes(leg));
    rates.row(static_cast<Eigen::Index>(leg)) = all.row(0);
  }
  return rates;
}

Vector3d forceOf(const AllLegs& angles, const Vector3d& thigh_torque_Nm) {
  return thighRates(angles).transpose() * thigh_torque_Nm;
}

}  // namespace needlelab::test
