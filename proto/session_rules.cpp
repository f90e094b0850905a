#include "proto/session_rules.h"

#include <fmt/core.h>

#include <cmath>
#include <string>

#include "common/base/secret.h"
#include "common/base/text/text.h"
#include "common/base/text/uuid.h"

namespace needlelab {
namespace {

Error invalid(const std::string& field, const std::string& why) {
  return {ErrorCode::kInvalidInput, "session description, " + field + ": " + why};
}

/// Checks a pose: x y z qx qy qz qw, or empty.
Status checkPose(const std::string& field, const google::protobuf::RepeatedField<double>& pose) {
  if (pose.empty()) return {};
  if (pose.size() != 7) return invalid(field, fmt::format("has {} numbers, allowed are 0 or 7", pose.size()));
  for (const double number : pose) {
    if (!std::isfinite(number)) return invalid(field, "holds a number that is not finite");
  }
  double square = 0;
  for (int i = 3; i < 7; ++i) square += pose[i] * pose[i];
  if (std::abs(std::sqrt(square) - 1) > 1e-3) {
    return invalid(field,
                   fmt::format("its quaternion has length {:f}, allowed is 1 ± 0.001", std::sqrt(square)));
  }
  return {};
}

Status checkStep(const std::string& field, double step) {
  if (std::isfinite(step) && step >= 0 && step <= 1) return {};
  return invalid("resolution." + field, fmt::format("{:f}, allowed is 0 (lossless) to 1", step));
}

}  // namespace

Status checkDescription(const pb::SessionDescription& d) {
  if (d.session_id().size() != std::tuple_size_v<Uuid>) {
    return invalid("session_id", fmt::format("has {} bytes, allowed are 16", d.session_id().size()));
  }
  Status checks[] = {
      checkName("session description, station", d.station()),
      checkName("session description, trainee", d.trainee()),
      checkText("session description, exercise_id", d.exercise_id(), 0, kMaxNameBytes),
      checkName("session description, profile_id", d.profile_id()),
      checkNote("session description, profile_json", d.profile_json(), 2, kMaxJsonBytes),
      checkText("session description, engine_version", d.engine_version(), 1, 100),
      checkText("session description, device", d.device(), 0, 200),
      checkPose("placement", d.placement()),
      checkPose("tool", d.tool()),
      checkStep("length_m", d.resolution().length_m()),
      checkStep("quaternion", d.resolution().quaternion()),
      checkStep("force_n", d.resolution().force_n()),
      checkStep("torque_nm", d.resolution().torque_nm()),
      checkStep("time_s", d.resolution().time_s()),
      checkStep("speed_m_s", d.resolution().speed_m_s()),
  };
  for (Status& check : checks) {
    if (!check) return std::move(check);
  }
  if (!std::isfinite(d.rate_hz()) || d.rate_hz() <= 0 || d.rate_hz() > 40'000) {
    // a station's fastest loop (kMaxRateHz in common/haptics/scene_spec.h)
    return invalid("rate_hz", fmt::format("{:f}, allowed is above 0 to 40000", d.rate_hz()));
  }
  if (d.started_unix_ns() <= 0)
    return invalid("started_unix_ns", fmt::format("{}, allowed is above 0", d.started_unix_ns()));
  const auto checkShare = [](const char* field, bool has, double share) -> Status {
    if (!has || (share > 0 && share <= 1)) return {};
    return invalid(field, fmt::format("{:f}, allowed is above 0 to 1", share));
  };
  RETURN_IF_ERROR(checkShare("stiffness_share", d.has_stiffness_share(), d.stiffness_share()));
  RETURN_IF_ERROR(
      checkShare("delay_stiffness_share", d.has_delay_stiffness_share(), d.delay_stiffness_share()));
  return {};
}

void wipeSecrets(pb::Request& request) {
  if (request.has_add_user()) wipe(*request.mutable_add_user()->mutable_password());
  if (request.has_import_people()) wipe(*request.mutable_import_people()->mutable_csv());
  if (request.has_set_password()) {
    wipe(*request.mutable_set_password()->mutable_password());
    wipe(*request.mutable_set_password()->mutable_old_password());
  }
  if (request.has_set_code()) wipe(*request.mutable_set_code()->mutable_code());
  if (request.has_get_lesson()) wipe(*request.mutable_get_lesson()->mutable_code());
  if (request.has_check_trainee()) wipe(*request.mutable_check_trainee()->mutable_code());
}

}  // namespace needlelab
