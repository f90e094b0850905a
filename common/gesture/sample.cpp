
#include "common/gesture/sample.h"

#include "common/base/text/csv.h"

namespace needlelab {

Status validate(const Resolution& resolution) {
  const struct {
    const char* name;
    double step;
  } fields[] = {{"length_m", resolution.length_m}, {"quaternion", resolution.quaternion},
                {"force_N", resolution.force_N},   {"torque_Nm", resolution.torque_Nm},
                {"time_s", resolution.time_s},     {"speed_mps", resolution.speed_mps}};
  for (const auto& field : fields) {
    // this form also rejects not-a-number
    if (field.step == 0 || (field.step >= 1e-12 && field.step <= 1)) continue;
    std::string text = std::string("resolution.") + field.name + " is ";
    appendNumber(text, field.step);
    return Error{ErrorCode::kInvalidInput, text + "; allowed is 0 (lossless) or 1e-12 to 1"};
  }
  return {};
}

}  // namespace needlelab
