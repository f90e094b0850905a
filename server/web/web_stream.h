/// A reply that is longer than one wants to hold: made piece by piece. The seam for formats of export: each
/// is one function that opens such a stream.
#pragma once

#include <functional>
#include <string>

#include "common/base/result.h"

namespace needlelab {

struct WebStream {
  std::string type;       ///< Content-Type
  std::string file_name;  ///< that a browser offers; letters, digits, '-', '_', '.'
  /// The next piece, empty at the end. On a worker's thread, one call at a time.
  std::function<Result<std::string>()> next;
};

}  // namespace needlelab
