#include "db/erasure_list.h"

#include <fmt/core.h>

#include <algorithm>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>
#include <unordered_map>
#include <utility>

#include "common/base/bytes.h"
#include "common/base/files.h"
#include "common/base/text.h"
#include "db/pseudonyms.h"

namespace needlelab {
namespace {

// cells behind the time
constexpr std::string_view kWithWaiting = "with-waiting";
constexpr std::string_view kWithoutAccount = "without-account";
constexpr std::string_view kKey = "key=";
constexpr std::string_view kMac = "mac=";

constexpr std::size_t kMostListBytes = 16u << 20;  // 50,000 lines with MACs have 9 MB

/// `found`: "17 bytes"; `most`: "5 bytes"; `of_key`: the folder whose key made the lines.
std::string tooLongText(const std::filesystem::path& path, const std::string& found, const std::string& most,
                        const std::filesystem::path& of_key) {
  std::string text = fmt::format(
      "{}: has {}, such a list has at most {}: somebody put lines into it. Put an older copy of the file "
      "into "
      "place; if there is none, ",
      path.string(), found, most);
  std::error_code error;
  const std::string only = "leave only the lines of your pseudonym.key in it";
  if (!std::filesystem::exists(of_key / "pseudonym.key", error)) return text + only;
  const auto key = PseudonymKey::ofFolder(of_key);
  if (!key) return text + only;
  return text + only +
         fmt::format(": cp '{0}' '{0}.all' && grep ' {1}{2} ' '{0}.all' > '{0}'", path.string(), kKey,
                     key->id());
}

/// What the MAC holds: the line without it.
std::string bareText(const ErasureLine& line) {
  return fmt::format("{} {} {}{}{}", line.pseudonym, hexDigitsOf(textOf(line.name_hash)), line.unix_ns,
                     line.with_waiting ? " " + std::string(kWithWaiting) : "",
                     line.without_account ? " " + std::string(kWithoutAccount) : "");
}

/// How many lines are in this state, and the pseudonym of the first.
struct Found {
  std::size_t count = 0;
  const ErasureLine* first = nullptr;
};
Found inState(const std::vector<ErasureLine>& lines, const PseudonymKey& key, SealState state) {
  Found found;
  for (const ErasureLine& line : lines) {
    if (sealOf(line, key) != state) continue;
    if (found.count++ == 0) found.first = &line;
  }
  return found;
}

std::string otherKeyText(const std::filesystem::path& path, const Found& found, const PseudonymKey& key) {
  return fmt::format(
      "{}: {} erasures, such as {}, were made with another pseudonym.key ({}) than the one here ({}): nobody "
      "can tell who these people were, and a restored backup brings them back. Put the pseudonym.key of the "
      "machine that erased them into place (deploy/OPERATIONS.md)",
      path.string(), found.count, printable(found.first->pseudonym), printable(found.first->seal->key),
      key.id());
}

std::string notObeyedText(const std::filesystem::path& path, const Found& found, std::string_view why) {
  return fmt::format(
      "{}: {} lines, such as that of {}, {}: they are not obeyed. Put back an older copy of the file, and "
      "look who was erased (needlelab-admin audit)",
      path.string(), found.count, printable(found.first->pseudonym), why);
}

/// Takes lines of another key out that the list `here` has no room for, and those whose pseudonym it has. A
/// few are added, so that `check` goes on naming them.
void leaveOutOthers(ErasuresBeside& beside, const std::vector<ErasureLine>& here, const PseudonymKey& key) {
  std::set<std::string> known;
  for (const ErasureLine& line : here) known.insert(line.pseudonym);
  std::size_t others = inState(here, key, SealState::kOtherKey).count;
  std::vector<ErasureLine> kept;
  Found left;
  for (ErasureLine& line : beside.lines) {
    if (sealOf(line, key) != SealState::kOtherKey) {
      kept.push_back(std::move(line));
    } else if (!known.contains(line.pseudonym) && others < kMostOtherLines) {
      ++others;
      kept.push_back(std::move(line));
    } else if (!known.contains(line.pseudonym) && left.count++ == 0) {
      left.first = &line;
    }
  }
  if (left.count > 0)
    beside.notes.push_back(otherKeyText(beside.path, left, key) +
                           fmt::format(". They are not added to the list here, which takes {} of such lines: "
                                       "keep the one that is there",
                                       kMostOtherLines));
  beside.lines = std::move(kept);
}

/// `of_key`: the folder whose key made the lines.
Result<std::vector<ErasureLine>> readList(const std::filesystem::path& path,
                                          const std::filesystem::path& of_key) {
  std::vector<ErasureLine> lines;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return lines;
  // not readWholeFile()'s kInvalidInput: a list that is too long must not keep the server from starting
  if (const auto bytes = std::filesystem::file_size(path, error); !error && bytes > kMostListBytes)
    return Error{ErrorCode::kCorrupt, tooLongText(path, fmt::format("{} bytes", bytes),
                                                  fmt::format("{} bytes", kMostListBytes), of_key)};
  ASSIGN_OR_RETURN(const auto text, readWholeFile(path, kMostListBytes));
  if (const auto rows = std::count(text.begin(), text.end(), '\n');
      rows > static_cast<std::ptrdiff_t>(kMostErasureLines))
    return Error{ErrorCode::kCorrupt, tooLongText(path, fmt::format("{} lines", rows),
                                                  fmt::format("{} lines", kMostErasureLines), of_key)};
  std::istringstream in(text);
  for (std::string row; std::getline(in, row);) {
    std::istringstream cells(row);
    ErasureLine line;
    std::string hex;
    cells >> line.pseudonym >> hex >> line.unix_ns;
    const auto bytes = bytesOfHex(hex);
    if (!cells || !bytes || bytes->size() != line.name_hash.size())
      return Error{ErrorCode::kCorrupt,
                   fmt::format("{}: line {} is not a pseudonym, 64 digits and a time; it says which erasures "
                               "a restored backup lacks: put back the file of this folder's last copy",
                               path.string(), lines.size() + 1)};
    std::copy(bytes->begin(), bytes->end(), line.name_hash.begin());
    for (std::string more; cells >> more;) {
      const bool is_key = more.starts_with(kKey), is_mac = more.starts_with(kMac);
      if (more == kWithWaiting) line.with_waiting = true;
      if (more == kWithoutAccount) line.without_account = true;
      if (!is_key && !is_mac) continue;
      if (!line.seal) line.seal.emplace();
      (is_key ? line.seal->key : line.seal->mac) = more.substr(kKey.size());
    }
    lines.push_back(std::move(line));
  }
  return lines;
}

/// A line as it stands in the file.
std::string wholeText(const ErasureLine& line) {
  return line.seal ? fmt::format("{} {}{} {}{}", bareText(line), kKey, line.seal->key, kMac, line.seal->mac)
                   : bareText(line);
}

/// The list beside backups. Others may write there: a link is not followed (kCorrupt), and of a line that
/// stands there several times one counts.
Result<std::vector<ErasureLine>> readBeside(const std::filesystem::path& backups,
                                            const std::filesystem::path& of_key) {
  const std::filesystem::path path = backups / kErasuresCopy;
  std::error_code error;
  if (std::filesystem::is_symlink(path, error))
    return Error{ErrorCode::kCorrupt,
                 path.string() + ": is a link; a list of erasures beside backups is a file"};
  ASSIGN_OR_RETURN(auto lines, readList(path, of_key));
  std::set<std::string> known;
  std::erase_if(lines, [&](const ErasureLine& line) { return !known.insert(wholeText(line)).second; });
  return lines;
}

}  // namespace

Result<std::vector<ErasureLine>> readErasures(const std::filesystem::path& folder, const char* file) {
  return readList(folder / file, folder);
}

Status writeErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                     const char* file) {
  if (lines.size() > kMostErasureLines)
    return Error{ErrorCode::kInvalidInput,
                 tooLongText(folder / file, fmt::format("now {} lines", lines.size()),
                             fmt::format("{} lines", kMostErasureLines), folder)};
  std::string text;
  for (const ErasureLine& line : lines) {
    text += wholeText(line) + '\n';
  }
  if (text.size() > kMostListBytes)
    return Error{ErrorCode::kInvalidInput,
                 tooLongText(folder / file, fmt::format("now {} bytes", text.size()),
                             fmt::format("{} bytes", kMostListBytes), folder)};
  // beside backups others may write, too
  return std::string_view(file) == kErasuresCopy ? replaceFileAtomically(folder / file, viewOf(text))
                                                 : writeFileAtomically(folder / file, viewOf(text));
}

