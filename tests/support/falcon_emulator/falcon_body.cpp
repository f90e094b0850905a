#include "tests/support/falcon_emulator/falcon_body.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/device/falcon/falcon_geometry.h"

namespace needlelab::test {
namespace {

constexpr double kStep_s = 200e-6;

double secondsBetween(TimePoint from, TimePoint to) {
  return std::chrono::duration<double>(to - from).count();
}

}  // namespace

FalconBody::FalconBody()
    : p_(falcon::kOrigin_F_m.x, falcon::kOrigin_F_m.y, falcon::kOrigin_F_m.z), v_(Eigen::Vector3d::Zero()) {
  angles_ = anglesAt(p_);
  path_ = [p = p_](double) { return p; };
  resetEncoders();
}

void FalconBody::holdRigidly(HandPath path, TimePoint now) {
  advance(now);
  soft_ = false;
  path_ = std::move(path);
  told_ = now;
  moveTo(path_(0));
}

void FalconBody::holdSoftly(const SoftHand& hand, HandPath path, TimePoint now) {
  advance(now);
  soft_ = true;
  hand_ = hand;
  path_ = std::move(path);
  told_ = now;
}

void FalconBody::resetEncoders() {
  homed_ = 0;
  for (std::size_t leg = 0; leg < 3; ++leg) counted_from_rad_[leg] = angles_[leg][0];
}

// while the encoder searches its zero, it counts from the position where the thigh passes the mark
void FalconBody::moveTo(const Eigen::Vector3d& p) {
  // an instant jump of the hand would miss the mark, so move in small steps
  const Eigen::Vector3d from = p_;
  const int steps = 1 + static_cast<int>((p - from).norm() / 0.002);
  for (int i = 1; i <= steps; ++i) {
    const AllLegs before = angles_;
    p_ = from + (p - from) * (static_cast<double>(i) / steps);
    follow(angles_, p_);
    for (std::size_t leg = 0; leg < 3; ++leg) {
      const bool was_above = before[leg][0] > falcon::kThetaAtZero_rad;
      const bool is_above = angles_[leg][0] > falcon::kThetaAtZero_rad;
      if (!looking_ || was_above == is_above || (homed_ >> leg & 1u) != 0) continue;
      homed_ |= 1u << leg;
      counted_from_rad_[leg] = falcon::kThetaAtZero_rad;
    }
  }
}

Eigen::Vector3d FalconBody::torques() const {
  Eigen::Vector3d torque;
  for (std::size_t leg = 0; leg < 3; ++leg) {
    const int units = std::clamp<int>(motors_[leg], -falcon::kMotorMax, falcon::kMotorMax);
    torque[static_cast<Eigen::Index>(leg)] =
        falcon::kMotorSign * units * falcon::kMotorNm_per_unit * falcon::kGearRatio;
  }
  return torque;
}

Eigen::Vector3d FalconBody::force() const {
  return forceOf(angles_, torques());
}

Eigen::Vector3d FalconBody::thighs() const {
  return {angles_[0][0], angles_[1][0], angles_[2][0]};
}

std::array<std::int16_t, 3> FalconBody::encoders() const {
  std::array<std::int16_t, 3> counts{};
  for (std::size_t leg = 0; leg < 3; ++leg)
    counts[leg] = static_cast<std::int16_t>(
        std::lround((angles_[leg][0] - counted_from_rad_[leg]) * falcon::kCountsPerRad));
  return counts;
}

void FalconBody::advance(TimePoint now) {
  if (now_ == TimePoint{} || secondsBetween(now_, now) > 1) now_ = now;
  if (now <= now_) return;
  if (!soft_) {
    now_ = now;
    moveTo(path_(secondsBetween(told_, now)));
    return;
  }
  // implicit in the speed, so that it is stable for any stiffness of the hand
  while (now_ < now) {
    const double h = std::min(kStep_s, secondsBetween(now_, now));
    now_ += std::chrono::ceil<Clock::duration>(std::chrono::duration<double>(h));
    const double t = secondsBetween(told_, now_);
    const Eigen::Vector3d target = path_(t), target_v = (target - path_(t - h)) / h;
    const Eigen::Vector3d push =
        force() + hand_.stiffness_N_per_m * (target - p_) + hand_.damping_Ns_per_m * target_v;
    const double resist = hand_.mass_kg + h * (hand_.damping_Ns_per_m + h * hand_.stiffness_N_per_m);
    v_ = (hand_.mass_kg * v_ + h * push) / resist;
    moveTo(p_ + h * v_);
  }
}

}  // namespace needlelab::test
