#include "db/service/audit_anchor.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/base/files.h"
#include "common/profile/strict_json.h"
#include "db/foreign_database.h"
#include "db/old_backups.h"
#include "db/open_file.h"

namespace needlelab {
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

/// The head in an export's own line of the log; nothing for every other record.
std::optional<AuditHead> headOfExport(const Json& record) {
  // what was imported may say anything; older exports do not tell it apart
  const auto is_given = [&](const char* field) {
    const auto found = record.find(field);
    return found != record.end() && !found->is_null();
  };
  if (textIn(record, "kind") != "audit" || textIn(record, "action") != "export-all" ||
      !textIn(record, "subject").empty() || is_given("imported_by") || is_given("imported_from"))
    return std::nullopt;
  const std::string detail = textIn(record, "detail");
  std::string_view head = detail;
  constexpr std::string_view kWithHashes = "with hashes of passwords and keys; ";
  if (head.starts_with(kWithHashes)) head.remove_prefix(kWithHashes.size());
  return auditHeadOf(head);
}

/// An opened file's lines.
class Lines {
 public:
  /// A record of an export came in a message of 1 MiB; in JSON each of its bytes may be written as six.
  static constexpr std::size_t kMostLineBytes = 8u << 20;

  Lines(const OpenFile& file, const std::filesystem::path& path) : fd_(file.fd()), path_(path) {}

  /// The next one, without its end; nothing: there is none. kInvalidInput: it is longer than any.
  Result<std::optional<std::string>> next() {
    std::string line;
    for (;;) {
      const std::size_t end = std::min(read_.find('\n', at_), read_.size());
      line.append(read_, at_, end - at_);
      if (line.size() > kMostLineBytes)
        return Error{ErrorCode::kInvalidInput, path_.string() + ": has a line of more than " +
                                                   std::to_string(kMostLineBytes >> 20) +
                                                   " MiB, which no export and no text with a head has"};
      at_ = end + 1;
      if (end < read_.size()) return std::optional(std::move(line));
      ASSIGN_OR_RETURN(const bool more, fill());
      if (!more) return line.empty() ? std::optional<std::string>() : std::optional(std::move(line));
    }
  }
  /// From the first one on again.
  Status rewind() {
    read_.clear();
    at_ = 0;
    if (::lseek(fd_, 0, SEEK_SET) != 0) return systemError(path_, "read");
    return {};
  }

 private:
  /// False: the file ends.
  Result<bool> fill() {
    read_.resize(64u << 10);
    at_ = 0;
    for (;;) {
      const ssize_t got = ::read(fd_, read_.data(), read_.size());
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) return systemError(path_, "read");
      read_.resize(static_cast<std::size_t>(got));
      return got > 0;
    }
  }

  int fd_;
  const std::filesystem::path& path_;
  std::string read_;  ///< of which the bytes from at_ on are still to be taken
  std::size_t at_ = 0;
};

Error noHead(const std::filesystem::path& path) {
  return {ErrorCode::kInvalidInput,
          path.string() +
              ": is neither a backup, nor an export of everything, nor a text with one line \"audit head "
              "…\" (decrypt an encrypted backup first)"};
}

/// JSON lines, or what `audit verify --json` wrote.
Result<AuditHead> headOfRecords(Lines& in, const std::filesystem::path& path) {
  std::optional<AuditHead> found;
  std::string whole;
  bool lines = true;
  for (;;) {
    ASSIGN_OR_RETURN(const auto line, in.next());
    if (!line) break;
    // one object over several lines is small
    constexpr std::size_t kMostWhole = 1u << 20;
    if (whole.size() < kMostWhole) whole += *line + "\n";
    if (!lines || trimmed(*line).empty()) continue;
    const Json record = readShallowJson<Json>(*line);
    lines = record.is_object();
    if (!lines) continue;
    // an export ends with its own line; of exports that were read in, earlier ones may be there
    if (const auto head = headOfExport(record)) found = head;
  }
  if (lines && found) return *found;
  const Json document = readShallowJson<Json>(whole);
  if (document.is_object()) {
    const auto rows = document.find("rows");
    if (rows != document.end() && rows->is_array() && rows->size() == 1 && rows->front().is_object())
      if (const auto head = auditHeadOf(textIn(rows->front(), "head"))) return *head;
  }
  return noHead(path);
}

/// A text that somebody kept: other lines are ignored, a head within a line is none.
Result<AuditHead> headOfText(Lines& in, const std::filesystem::path& path) {
  std::optional<AuditHead> found;
  for (;;) {
    ASSIGN_OR_RETURN(const auto line, in.next());
    if (!line) break;
    std::string_view text = trimmed(*line);
    constexpr std::string_view kLabel = "keep elsewhere";
    if (text.starts_with(kLabel)) text = trimmed(text.substr(kLabel.size()));
    const auto head = auditHeadOf(text);
    if (!head) continue;
    if (found)
      return Error{ErrorCode::kInvalidInput, path.string() + ": has several heads (\"" +
                                                 auditHeadText(*found) + "\" and \"" + auditHeadText(*head) +
                                                 "\"): give a file with one"};
    found = head;
  }
  if (!found) return noHead(path);
  return *found;
}

}  // namespace

Result<AuditAnchor> readAuditAnchor(const std::filesystem::path& path) {
  // a pipe may never answer, whenever somebody puts it there
  const OpenFile file(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
  struct stat info {};
  if (!file.isOpen() || ::fstat(file.fd(), &info) != 0 || !S_ISREG(info.st_mode)) return noHead(path);
  std::array<char, 16> start{};
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  if (::pread(file.fd(), start.data(), start.size(), 0) == static_cast<ssize_t>(start.size()) &&
      std::string_view(start.data(), start.size()) == kMagic) {
    ASSIGN_OR_RETURN(auto backup, openForeign(path));
    AuditChain chain(backup);
    ASSIGN_OR_RETURN(const auto head, chain.head());
    ASSIGN_OR_RETURN(const auto first, chain.firstMac());
    return AuditAnchor{path.string(), head, first};
  }
  Lines lines(file, path);
  bool is_json = false;
  for (;;) {
    ASSIGN_OR_RETURN(const auto line, lines.next());
    if (!line) return noHead(path);
    const std::string_view text = trimmed(*line);
    if (text.empty()) continue;
    is_json = text.front() == '{';
    break;
  }
  RETURN_IF_ERROR(lines.rewind());
  ASSIGN_OR_RETURN(const auto head, is_json ? headOfRecords(lines, path) : headOfText(lines, path));
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
    // no backup, whatever its name is
    if (!anchor && anchor.error().code == ErrorCode::kInvalidInput) continue;
    if (!anchor) return anchor.error();
    anchors.push_back(std::move(*anchor));
  }
  if (anchors.empty())
    return Error{ErrorCode::kInvalidInput,
                 path.string() +
                     ": has no plain backup that is named by its time (needlelab-….db) and has a "
                     "chain; decrypt an encrypted one first"};
  return anchors;
}

}  // namespace needlelab
