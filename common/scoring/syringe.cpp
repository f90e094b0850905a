#include <algorithm>
#include <cmath>

#include "common/scoring/groups.h"
#include "common/scoring/syringe_events.h"

namespace needlelab {

/// - `aspirations`, `injections`: strokes of the plunger (syringe_events.h). `injected_share`: how much of
/// the
///   syringe was pressed out, all injections together, in or outside tissue; above 1 when it was drawn up and
///   pressed again.
/// - `injected_in_target_share`: the part of that which left the needle's opening in a target; only where
///   something was injected and there is a target.
/// - `aspirated_before_injection` (1 or 0): an aspiration that began in tissue came before the first
/// injection
///   that had a part in tissue; only where there was such an injection.
void addSyringe(const Gesture& gesture, std::span<const pb::SyringeEvent> events, Rows& rows) {
  int aspirations = 0, injections = 0;
  double injected = 0, in_target = 0;
  bool aspirated = false, injected_in_tissue = false, was_aspirated = false;
  for (const pb::SyringeEvent& event : events) {
    if (event.kind() == pb::SyringeEvent::ASPIRATION) {
      ++aspirations;
      aspirated = aspirated || event.begin().in_tissue();
      continue;
    }
    ++injections;
    const double stroke = event.plunger_to() - event.plunger_from();
    injected += stroke;
    in_target += stroke * event.in_target_share();
    if (!injected_in_tissue && event.in_tissue_share() > 0) {
      injected_in_tissue = true;
      was_aspirated = aspirated;
    }
  }
  rows.add("aspirations", aspirations);
  rows.add("injections", injections);
  rows.add("injected_share", injected);
  if (injections > 0 && !gesture.anatomy.targets.empty())
    rows.add("injected_in_target_share", injected > 0 ? std::min(1.0, in_target / injected) : 0);
  if (injected_in_tissue) rows.add("aspirated_before_injection", was_aspirated ? 1 : 0);
}

}  // namespace needlelab
