#include "db/service/other_stores.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <optional>
#include <system_error>
#include <utility>

#include "common/base/files.h"
#include "common/base/local_time.h"
#include "common/base/text.h"
#include "db/erasure_list.h"
#include "db/service/store_move.h"
#include "db/store_address.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostFileBytes = 1 << 20;
using Kind = OtherStore::Kind;
/// By Kind.
constexpr std::array<std::string_view, 3> kWords = {"copy ", "left ", "used "};

/// "copy NS URL", with the word of a kind
bool parseLine(std::string_view line, OtherStore& store) {
  const auto word = std::find_if(kWords.begin(), kWords.end(),
                                 [&](std::string_view begin) { return line.starts_with(begin); });
  if (word == kWords.end()) return false;
  store.kind = static_cast<Kind>(word - kWords.begin());
  line.remove_prefix(word->size());
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), store.unix_ns);
  if (error != std::errc() || !line.substr(static_cast<std::size_t>(end - line.data())).starts_with(' '))
    return false;
  store.url = line.substr(static_cast<std::size_t>(end + 1 - line.data()));
  return !store.url.empty();
}

/// All lines.
Result<std::vector<OtherStore>> readAll(const std::filesystem::path& folder) {
  const auto path = folder / kOtherStoresFile;
  std::vector<OtherStore> stores;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return stores;
  ASSIGN_OR_RETURN(const std::string text, readWholeFile(path, kMostFileBytes));
  std::size_t number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line = std::string_view(text).substr(at, end - at);
    at = end + 1;
    ++number;
    if (line.empty() || line.starts_with('#')) continue;
    OtherStore store;
    if (!parseLine(line, store))
      return Error{
          ErrorCode::kInvalidInput,
          fmt::format("{}, line {}: is not understood: each line is \"copy\", \"left\" or \"used\", "
                      "a time in ns since 1970, and the address of another database with this lab's people",
                      path.string(), number)};
    stores.push_back(std::move(store));
  }
  return stores;
}

/// Whether the folder works with it, by what DIR/store says.
bool isInUse(const OtherStore& store, const std::optional<StoreFile>& works_with) {
  return works_with && (store.kind == Kind::kUsed || store.url == works_with->url);
}

Status writeOtherStores(const std::filesystem::path& folder, const std::vector<OtherStore>& stores) {
  std::string text =
      "# Other databases that may have this lab's people (needlelab-admin store list, store forget).\n";
  for (const OtherStore& store : stores)
    text += fmt::format("{}{} {}\n", kWords[static_cast<std::size_t>(store.kind)], store.unix_ns, store.url);
  return replaceFileAtomically(folder / kOtherStoresFile, viewOf(text));
}

/// What a move back kept of `url`.
Result<bool> removeReplacedFilesOf(const std::filesystem::path& folder, std::string_view url) {
  std::vector<std::filesystem::path> kept;
  std::error_code error;
  for (auto at = std::filesystem::directory_iterator(folder, error);
       !error && at != std::filesystem::directory_iterator(); at.increment(error)) {
    const std::string name = at->path().filename().string();
    if (!name.starts_with(kReplacedStoreFile) || !at->is_regular_file(error)) continue;
    // of something else: nobody's business here
    if (const auto file = readStoreFile(folder, name.c_str()); file && *file && (*file)->url == url)
      kept.push_back(at->path());
  }
  if (error) return Error{ErrorCode::kFailed, folder.string() + ": cannot be listed: " + error.message()};
  for (const auto& path : kept)
    if (::unlink(path.c_str()) != 0 && errno != ENOENT) return systemError(path, "remove");
  return !kept.empty();
}

}  // namespace

Result<std::vector<OtherStore>> readOtherStores(const std::filesystem::path& folder) {
  ASSIGN_OR_RETURN(auto stores, readAll(folder));
  if (stores.empty()) return stores;
  ASSIGN_OR_RETURN(const auto works_with, readStoreFile(folder));
  std::erase_if(stores, [&](const OtherStore& store) { return isInUse(store, works_with); });
  return stores;
}

Status rememberOtherStore(const std::filesystem::path& folder, const OtherStore& store) {
  if (store.url.find('\n') != std::string::npos)
    return Error{ErrorCode::kInvalidInput, "the database's address has a line's end in it"};
  ASSIGN_OR_RETURN(auto stores, readAll(folder));
  std::erase_if(stores, [&](const OtherStore& other) { return other.url == store.url; });
  stores.push_back(store);
  return writeOtherStores(folder, stores);
}

Status noteStoreInUse(const std::filesystem::path& folder, std::string_view url) {
  ASSIGN_OR_RETURN(auto stores, readAll(folder));
  const auto found =
      std::find_if(stores.begin(), stores.end(), [&](const OtherStore& store) { return store.url == url; });
  if (found == stores.end() || found->kind == Kind::kUsed) return {};
  found->kind = Kind::kUsed;
  return writeOtherStores(folder, stores);
}

Result<bool> forgetOtherStore(const std::filesystem::path& folder, std::string_view url) {
  ASSIGN_OR_RETURN(auto stores, readAll(folder));
  ASSIGN_OR_RETURN(const auto works_with, readStoreFile(folder));
  if (works_with && works_with->url == url) return false;
  const bool known = std::erase_if(stores, [&](const OtherStore& other) {
                       return other.url == url && !isInUse(other, works_with);
                     }) > 0;
  if (known) RETURN_IF_ERROR(writeOtherStores(folder, stores));
  ASSIGN_OR_RETURN(const bool kept, removeReplacedFilesOf(folder, url));
  return known || kept;
}

std::string otherStoresInText(const std::vector<OtherStore>& stores, std::size_t most_bytes) {
  std::string text;
  std::size_t others = 0;
  for (const OtherStore& store : stores) {
    const std::string one =
        fmt::format("{} ({} {})", printable(store.url),
                    store.kind == Kind::kCopy ? "a copy was begun there on" : "the lab left it after",
                    utcTime(store.unix_ns));
    if (text.size() + one.size() > most_bytes)
      ++others;
    else
      text += (text.empty() ? "" : ", ") + one;
  }
  if (others > 0)
    text += fmt::format("{}{} others, which `needlelab-admin store list` has", text.empty() ? "" : ", and ",
                        others);
  return text;
}

std::string otherStoresOfErasedText(const std::filesystem::path& folder) {
  constexpr std::int64_t kDay_ns = 86'400'000'000'000;
  constexpr std::size_t kOfFault_bytes = 64 << 10;
  auto stores = readOtherStores(folder);
  if (!stores) return stores.error().message;
  if (stores->empty()) return {};
  const auto erasures = readErasures(folder);
  if (!erasures) return {};  // `check` says that the list cannot be read
  std::int64_t newest = INT64_MIN;
  for (const ErasureLine& line : *erasures) newest = std::max(newest, line.unix_ns);
  std::erase_if(*stores, [&](const OtherStore& store) {
    return newest < INT64_MIN + kDay_ns || newest + kDay_ns < store.unix_ns;
  });
  if (stores->empty()) return {};
  return fmt::format(
      "people were erased, and no erasure reaches these other databases on PostgreSQL, where they may be: "
      "{}. "
      "Remove them (dropdb; none is the one that {} names), then say so: needlelab-admin --data {} store "
      "forget URL",
      otherStoresInText(*stores, kOfFault_bytes), (folder / kStoreFile).string(), folder.string());
}

}  // namespace needlelab