namespace {

/// Adds what `all` lacks of `lines`, as addErasures(). Returns whether it lacked something.
bool merge(std::vector<ErasureLine>& all, const std::vector<ErasureLine>& lines, const PseudonymKey* key) {
  std::unordered_map<std::string, std::size_t> places;
  for (std::size_t at = 0; at < all.size(); ++at) places.emplace(all[at].pseudonym, at);
  bool more = false;
  for (const ErasureLine& line : lines) {
    const auto [place, is_new] = places.emplace(line.pseudonym, all.size());
    if (is_new) {
      all.push_back(line);
    } else {
      ErasureLine& there = all[place->second];
      const bool holds = key != nullptr && sealOf(line, *key) == SealState::kOurs;
      const bool there_holds = key != nullptr && sealOf(there, *key) == SealState::kOurs;
      if (there_holds && !holds) continue;
      if (there.unix_ns >= line.unix_ns && holds == there_holds) continue;
      there = line;
    }
    more = true;
  }
  return more;
}

}  // namespace

Status addErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                   const char* file, const PseudonymKey* key) {
  ASSIGN_OR_RETURN(auto all, readErasures(folder, file));
  return merge(all, lines, key) ? writeErasures(folder, all, file) : Status();
}

Result<std::string> addErasuresBeside(const std::filesystem::path& backups,
                                      const std::vector<ErasureLine>& lines, const PseudonymKey* key) {
  const std::filesystem::path path = backups / kErasuresCopy;
  auto read = readBeside(backups, backups);
  std::string note;
  if (!read && read.error().code == ErrorCode::kCorrupt) {
    const std::filesystem::path aside = backups / kErasuresAside;
    std::error_code error;
    std::filesystem::rename(path, aside, error);
    if (error)
      return Error{ErrorCode::kFailed, fmt::format("{}; it cannot be put aside as {}: {}",
                                                   read.error().message, aside.string(), error.message())};
    note = fmt::format("{}. It was put aside as {}, and a new list has the erasures of this machine",
                       read.error().message, aside.string());
    read = std::vector<ErasureLine>();
  }
  if (!read) return read.error();
  std::vector<ErasureLine>& all = *read;
  const bool more = merge(all, lines, key);
  const std::size_t too_many = all.size() > kMostLinesBeside ? all.size() - kMostLinesBeside : 0;
  std::size_t left_out = 0;
  const auto kept = std::remove_if(all.rbegin(), all.rend(), [&](const ErasureLine& line) {
    const bool goes = left_out < too_many && key != nullptr && sealOf(line, *key) != SealState::kOurs;
    if (goes) ++left_out;
    return goes;
  });
  all.erase(all.begin(), kept.base());
  if (left_out > 0)
    note = fmt::format(
        "{}: {} lines that the pseudonym.key here did not make were taken out, because a list "
        "beside backups has at most {} lines: who put them there?",
        path.string(), left_out, kMostLinesBeside);
  if (more || left_out > 0) RETURN_IF_ERROR(writeErasures(backups, all, kErasuresCopy));
  return note;
}

