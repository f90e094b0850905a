#include "db/service/audit_anchor.h"

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "db/backup.h"
#include "db/foreign_database.h"

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

Error noHead(const std::filesystem::path& path) {
  return {ErrorCode::kInvalidInput,
          path.string() +
              ": is neither a backup, nor an export of everything, nor a text with one line \"audit head "
              "…\" (decrypt an encrypted backup first)"};
}

/// JSON lines, or what `audit verify --json` wrote.
Result<AuditHead> headOfRecords(std::ifstream& in, const std::filesystem::path& path) {
  std::optional<AuditHead> found;
  std::string whole;
  bool lines = true;
  for (std::string line; std::getline(in, line);) {
    // one object over several lines is small
    constexpr std::size_t kMostWhole = 1u << 20;
    if (whole.size() < kMostWhole) whole += line + "\n";
    if (trimmed(line).empty()) continue;
    const Json record = Json::parse(line, nullptr, false);
    lines = lines && record.is_object();
    if (!lines) continue;
    // an export ends with its own line; of exports that were read in, earlier ones may be there
    if (const auto head = headOfExport(record)) found = head;
  }
  if (lines && found) return *found;
  const Json document = Json::parse(whole, nullptr, false);
  if (document.is_object()) {
    const auto rows = document.find("rows");
    if (rows != document.end() && rows->is_array() && rows->size() == 1 && rows->front().is_object())
      if (const auto head = auditHeadOf(textIn(rows->front(), "head"))) return *head;
  }
  return noHead(path);
}

/// A text that somebody kept: other lines are ignored, a head within a line is none.
Result<AuditHead> headOfText(std::ifstream& in, const std::filesystem::path& path) {
  std::optional<AuditHead> found;
  for (std::string line; std::getline(in, line);) {
    std::string_view text = trimmed(line);
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
  std::error_code unknown;
  if (!std::filesystem::is_regular_file(path, unknown)) return noHead(path);  // a pipe may never answer
  std::ifstream in(path, std::ios::binary);
  std::array<char, 16> start{};
  in.read(start.data(), start.size());
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  if (in && std::string_view(start.data(), start.size()) == kMagic) {
    ASSIGN_OR_RETURN(auto backup, openForeign(path));
    RETURN_IF_ERROR(requireAuditChain(backup));
    AuditChain chain(backup);
    ASSIGN_OR_RETURN(const auto head, chain.head());
    ASSIGN_OR_RETURN(const auto first, chain.firstMac());
    return AuditAnchor{path.string(), head, first};
  }
  in.clear();
  in.seekg(0);
  char first = '\0';
  in >> std::ws >> first;
  if (!in) return noHead(path);
  in.seekg(0);
  ASSIGN_OR_RETURN(const auto head, first == '{' ? headOfRecords(in, path) : headOfText(in, path));
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
    // from before schema 8: it has no chain
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
