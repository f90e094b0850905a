/// Moved to base/timing.h, where the station reaches it too.
#pragma once

#include "base/timing.h"