std::string lackedBeside(const std::filesystem::path& backups, const std::vector<ErasureLine>& lines,
                         const PseudonymKey& key) {
  const std::filesystem::path path = backups / kErasuresCopy;
  constexpr std::string_view kThen =
      "a backup there that is restored on another machine brings these people back. The next backup there "
      "writes the list; or copy the file 'erasures' of the data folder to it";
  const auto there = readBeside(backups, backups);
  if (!there)
    return fmt::format("the list of erasures beside the backups cannot be read ({}): {}",
                       there.error().message, kThen);
  std::unordered_map<std::string_view, const ErasureLine*> known;
  for (const ErasureLine& line : *there) known.emplace(line.pseudonym, &line);
  Found lacked;
  for (const ErasureLine& line : lines) {
    if (sealOf(line, key) != SealState::kOurs) continue;
    const auto found = known.find(line.pseudonym);
    // a restore does not obey other lines
    const bool holds = found != known.end() && found->second->unix_ns >= line.unix_ns &&
                       sealOf(*found->second, key) == SealState::kOurs;
    if (!holds && lacked.count++ == 0) lacked.first = &line;
  }
  if (lacked.count == 0) return {};
  return fmt::format("{}: the list of erasures beside the backups lacks {} erasures, such as {}: {}",
                     path.string(), lacked.count, printable(lacked.first->pseudonym), kThen);
}

