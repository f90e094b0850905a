// The words of an erasure: its file, its messages, names in texts.
#include <algorithm>
#include <charconv>
#include <sstream>

#include "base/atomic_file.h"
#include "db/erasure_store.h"
#include "db/revision.h"

namespace needlelab {
namespace {

constexpr const char* kErasuresFile = "erasures";

char lowered(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

/// Letters, digits, and all of UTF-8 beyond ASCII.
bool isWordByte(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return byte >= 0x80 || (byte >= '0' && byte <= '9') || (lowered(c) >= 'a' && lowered(c) <= 'z') || c == '_';
}

void replaceWord(std::string& text, std::string_view word, std::string_view in_its_place) {
  if (word.empty()) return;
  const auto same = [](char a, char b) { return lowered(a) == lowered(b); };
  std::size_t from = 0;
  while (from < text.size()) {
    const auto at = std::search(text.begin() + static_cast<std::ptrdiff_t>(from), text.end(), word.begin(),
                                word.end(), same);
    if (at == text.end()) return;
    const auto begin = static_cast<std::size_t>(at - text.begin()), end = begin + word.size();
    const bool alone =
        (begin == 0 || !isWordByte(text[begin - 1])) && (end == text.size() || !isWordByte(text[end]));
    if (alone) text.replace(begin, word.size(), in_its_place);
    from = alone ? begin + in_its_place.size() : begin + 1;
  }
}

}  // namespace

std::string withoutName(const std::string& text, std::string_view name, std::string_view full_name,
                        std::string_view in_its_place) {
  std::string without = text;
  replaceWord(without, full_name, in_its_place);
  replaceWord(without, name, in_its_place);
  for (std::size_t at = 0; at < full_name.size();) {
    const std::size_t end = std::min(full_name.find_first_of(" ,", at), full_name.size());
    if (end - at > 2) replaceWord(without, full_name.substr(at, end - at), in_its_place);
    at = end + 1;
  }
  return without;
}

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
