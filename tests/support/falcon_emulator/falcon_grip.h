/// The grip of a Falcon and the hand that holds it, in W. Encoders and forces come from falcon_kinematics,
/// which has its own tests with independent equations.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "common/haptics/geometry.h"
#include "tests/support/falcon_emulator/falcon_board.h"

namespace needlelab::test {

/// Where the hand wants the grip, `t_s` after the path was set.
using HandPath = std::function<Vec3(double t_s)>;

struct FalconGrip {
  Vec3 p_m, v_mps;
  bool is_soft =
      true;         ///< a spring pulls it to the path; false: it follows exactly, regardless of the motors
  Motors motors{};  ///< they hold until the next command
  std::int64_t at_ns = 0;

  void follow(HandPath path) {
    path_ = std::move(path);
    since_ns_ = at_ns;
  }
  /// Simulates up to `now_ns`; of a longer gap only the last 0.2 s.
  void advance(std::int64_t now_ns);
  /// For encoders that know their zero.
  [[nodiscard]] Motors encoders() const;
  /// Of the motors on the hand.
  [[nodiscard]] Vec3 force_N() const;

 private:
  HandPath path_ = [](double) { return Vec3{}; };
  std::int64_t since_ns_ = 0;
};

}  // namespace needlelab::test
