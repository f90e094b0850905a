/// Refuses a program's output files before its work begins, not after hours of it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// A file that a command line names: the option, as the user wrote it, and its value.
struct NamedFile {
  std::string option;          ///< e.g. "--json"
  std::filesystem::path path;  ///< empty = not asked for, or standard output
};

/// Whether each output can be written where it is asked for, and would destroy neither an input nor another
/// output. Writes nothing. Errors (kInvalidInput) name option, file and reason: a folder; in a folder that
/// does not exist or cannot be written to; the same file as an input or as another output, by whatever name.
Status checkOutputs(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs);

}  // namespace needlelab
