/// The names of files that are being written, beside the files that they will replace.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace needlelab {

/// Stands between a file's name and six random letters or digits (mkostemp). A word of ours, because a
/// technician's own copy may well be called `ca.key.backup`.
inline constexpr std::string_view kTemporaryMark = ".being-written-";

/// Whether a writer of the file `own` names its temporary file `name`; both without their folder.
inline bool isTemporaryNameOf(std::string_view own, std::string_view name) {
  constexpr std::size_t kLetters = 6;
  const auto fits = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  };
  return name.size() == own.size() + kTemporaryMark.size() + kLetters && name.starts_with(own) &&
         name.substr(own.size()).starts_with(kTemporaryMark) &&
         std::all_of(name.end() - kLetters, name.end(), fits);
}

}  // namespace needlelab
