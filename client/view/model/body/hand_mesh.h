/// A gloved hand that holds a syringe, for scale.
#pragma once

#include "client/view/model/mesh.h"

namespace needlelab {

/// The right hand's thumb, index and middle finger round the barrel, the other fingers bent behind them, the
/// wrist away from the needle. In T with +x towards the palm; turn it about z. A normal's length, (0, 1], is
/// how open the surface is to light. Takes some 30 ms.
Mesh handMesh(const SyringeMesh& syringe);

}  // namespace needlelab
