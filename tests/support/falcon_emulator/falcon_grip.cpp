#include "tests/support/falcon_emulator/falcon_grip.h"

#include <algorithm>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/falcon/falcon_kinematics.h"

namespace needlelab::test {

void FalconGrip::advance(std::int64_t now_ns) {
  constexpr double kMass_kg = 0.25, kStiffness_N_per_m = 300, kDamping_Ns_per_m = 5;
  constexpr std::int64_t kStep_ns = 1'000'000, kLongest_ns = 200'000'000;
  if (now_ns - at_ns > kLongest_ns) at_ns = now_ns - kLongest_ns;
  while (at_ns < now_ns) {
    const std::int64_t step_ns = std::min(kStep_ns, now_ns - at_ns);
    at_ns += step_ns;
    const double h = 1e-9 * static_cast<double>(step_ns);
    const Vec3 aim = path_(1e-9 * static_cast<double>(at_ns - since_ns_));
    if (!is_soft) {
      p_m = aim;
      v_mps = {};
      continue;
    }
    const Vec3 push = force_N() + (aim - p_m) * kStiffness_N_per_m;
    v_mps = (v_mps * kMass_kg + push * h) * (1 / (kMass_kg + h * kDamping_Ns_per_m));
    p_m = p_m + v_mps * h;
  }
}

Motors FalconGrip::encoders() const {
  const falcon::Legs legs = falcon::inverseKinematics(falcon::pointToF(p_m));
  return {falcon::countsOfTheta(legs.theta_rad[0]), falcon::countsOfTheta(legs.theta_rad[1]),
          falcon::countsOfTheta(legs.theta_rad[2])};
}

Vec3 FalconGrip::force_N() const {
  const Vec3 p_F_m = falcon::pointToF(p_m);
  const falcon::LegJacobian legs = falcon::legJacobian(p_F_m, falcon::inverseKinematics(p_F_m).theta_rad);
  Vec3 force_F_N;
  for (std::size_t i = 0; i < 3; ++i)
    if (motors[i] != 0)
      force_F_N += legs.n[i] * (falcon::kMotorSign * motors[i] * falcon::kMotorNm_per_unit *
                                falcon::kGearRatio / legs.m[i]);
  return falcon::vectorToW(force_F_N);
}

}  // namespace needlelab::test
