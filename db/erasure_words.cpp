// The words of an erasure: its file, its messages.
#include <algorithm>
#include <charconv>
#include <sstream>

#include "common/base/files.h"
#include "db/erasure_store.h"
#include "db/revision.h"

namespace needlelab {
namespace {

constexpr const char* kErasuresFile = "erasures";

}  // namespace

std::string erasureToRepeatText(const ErasureToRepeat& erasure) {
  return "'" + erasure.name + "' was erased on " + secondText(erasure.erased_unix_ns) +
         " and is in this database again, because a backup from before was restored: erase it again by "
         "needlelab-admin person "
         "erase '" +
         erasure.name + "' --confirm '" + erasure.name + "'";
}

Result<std::vector<ErasureLine>> readErasures(const std::filesystem::path& folder) {
  const auto path = folder / kErasuresFile;
  std::vector<ErasureLine> lines;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return lines;
  const auto text = readWholeFile(path, 16u << 20);
  if (!text) return text.error();
  std::istringstream in(*text);
  for (std::string row; std::getline(in, row);) {
    std::istringstream cells(row);
    ErasureLine line;
    std::string hex;
    cells >> line.pseudonym >> hex >> line.unix_ns;
    const auto bytes = bytesOfHex(hex);
    if (!cells || !bytes || bytes->size() != line.name_hash.size())
      return Error{ErrorCode::kCorrupt,
                   path.string() + ": line " + std::to_string(lines.size() + 1) +
                       " is not a pseudonym, 64 digits and a time; it says which erasures a restored backup "
                       "lacks: put back the file of this folder's last copy"};
    std::copy(bytes->begin(), bytes->end(), line.name_hash.begin());
    lines.push_back(std::move(line));
  }
  return lines;
}

Status writeErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines) {
  std::string text;
  for (const ErasureLine& line : lines)
    text += line.pseudonym + " " + hexDigitsOf(textOf(line.name_hash)) + " " + std::to_string(line.unix_ns) +
            "\n";
  return writeFileAtomically(folder / kErasuresFile, viewOf(text), 0600);
}

}  // namespace needlelab
