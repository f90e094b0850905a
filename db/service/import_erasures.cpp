#include "db/service/import_erasures.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "db/audit.h"
#include "db/erasure.h"
#include "db/session_rows.h"

namespace needlelab {
namespace {

std::string textOfField(const RecordJson& record, const char* name) {
  const auto found = record.find(name);
  return found != record.end() && found->is_string() ? found->get<std::string>() : std::string();
}
std::int64_t timeOfField(const RecordJson& record, const char* name) {
  const auto found = record.find(name);
  return found != record.end() && found->is_number_integer() ? found->get<std::int64_t>() : 0;
}

/// The fields for the person who did something, and the time.
struct DoerField {
  const char* doer;
  const char* when;
};
constexpr DoerField kDoerFields[] = {{"changed_by", "changed_unix_ns"}, {"recorded_by", "unix_ns"},
                                     {"author", "created_unix_ns"},     {"by_whom", "created_unix_ns"},
                                     {"by_whom", "changed_unix_ns"},    {"by_whom", "erased_unix_ns"},
                                     {"by_whom", "assigned_unix_ns"}};

/// As clearOlderErasures(): an export by an earlier version has what it left in an erased session.
void clearErased(RecordJson& record) {
  if (textOfField(record, "profile_json") == kErasedProfile) return;
  record["profile_json"] = kErasedProfile;
  const auto bytes = bytesOfHex(textOfField(record, "description"));
  pb::SessionDescription description;
  if (!bytes || !description.ParseFromString(*bytes)) return;  // the import refuses it, or `check` says it
  clearDeviceWords(description);
  record["description"] = hexDigitsOf(description.SerializeAsString());
}

}  // namespace

Result<ImportErasures> ImportErasures::open(Connection& writer) {
  ImportErasures all(writer);
  const auto folder = writer.path().parent_path();
  ASSIGN_OR_RETURN(auto lines, readErasures(folder));
  all.lines_ = std::move(lines);
  auto rows = writer.prepare("SELECT pseudonym, name_hash, erased_unix_ns FROM erasures");
  for (;;) {
    ASSIGN_OR_RETURN(const auto row, rows.step());
    if (!row) break;
    ErasureLine line{rows.text(0), {}, rows.integer(2)};
    const auto bytes = rows.bytes(1);
    if (bytes.size() == line.name_hash.size()) {
      std::copy(bytes.begin(), bytes.end(), line.name_hash.begin());
      all.lines_.push_back(std::move(line));
    }
  }
  if (all.lines_.empty()) return all;
  ASSIGN_OR_RETURN(auto key, ErasureStore(writer).key());
  all.key_ = key;
  dropFaulty(all.lines_, key);
  return all;
}

void ImportErasures::foresee(const RecordJson& record) {
  const auto text = [&](const char* field) {
    const auto found = record.find(field);
    return found != record.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  if (!key_ || !record.is_object()) return;
  if (text("kind") == "unknown_trainee" && text("by_whom").empty()) waiting_.insert(text("session"));
  if (text("kind") == "erasure") exported_.insert(text("pseudonym"));
}

bool ImportErasures::wasLeft(const std::string& id_digits, const std::string& name,
                             const std::string& pseudonym) const {
  const bool account =
      std::any_of(met_.begin(), met_.end(), [&](const ErasedNames& names) { return names.name == name; });
  return waiting_.contains(id_digits) && (account || exported_.contains(pseudonym));
}

std::optional<std::string> ImportErasures::pseudonymOf(const std::string& name,
                                                       std::int64_t made_unix_ns) const {
  if (!key_ || name.empty()) return std::nullopt;
  const auto hash = key_->nameHash(name);
  for (const ErasureLine& line : lines_) {
    if (line.name_hash == hash && line.unix_ns >= made_unix_ns) return line.pseudonym;
  }
  return std::nullopt;
}

Result<bool> ImportErasures::isOfErasedSession(const std::string& id_digits) {
  const auto known = sessions_.find(id_digits);
  if (known != sessions_.end()) return known->second;
  const auto bytes = bytesOfHex(id_digits);
  if (!bytes) return false;
  auto row = writer_.query("SELECT erased FROM sessions WHERE id = ?", viewOf(*bytes));
  ASSIGN_OR_RETURN(const auto found, row.step());
  const bool erased = found && row.integer(0) != 0;
  sessions_.emplace(id_digits, erased);
  if (erased) session_texts_.insert(sessionText(*bytes));
  return erased;
}

Result<bool> ImportErasures::isOfErased(const RecordTable& table, const RecordJson& record) {
  const auto owner = [&](const char* name, const char* when) {
    return pseudonymOf(textOfField(record, name), timeOfField(record, when));
  };
  if (table.kind == "person") {
    const auto pseudonym = owner("name", "created_unix_ns");
    if (!pseudonym) return false;
    ErasedNames names{textOfField(record, "name"), {}, {}, *pseudonym, {}};
    if (const std::string full_name = textOfField(record, "full_name"); !full_name.empty())
      names.full_names.push_back(full_name);
    RETURN_IF_ERROR(addOthers(writer_, names));
    met_.push_back(std::move(names));
    return true;
  }
  if (table.kind == "consent") return owner("person", "unix_ns").has_value();
  if (table.kind == "assignment") return owner("trainee", "created_unix_ns").has_value();
  if (table.kind == "group_member") {
    // the record has no time: decide by whether the person existed before it
    const std::string name = textOfField(record, "person");
    return std::any_of(met_.begin(), met_.end(), [&](const auto& names) { return names.name == name; });
  }
  if (table.kind == "session") {
    const std::string id = textOfField(record, "id");
    const auto pseudonym = owner("trainee", "received_unix_ns");
    const bool erased = pseudonym && !wasLeft(id, textOfField(record, "trainee"), *pseudonym);
    if (!erased && timeOfField(record, "erased") != 0) return false;  // an exported pseudonym
    if (erased) {
      sessions_[id] = true;
      owners_[id] = textOfField(record, "trainee");
      if (const auto bytes = bytesOfHex(id)) session_texts_.insert(sessionText(*bytes));
      return true;
    }
    return isOfErasedSession(id);
  }
  if (table.kind == "unknown_trainee") {
    if (const auto owner_of = owners_.find(textOfField(record, "session")); owner_of != owners_.end()) {
      for (ErasedNames& names : met_)
        if (names.name == owner_of->second) names.given.push_back(textOfField(record, "given"));
    }
  }
  if (record.contains("session") && (table.kind == "score" || table.kind == "event" ||
                                     table.kind == "annotation" || table.kind == "unknown_trainee"))
    return isOfErasedSession(textOfField(record, "session"));
  return false;
}

void ImportErasures::replaceDoer(RecordJson& record, const char* doer, const char* when) const {
  if (!record.contains(doer) || !record.contains(when)) return;
  if (const auto pseudonym = pseudonymOf(textOfField(record, doer), timeOfField(record, when)))
    record[doer] = *pseudonym;
}

Status ImportErasures::replaceGiven(RecordJson& record) {
  const auto bytes = bytesOfHex(textOfField(record, "session"));
  if (!bytes) return {};
  ASSIGN_OR_RETURN(const auto received_unix_ns,
                   writer_.query("SELECT received_unix_ns FROM sessions WHERE id = ?", viewOf(*bytes))
                       .first([](const Statement& row) { return row.integer(0); }));
  if (!received_unix_ns) return {};  // the import says that it is not there
  const auto pseudonym = pseudonymOf(textOfField(record, "given"), *received_unix_ns);
  if (!pseudonym) return {};
  if (wasLeft(textOfField(record, "session"), textOfField(record, "given"), *pseudonym)) return {};
  // remarks and lines of the audit log, which come later, may have it too
  ErasedNames names{textOfField(record, "given"), {}, {}, *pseudonym, {}};
  RETURN_IF_ERROR(addOthers(writer_, names));
  met_.push_back(std::move(names));
  record["given"] = *pseudonym;
  return {};
}

Result<ImportErasures::Verdict> ImportErasures::look(const RecordTable& table, RecordJson& record) {
  if (table.kind == "session" && timeOfField(record, "erased") != 0) clearErased(record);
  if (!key_) return Verdict::kTake;
  ASSIGN_OR_RETURN(const auto left_out, isOfErased(table, record));
  if (left_out) return Verdict::kLeftOut;
  for (const DoerField& field : kDoerFields) replaceDoer(record, field.doer, field.when);
  if (table.kind == "unknown_trainee") RETURN_IF_ERROR(replaceGiven(record));
  if (table.kind == "annotation") {
    for (const ErasedNames& names : met_)
      record["text"] = withoutNames(textOfField(record, "text"), names, false);
  }
  if (table.kind == "group") {
    for (const ErasedNames& names : met_)
      if (pseudonymOf(names.name, timeOfField(record, "changed_unix_ns")))
        record["name"] = withoutNames(textOfField(record, "name"), names, false);
  }
  if (table.kind == "audit") {
    AuditRow line{0,
                  timeOfField(record, "unix_ns"),
                  textOfField(record, "who"),
                  textOfField(record, "action"),
                  textOfField(record, "subject"),
                  textOfField(record, "detail")};
    for (const ErasedNames& names : met_) {
      if (pseudonymOf(names.name, line.unix_ns)) line = withoutNames(line, names, session_texts_);
    }
    // an erased person without a record in this import, as far as the line shows it
    for (std::string* name : {&line.who, &line.subject}) {
      const auto pseudonym = pseudonymOf(*name, line.unix_ns);
      if (!pseudonym) continue;
      const ErasedNames names{*name, {}, {}, *pseudonym, {}};
      line = withoutNames(line, names, session_texts_);
    }
    record["who"] = line.who;
    record["subject"] = line.subject;
    record["detail"] = line.detail;
  }
  return Verdict::kTake;
}

bool ImportErasures::isErasuresWork(const RecordTable& table, const RecordJson& there,
                                    const RecordJson& record) const {
  if (!key_) return false;
  RecordJson a = there, b = record;
  // a removed member gives the group another revision; a remark and a group's name have a pseudonym in place
  // of a name
  if (table.kind == "group" && timeOfField(a, "revision") > timeOfField(b, "revision")) {
    a["revision"] = b["revision"];
    if (textOfField(a, "name").find("erased-") != std::string::npos) a["name"] = b["name"];
  }
  if (table.kind == "annotation" && textOfField(a, "text").find("erased-") != std::string::npos)
    a["text"] = b["text"];
  if (table.kind == "unknown_trainee" && textOfField(a, "given").starts_with("erased-"))
    a["given"] = b["given"];
  return a == b;
}

}  // namespace needlelab
