#include "client/sim/accuracy/error_sum.h"

#include <cstdio>

namespace needlelab {

std::string spreadText(const ErrorRuns& runs, const char* of) {
  char text[96];
  std::snprintf(text, sizeof text, "rms ± %.2g N (sd over %zu %s)", runs.spread(), runs.runs(), of);
  return text;
}

}  // namespace needlelab