ErasureLine sealed(ErasureLine line, const PseudonymKey& key) {
  line.seal = ErasureSeal{key.id(), key.macOf(bareText(line))};
  return line;
}

SealState sealOf(const ErasureLine& line, const PseudonymKey& key) {
  if (!line.seal) return SealState::kBroken;
  if (line.seal->key != key.id()) return SealState::kOtherKey;
  return line.seal->mac == key.macOf(bareText(line)) ? SealState::kOurs : SealState::kBroken;
}

std::vector<std::string> erasureListFaults(const std::filesystem::path& path,
                                           const std::vector<ErasureLine>& lines, const PseudonymKey& key) {
  std::vector<std::string> faults;
  const Found others = inState(lines, key, SealState::kOtherKey);
  if (others.count > 0) faults.push_back(otherKeyText(path, others, key));
  const Found broken = inState(lines, key, SealState::kBroken);
  if (broken.count > 0)
    faults.push_back(notObeyedText(path, broken, "were changed: their MAC is wrong or missing"));
  return faults;
}

void dropFaulty(std::vector<ErasureLine>& lines, const PseudonymKey& key) {
  std::erase_if(lines, [&](const ErasureLine& line) {
    const SealState state = sealOf(line, key);
    return state == SealState::kOtherKey || state == SealState::kBroken;
  });
}

Result<ErasuresBeside> erasuresBeside(const std::filesystem::path& backups,
                                      const std::filesystem::path& folder) {
  ErasuresBeside beside;
  beside.path = backups / kErasuresCopy;
  auto read = readBeside(backups, folder);
  if (!read) return Error{read.error().code, read.error().message + "; nothing was changed"};
  beside.lines = std::move(*read);
  auto& lines = beside.lines;
  if (lines.empty()) return beside;
  if (lines.size() > kMostLinesBeside)
    return Error{ErrorCode::kCorrupt, tooLongText(beside.path, fmt::format("{} lines", lines.size()),
                                                  fmt::format("{} lines", kMostLinesBeside), folder) +
                                          "; nothing was changed"};

  ASSIGN_OR_RETURN(const auto here, readErasures(folder));
  std::set<std::string> known;
  for (const ErasureLine& line : here) known.insert(line.pseudonym);

  Found misnamed;
  for (const ErasureLine& line : lines)
    if (!isErasurePseudonym(line.pseudonym) && misnamed.count++ == 0) misnamed.first = &line;
  if (misnamed.count > 0)
    beside.notes.push_back(notObeyedText(beside.path, misnamed, "have no pseudonym of an erasure"));
  std::erase_if(lines, [](const ErasureLine& line) { return !isErasurePseudonym(line.pseudonym); });

  std::error_code error;
  if (!std::filesystem::exists(folder / "pseudonym.key", error)) {
    // whose they are cannot be told yet: two lists together leave room for erasures to come, too
    const auto is_new = [&](const ErasureLine& line) { return !known.contains(line.pseudonym); };
    const auto more = static_cast<std::size_t>(std::count_if(lines.begin(), lines.end(), is_new));
    if (more > 0 && here.size() + more > kMostLinesBeside)
      return Error{
          ErrorCode::kInvalidInput,
          fmt::format("{}: has {} lines that {} has not, with {} lines: put the pseudonym.key of the "
                      "machine that erased these people into {} first; nothing was changed",
                      beside.path.string(), more, (folder / kErasuresFile).string(), here.size(),
                      folder.string())};
    return beside;
  }
  ASSIGN_OR_RETURN(beside.key, PseudonymKey::ofFolder(folder));
  const PseudonymKey& key = *beside.key;
  const Found others = inState(lines, key, SealState::kOtherKey);
  const bool ours = inState(lines, key, SealState::kOurs).count > 0;
  if (others.count > 0 && !ours)
    return Error{ErrorCode::kInvalidInput,
                 otherKeyText(beside.path, others, key) +
                     ", and keep the one that is there elsewhere; nothing was changed. Only if that key is "
                     "lost, restore without the list: move it away, and erase these people again by name"};
  leaveOutOthers(beside, here, key);
  if (const Found broken = inState(lines, key, SealState::kBroken); broken.count > 0)
    beside.notes.push_back(notObeyedText(beside.path, broken, "were changed: their MAC is wrong or missing"));
  std::erase_if(lines, [&](const ErasureLine& line) { return sealOf(line, key) == SealState::kBroken; });
  return beside;
}

}  // namespace needlelab
