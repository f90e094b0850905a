#include "common/profile/needle.h"

#include <algorithm>
#include <cmath>

#include "common/base/range.h"
#include "common/base/text.h"

namespace needlelab {

static_assert(static_cast<int>(NeedleTip::kUnknown) == pb::Needle::TIP_UNSPECIFIED);
static_assert(static_cast<int>(NeedleTip::kHypodermic) == pb::Needle::HYPODERMIC);
static_assert(static_cast<int>(NeedleTip::kQuincke) == pb::Needle::QUINCKE);
static_assert(static_cast<int>(NeedleTip::kTuohy) == pb::Needle::TUOHY);
static_assert(static_cast<int>(NeedleTip::kPencilPoint) == pb::Needle::PENCIL_POINT);

NeedleSpec needleOf(const pb::Needle& needle) {
  NeedleSpec spec;
  spec.length_m = needle.length_m();
  if (needle.has_outer_diameter_m())
    spec.outer_diameter_m = needle.outer_diameter_m();
  else if (needle.has_gauge())
    spec.outer_diameter_m = gaugeDiameter_m(needle.gauge());
  if (pb::Needle::Tip_IsValid(needle.tip())) spec.tip = static_cast<NeedleTip>(needle.tip());
  spec.bevel_angle_rad = needle.bevel_angle_rad();
  return spec;
}

Status checkNeedle(const pb::Needle& needle) {
  if (needle.has_gauge() && needle.has_outer_diameter_m()) {
    const double wanted = gaugeDiameter_m(needle.gauge()), found = needle.outer_diameter_m();
    if (!(std::abs(found - wanted) <= kGaugeTolerance * wanted))
      return Error{ErrorCode::kInvalidInput,
                   "needle.outer_diameter_m: " + numberText(found) + " contradicts gauge " +
                       std::to_string(needle.gauge()) + ", which is " + numberText(wanted) +
                       formatted(" (allowed is %.4g to %.4g): give one of the two, or both alike",
                                 wanted * (1 - kGaugeTolerance), wanted * (1 + kGaugeTolerance))};
  }
  const NeedleSpec spec = needleOf(needle);
  if (const double behind = openingBehindTip_m(spec), bevel = bevelLength_m(spec);
      std::max(behind, bevel) >= spec.length_m)
    return Error{ErrorCode::kInvalidInput,
                 formatted("needle.bevel_angle_rad: at %.3g rad a tip of %.3g mm diameter is %.3g mm long, ",
                           bevelAngle_rad(spec), 1e3 * spec.outer_diameter_m, 1e3 * std::max(behind, bevel)) +
                     "the whole needle " + numberText(1e3 * spec.length_m) + " mm"};
  return {};
}

}  // namespace needlelab
