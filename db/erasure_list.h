/// The list of erasures beside the database: which people a restored backup must lose again. Its lines are
/// held by MACs of pseudonym.key.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/pseudonyms.h"

namespace needlelab {

/// Which key made a line of the list, and its MAC over the line, in hexadecimal digits.
struct ErasureSeal {
  std::string key, mac;
};

/// A line of DIR/erasures. A restore replaces the database but not this file.
struct ErasureLine {
  std::string pseudonym;
  PseudonymKey::Hash name_hash{};
  std::int64_t unix_ns = 0;
  bool with_waiting = false;          ///< it took the sessions that waited for a manager, too
  std::optional<ErasureSeal> seal{};  ///< nothing: somebody took it away, or wrote the line
  bool without_account = false;       ///< nobody had the name: it is another's when it comes again
};

/// The list in the data folder, and the copy of it beside backups, which a restore on another machine adds to
/// its own.
inline constexpr const char* kErasuresFile = "erasures";
inline constexpr const char* kErasuresCopy = "needlelab.erasures";
/// What stood in the place of that copy and was no list.
inline constexpr const char* kErasuresAside = "needlelab.erasures.put-aside";

/// Of a list, and of one beside a backup: a restore leaves room for erasures to come.
inline constexpr std::size_t kMostErasureLines = 50'000, kMostLinesBeside = 25'000;
/// Lines of another key to which a restore adds: anybody can write them.
inline constexpr std::size_t kMostOtherLines = 100;

/// Reads DIR/erasures; nothing when the file does not exist. It does not look at the MACs. kCorrupt, also
/// above kMostErasureLines.
Result<std::vector<ErasureLine>> readErasures(const std::filesystem::path& folder,
                                              const char* file = kErasuresFile);
/// kInvalidInput, with nothing written, for a list that readErasures() would not read.
Status writeErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                     const char* file = kErasuresFile);
/// Adds to the list `file` of `folder` what it lacks of `lines`; writes nothing when it lacks nothing. With
/// the `key`, lines that have its MAC also replace those of the same pseudonym that have not, and are
/// replaced by none of these. Errors as of both.
Status addErasures(const std::filesystem::path& folder, const std::vector<ErasureLine>& lines,
                   const char* file = kErasuresFile, const PseudonymKey* key = nullptr);

/// Adds `lines`, those of this machine, to the list beside its backups, as addErasures(). What others put
/// there keeps none of them out: lines that this `key` did not make leave above kMostLinesBeside, the last
/// first, and a file that is no list is put aside (kErasuresAside). Returns what was done about them, for
/// display; empty: nothing. Errors: what stands there is no file, or cannot be written.
Result<std::string> addErasuresBeside(const std::filesystem::path& backups,
                                      const std::vector<ErasureLine>& lines, const PseudonymKey* key);
/// What the list beside the backups lacks of `lines`, for display; empty: nothing. Lines of another key do
/// not count. A list that cannot be read lacks all.
std::string lackedBeside(const std::filesystem::path& backups, const std::vector<ErasureLine>& lines,
                         const PseudonymKey& key);

/// The line with this key's MAC.
ErasureLine sealed(ErasureLine line, const PseudonymKey& key);

enum class SealState {
  kOurs,
  kOtherKey,  ///< its hash names nobody by this key
  kBroken,    ///< without a MAC, or this key's, but the line was changed
};
SealState sealOf(const ErasureLine& line, const PseudonymKey& key);

/// What is wrong with the lines of the list `path` by this key, for display; empty when all is well.
std::vector<std::string> erasureListFaults(const std::filesystem::path& path,
                                           const std::vector<ErasureLine>& lines, const PseudonymKey& key);
/// Takes out the lines that faults forbid to obey.
void dropFaulty(std::vector<ErasureLine>& lines, const PseudonymKey& key);

/// The lines of the list beside a backup that a restore adds to its own, and what there is to say about it.
struct ErasuresBeside {
  std::vector<ErasureLine> lines;
  std::vector<std::string> notes;
  std::filesystem::path path;
  std::optional<PseudonymKey> key;  ///< of the restore's folder; nothing: there is none yet
};
/// Reads and checks it for a restore into the data folder `folder`. Without a key there all lines are taken,
/// and looked at when the key is there. Lines that were changed or have no MAC, and those whose pseudonym is
/// none, are told and not taken; of another key's, so many as make kMostOtherLines in the folder's list.
/// kInvalidInput: lines are of another key than the one in `folder`, and none of that one; without a key
/// there, it and the folder's list have more than kMostLinesBeside; kCorrupt: it alone has.
Result<ErasuresBeside> erasuresBeside(const std::filesystem::path& backups,
                                      const std::filesystem::path& folder);

}  // namespace needlelab
