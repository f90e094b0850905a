#include "common/base/output_check.h"

#include <unistd.h>

#include <system_error>

namespace needlelab {
namespace {

namespace fs = std::filesystem;

Error refusal(const NamedFile& output, const std::string& why) {
  return {ErrorCode::kInvalidInput, output.option + " " + output.path.string() + ": " + why};
}

fs::path folderOf(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

// files that are there are compared by what they are (links), others by where they will be
bool isSameFile(const fs::path& a, const fs::path& b) {
  std::error_code unknown;
  if (fs::equivalent(a, b, unknown)) return true;
  return a.filename() == b.filename() && fs::equivalent(folderOf(a), folderOf(b), unknown);
}

}  // namespace

Status checkOutputs(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const NamedFile& output = outputs[i];
    if (output.path.empty()) continue;
    std::error_code unknown;
    if (fs::is_directory(output.path, unknown))
      return refusal(output, "is a folder; give the name of a file");
    const fs::path folder = folderOf(output.path);
    if (!fs::is_directory(folder, unknown))
      return refusal(output, "there is no folder " + folder.string() + "; make it first");
    if (::access(folder.c_str(), W_OK) != 0 && !fs::exists(output.path, unknown))
      return refusal(output, "the folder " + folder.string() + " cannot be written to");
    for (const NamedFile& input : inputs)
      if (!input.path.empty() && isSameFile(output.path, input.path))
        return refusal(output, "is the same file as the input " + input.path.string() +
                                   ", which would be lost; give another name");
    for (std::size_t k = 0; k < i; ++k)
      if (!outputs[k].path.empty() && isSameFile(output.path, outputs[k].path))
        return refusal(output, "is the same file as that of " + outputs[k].option + "; give another name");
  }
  return {};
}

}  // namespace needlelab
