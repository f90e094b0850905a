#include "db/service/import_erasures.h"

#include <algorithm>

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

/// Who did something, and when.
struct DoerField {
  const char* doer;
  const char* when;
};
constexpr DoerField kDoerFields[] = {{"changed_by", "changed_unix_ns"}, {"recorded_by", "unix_ns"},
                                     {"author", "created_unix_ns"},     {"by_whom", "created_unix_ns"},
                                     {"by_whom", "changed_unix_ns"},    {"by_whom", "erased_unix_ns"}};

}  // namespace

Result<ImportErasures> ImportErasures::open(Connection& writer) {
  ImportErasures all(writer);
  const auto folder = writer.path().parent_path();
  auto lines = readErasures(folder);
  if (!lines) return lines.error();
  all.lines_ = std::move(*lines);
  auto rows = writer.prepare("SELECT pseudonym, name_hash, erased_unix_ns FROM erasures");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) break;
    ErasureLine line{rows.text(0), {}, rows.integer(2)};
    const auto bytes = rows.bytes(1);
    if (bytes.size() == line.name_hash.size()) {
      std::copy(bytes.begin(), bytes.end(), line.name_hash.begin());
      all.lines_.push_back(std::move(line));
    }
  }
  if (all.lines_.empty()) return all;
  auto key = ErasureStore(writer).key();
  if (!key) return key.error();
  all.key_ = *key;
  return all;
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
  const auto found = row.step();
  if (!found) return found.error();
  const bool erased = *found && row.integer(0) != 0;
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
    ErasedNames names{textOfField(record, "name"), {}, {}, *pseudonym};
    if (const std::string full_name = textOfField(record, "full_name"); !full_name.empty())
      names.full_names.push_back(full_name);
    if (auto done = addOthers(writer_, names); !done) return done.error();
    met_.push_back(std::move(names));
    return true;
  }
  if (table.kind == "consent") return owner("person", "unix_ns").has_value();
  if (table.kind == "assignment") return owner("trainee", "created_unix_ns").has_value();
  if (table.kind == "group_member") {
    // it has no time: whether the person is one of those who came before it
    const std::string name = textOfField(record, "person");
    return std::any_of(met_.begin(), met_.end(), [&](const auto& names) { return names.name == name; });
  }
  if (table.kind == "session") {
    const std::string id = textOfField(record, "id");
    const bool erased = owner("trainee", "started_unix_ns").has_value();
    if (!erased && timeOfField(record, "erased") != 0) return false;  // a pseudonym's, as it was exported
    if (erased) {
      sessions_[id] = true;
      if (const auto bytes = bytesOfHex(id)) session_texts_.insert(sessionText(*bytes));
      return true;
    }
    return isOfErasedSession(id);
  }
  if (record.contains("session") &&
      (table.kind == "score" || table.kind == "event" || table.kind == "annotation"))
    return isOfErasedSession(textOfField(record, "session"));
  return false;
}

void ImportErasures::replaceDoer(RecordJson& record, const char* doer, const char* when) const {
  if (!record.contains(doer) || !record.contains(when)) return;
  if (const auto pseudonym = pseudonymOf(textOfField(record, doer), timeOfField(record, when)))
    record[doer] = *pseudonym;
}

Result<ImportErasures::Verdict> ImportErasures::look(const RecordTable& table, RecordJson& record) {
  if (!key_) return Verdict::kTake;
  const auto left_out = isOfErased(table, record);
  if (!left_out) return left_out.error();
  if (*left_out) return Verdict::kLeftOut;
  for (const DoerField& field : kDoerFields) replaceDoer(record, field.doer, field.when);
  if (table.kind == "annotation") {
    for (const ErasedNames& names : met_)
      record["text"] = withoutNames(textOfField(record, "text"), names, false);
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
    // of somebody whose own record is not in this import, as far as a line says so
    for (std::string* name : {&line.who, &line.subject}) {
      const auto pseudonym = pseudonymOf(*name, line.unix_ns);
      if (!pseudonym) continue;
      const ErasedNames names{*name, {}, {}, *pseudonym};
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
  // a group whose member went has another revision; a remark has a pseudonym where a name stood
  if (table.kind == "group" && timeOfField(a, "revision") > timeOfField(b, "revision"))
    a["revision"] = b["revision"];
  if (table.kind == "annotation" && textOfField(a, "text").find("erased-") != std::string::npos)
    a["text"] = b["text"];
  return a == b;
}

}  // namespace needlelab
