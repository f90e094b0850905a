#include "db/service/records/record_end.h"

#include <fmt/core.h>

#include <cstddef>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/base/bytes.h"
#include "common/base/text/strict_json.h"
#include "db/backup/foreign_database.h"
#include "db/backup/old_backups.h"

namespace needlelab {
namespace {

constexpr std::string_view kEndBegins = "{\"kind\":\"end\",";

std::string endText(std::uint64_t records, const Digest& digest) {
  return fmt::format("{}\"records\":{},\"blake2b\":\"{}\"}}", kEndBegins, records, hexOf(digest));
}

}  // namespace

std::string recordsEnd(std::uint64_t records, std::string_view lines) {
  SessionHash hash;
  hash.update(viewOf(lines));
  return endText(records, hash.digest());
}

Result<bool> RecordsReader::take(std::string_view line) {
  if (ended_) return Error{ErrorCode::kInvalidInput, "something follows the last line of the export"};
  if (line.starts_with(kEndBegins)) {
    if (line != endText(records_, hash_.digest()))
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("the last line does not agree with the {} records before it: something is "
                               "missing or was changed; export again",
                               records_)};
    ended_ = true;
    return false;
  }
  hash_.update(viewOf(line));
  hash_.update(viewOf(std::string_view("\n")));
  ++records_;
  return true;
}

Status RecordsReader::ended() const {
  if (ended_) return {};
  return Error{ErrorCode::kInvalidInput,
               fmt::format("ends after {} records without the line that an export ends with: a part is "
                           "missing; export again",
                           records_)};
}

namespace {

using Json = nlohmann::json;

/// The line without white space at both ends.
std::string_view trimmed(std::string_view line) {
  constexpr std::string_view kSpace = " \t\r\n";
  const std::size_t first = line.find_first_not_of(kSpace);
  if (first == std::string_view::npos) return {};
  return line.substr(first, line.find_last_not_of(kSpace) - first + 1);
}

std::string textIn(const Json& record, const char* field) {
  const auto found = record.find(field);
  return found != record.end() && found->is_string() ? found->get<std::string>() : std::string();
}

/// The head in an export's own audit line; nothing for any other record.
std::optional<AuditHead> headOfExport(const Json& record) {
  if (textIn(record, "kind") != "audit" || textIn(record, "action") != "export-all" ||
      !textIn(record, "subject").empty())
    return std::nullopt;
  const std::string detail = textIn(record, "detail");
  std::string_view head = detail;
  constexpr std::string_view kWithHashes = "with hashes of passwords and keys; ";
  if (head.starts_with(kWithHashes)) head.remove_prefix(kWithHashes.size());
  return auditHeadOf(head);
}

/// A record of an export arrived in a message of 1 MiB; JSON may escape each byte with six.
constexpr std::size_t kMaxLineBytes = 8u << 20;

Error noHead(const std::filesystem::path& path) {
  return {ErrorCode::kInvalidInput,
          path.string() +
              ": is neither a backup, nor an export of everything, nor a text with one line \"audit head "
              "…\" (decrypt an encrypted backup first)"};
}

/// In an export, whose first line starts like JSON: the head in its last own audit line. In other text: the
/// only line that is a head; heads within a line do not count.
Result<AuditHead> headOfLines(std::istream& in, const std::filesystem::path& path) {
  constexpr std::string_view kLabel = "keep elsewhere";
  std::optional<AuditHead> found;
  std::optional<bool> is_export;
  RecordsReader records;
  std::vector<char> buffer(kMaxLineBytes + 1);
  while (in.getline(buffer.data(), static_cast<std::streamsize>(buffer.size()))) {
    // the count includes the line end, except at the end of the file
    const auto count = static_cast<std::size_t>(in.gcount()) - (in.eof() ? 0 : 1);
    std::string_view text = trimmed({buffer.data(), count});
    if (text.empty()) continue;
    if (!is_export) is_export = text.front() == '{';
    if (*is_export) {
      const auto more = records.take(text);
      if (!more) return Error{more.error().code, path.string() + ": " + more.error().message};
      if (!*more) continue;
      const Json record = readShallowJson<Json>(text);
      if (!record.is_object()) return noHead(path);
      if (const auto head = headOfExport(record)) found = head;
      continue;
    }
    if (text.starts_with(kLabel)) text = trimmed(text.substr(kLabel.size()));
    const auto head = auditHeadOf(text);
    if (!head) continue;
    if (found)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("{}: has several heads (\"{}\" and \"{}\"): give a file with one",
                               path.string(), auditHeadText(*found), auditHeadText(*head))};
    found = head;
  }
  if (!in.eof())
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: cannot be read, or has a line of more than {} MiB, which no export and no "
                             "text with a head has",
                             path.string(), kMaxLineBytes >> 20)};
  if (is_export.value_or(false))
    if (const Status whole = records.ended(); !whole)
      return Error{whole.error().code, path.string() + ": " + whole.error().message};
  if (!found) return noHead(path);
  return *found;
}

}  // namespace

Result<AuditAnchor> readAuditAnchor(const std::filesystem::path& path) {
  // reading a pipe may block forever
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return noHead(path);
  std::ifstream in(path, std::ios::binary);
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  std::string start(kMagic.size(), ' ');
  if (in.read(start.data(), static_cast<std::streamsize>(start.size())) && start == kMagic) {
    ASSIGN_OR_RETURN(auto backup, openForeign(path));
    AuditChain chain(backup);
    ASSIGN_OR_RETURN(const auto head, chain.head());
    ASSIGN_OR_RETURN(const auto first, chain.firstMac());
    return AuditAnchor{path.string(), head, first};
  }
  in.clear();
  in.seekg(0);
  ASSIGN_OR_RETURN(const auto head, headOfLines(in, path));
  return AuditAnchor{path.string(), head};
}

Result<std::vector<AuditAnchor>> readAuditAnchors(const std::filesystem::path& path) {
  std::vector<AuditAnchor> anchors;
  std::error_code error;
  if (!std::filesystem::is_directory(path, error)) {
    ASSIGN_OR_RETURN(auto anchor, readAuditAnchor(path));
    anchors.push_back(std::move(anchor));
    return anchors;
  }
  ASSIGN_OR_RETURN(const auto backups, backupsIn(path));
  for (const std::filesystem::path& backup : backups) {
    if (backup.extension() != kPlainEnding) continue;
    auto anchor = readAuditAnchor(backup);
    if (!anchor && anchor.error().code == ErrorCode::kInvalidInput) continue;  // only named like a backup
    if (!anchor) return anchor.error();
    anchors.push_back(std::move(*anchor));
  }
  if (anchors.empty())
    return Error{ErrorCode::kInvalidInput, path.string() +
                                               ": has no plain backup that is named by its time "
                                               "(needlelab-….db); decrypt an encrypted one first"};
  return anchors;
}

}  // namespace needlelab
