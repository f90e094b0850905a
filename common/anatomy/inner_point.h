/// A point well inside a structure, for all that needs a centre of it: where to aim, what to draw.
#pragma once

#include <optional>

#include "common/anatomy/field.h"

namespace needlelab {

struct InnerPoint {
  Vec3 at_m;
  double clearance_m = 0;  ///< about how far its surface is, above 0
};

/// The deepest point of a structure, to a tenth of a millimetre or a twentieth of its depth: a search for the
/// pole of inaccessibility, which divides the cells that may be deepest first (Agafonkin, "A new algorithm
/// for finding a visual center of a polygon"). A structure that is a thin shell has many such points; this is
/// one of them. The same spec gives the same bits. `field` must be the spec's. Nothing if no point is found:
/// the rules leave nothing of the structure, or it is smaller than the search. Allocates; takes milliseconds.
std::optional<InnerPoint> innerPoint(const FieldSpec& spec, const Field& field, StructureIndex structure);

}  // namespace needlelab
