/// The names of files that are being written, beside the files that they will replace.
#pragma once

#include <string_view>

namespace needlelab {

/// Stands between a file's name and six random letters or digits (mkostemp). A word of ours, because a
/// technician's own copy may well be called `ca.key.backup`.
inline constexpr std::string_view kTemporaryMark = ".being-written-";

}  // namespace needlelab
