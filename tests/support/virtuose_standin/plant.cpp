#include "tests/support/virtuose_standin/plant.h"

namespace standin {
namespace {

constexpr double kMass_kg = 0.35, kDamping = 1.7;
constexpr double kInertia_kgm2 = 1e-3, kTurnDamping = 0.01;
constexpr double kHandStiffness = 300, kHandDamping = 3;
constexpr double kHandTurnStiffness = 2, kHandTurnDamping = 0.05;
constexpr int kSubsteps = 20;

// rotation vector of a small turn from a to b
Vec3 between(Quat a, Quat b) {
  const Quat d = b * conjugate(a);
  const double sign = d.w < 0 ? -2 : 2;
  return {sign * d.x, sign * d.y, sign * d.z};
}

Quat mixed(Quat a, Quat b, double share) {
  const double sign = dot(a, b) < 0 ? -1 : 1;
  const double rest = (1 - share) * sign;
  return normalized(Quat{rest * a.x + share * b.x, rest * a.y + share * b.y, rest * a.z + share * b.z,
                         rest * a.w + share * b.w});
}

}  // namespace

void Plant::place(const Pose& pose) {
  pose_ = aim_ = from_ = to_ = pose;
  v_ = w_ = {};
  way_s_ = gone_s_ = 0;
}

void Plant::aimAt(const Pose& pose, double seconds) {
  from_ = aim_;
  to_ = pose;
  way_s_ = seconds;
  gone_s_ = 0;
}

void Plant::millisecond(Vec3 force_N, Vec3 torque_Nm) {
  for (int i = 0; i < kSubsteps; ++i) substep(1e-3 / kSubsteps, force_N, torque_Nm);
}

void Plant::substep(double dt, Vec3 force_N, Vec3 torque_Nm) {
  const Pose before = aim_;
  const double share = gone_s_ < way_s_ ? gone_s_ / way_s_ : 1;
  gone_s_ += dt;
  aim_ = {from_.p + (to_.p - from_.p) * share, mixed(from_.q, to_.q, share)};

  Vec3 force = force_N - v_ * kDamping, torque = torque_Nm - w_ * kTurnDamping;
  if (holds_) {
    force += (aim_.p - pose_.p) * kHandStiffness + ((aim_.p - before.p) / dt - v_) * kHandDamping;
    torque += between(pose_.q, aim_.q) * kHandTurnStiffness +
              (between(before.q, aim_.q) / dt - w_) * kHandTurnDamping;
  }
  v_ += force * (dt / kMass_kg);
  w_ += torque * (dt / kInertia_kgm2);
  pose_.p += v_ * dt;
  const Vec3 half = w_ * (dt / 2);
  pose_.q = normalized(Quat{half.x, half.y, half.z, 1} * pose_.q);
}

}  // namespace standin
