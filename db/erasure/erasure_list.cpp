#include "db/erasure/erasure_list.h"

#include <fmt/core.h>

#include <algorithm>
#include <sstream>
#include <string>

#include "common/base/bytes.h"
#include "common/base/files/files.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostBytes = 16 << 20;

Result<ErasureLine> lineOf(const std::string& text) {
  std::istringstream cells(text);
  std::string lab, person, rest;
  ErasureLine line;
  cells >> lab >> person >> line.unix_ns;
  if (!cells || cells >> rest) return Error{ErrorCode::kCorrupt, "is not two UUIDs and a time"};
  ASSIGN_OR_RETURN(line.lab, parseUuid(lab));
  ASSIGN_OR_RETURN(line.person, parseUuid(person));
  return line;
}

}  // namespace

Result<std::vector<ErasureLine>> readErasures(const std::filesystem::path& folder, const char* file) {
  std::vector<ErasureLine> lines;
  const auto path = folder / file;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return lines;
  ASSIGN_OR_RETURN(const auto text, readWholeFile(path, kMostBytes));
  std::istringstream in(text);
  for (std::string row; std::getline(in, row);) {
    auto line = lineOf(row);
    if (!line)
      return Error{ErrorCode::kCorrupt,
                   fmt::format("{}: line {}: {}; the file says whom a restored backup must not bring back: "
                               "put back the copy that lies beside the backups ({})",
                               path.string(), lines.size() + 1, line.error().message, kErasuresCopy)};
    lines.push_back(*line);
  }
  return lines;
}

Status addErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                   const char* file) {
  ASSIGN_OR_RETURN(auto all, readErasures(folder, file));
  const auto before = all.size();
  for (const ErasureLine& line : lines)
    if (std::none_of(all.begin(), all.end(), [&](const ErasureLine& known) {
          return known.lab == line.lab && known.person == line.person;
        }))
      all.push_back(line);
  return all.size() == before ? Status() : writeErasures(folder, all, file);
}

Status writeErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                     const char* file) {
  std::string text;
  for (const ErasureLine& line : lines)
    text += fmt::format("{} {} {}\n", uuidText(line.lab), uuidText(line.person), line.unix_ns);
  return writeFileAtomically(folder / file, viewOf(text), 0600);
}

}  // namespace needlelab
