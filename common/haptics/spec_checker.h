/// Checks the numbers of a scene and keeps the first fault with its field's path. Used by `validate` and for
/// the axial models' own sections.
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "common/base/range.h"
#include "common/base/result.h"
#include "common/haptics/geometry.h"

namespace needlelab {

inline constexpr NumberRange kLength{0, 1, true};
inline constexpr NumberRange kDepth{0, 1};
inline constexpr NumberRange kForce{0, 50};
inline constexpr NumberRange kPositiveForce{0, 50, true};
inline constexpr NumberRange kStiffness{0, 10'000, true};
inline constexpr NumberRange kFrictionPerLength{0, 1e4};
inline constexpr NumberRange kCoordinate{-1e3, 1e3};

/// Skips all checks after the first fault.
class SpecChecker {
 public:
  /// Sets the prefix of the following field names, e.g. "layers[2].".
  void enter(std::string prefix) { prefix_ = std::move(prefix); }

  void number(std::string_view field, double value, const NumberRange& range) {
    if (status_.ok() && !range.contains(value))
      status_ = outOfRange(prefix_ + std::string(field), value, range);
  }
  void point(const std::string& field, Vec3 value) {
    number(field + ".x", value.x, kCoordinate);
    number(field + ".y", value.y, kCoordinate);
    number(field + ".z", value.z, kCoordinate);
  }
  void require(bool good, std::string_view field, const std::string& words) {
    if (status_.ok() && !good)
      status_ = Error{ErrorCode::kInvalidInput, prefix_ + std::string(field) + ": " + words};
  }
  [[nodiscard]] Status take() { return std::move(status_); }

 private:
  std::string prefix_;
  Status status_;
};

}  // namespace needlelab
