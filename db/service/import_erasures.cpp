#include "db/service/import_erasures.h"

#include <fmt/core.h>
#include <algorithm>
#include <set>
#include <string_view>
#include <utility>

#include "common/base/text.h"
#include "db/audit.h"
#include "db/erasure.h"
#include "db/session_rows.h"
#include "db/session_words.h"

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

/// As in withoutNames().
constexpr std::string_view kBetweenWords = " ,";

/// Of an erased session nothing is kept that its station wrote.
void clearErased(RecordJson& record) {
  if (textOfField(record, "profile_json") == kErasedProfile) return;
  record["profile_json"] = kErasedProfile;
  const auto bytes = bytesOfHex(textOfField(record, "description"));
  pb::SessionDescription description;
  if (!bytes || !description.ParseFromString(*bytes)) return;  // the import refuses it, or `check` says it
  clearStationWords(description);
  record["description"] = hexDigitsOf(description.SerializeAsString());
}

}  // namespace

Result<ImportErasures> ImportErasures::open(Connection& writer) {
  ImportErasures all(writer);
  const auto folder = writer.path().parent_path();
  ASSIGN_OR_RETURN(auto lines, readErasures(folder));
  all.lines_ = std::move(lines);
  // only the list says for certain that nobody had a name: the database may have it from an older export
  std::set<std::string> typed;
  for (const ErasureLine& line : all.lines_)
    if (line.without_account) typed.insert(line.pseudonym);
  std::vector<ErasureLine> known;  // whose lines have no MAC
  auto rows = writer.prepare("SELECT pseudonym, name_hash, erased_unix_ns FROM erasures");
  for (;;) {
    ASSIGN_OR_RETURN(const auto row, rows.step());
    if (!row) break;
    ErasureLine line{rows.text(0), {}, rows.integer(2)};
    line.without_account = typed.contains(line.pseudonym);
    const auto bytes = rows.bytes(1);
    if (bytes.size() == line.name_hash.size()) {
      std::copy(bytes.begin(), bytes.end(), line.name_hash.begin());
      known.push_back(std::move(line));
    }
  }
  if (all.lines_.empty() && known.empty()) return all;
  ASSIGN_OR_RETURN(auto key, ErasureStore(writer).key());
  all.key_ = key;
  dropFaulty(all.lines_, key);
  all.lines_.insert(all.lines_.end(), std::move_iterator(known.begin()), std::move_iterator(known.end()));
  for (std::size_t i = 0; i < all.lines_.size(); ++i) all.lines_of_[all.lines_[i].name_hash].push_back(i);
  return all;
}

Status ImportErasures::foresee(const RecordJson& record) {
  const auto text = [&](const char* field) {
    const auto found = record.find(field);
    return found != record.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  if (!key_ || !record.is_object()) return {};
  const std::string kind = text("kind");
  if (kind == "unknown_trainee" && text("by_whom").empty()) waiting_.insert(text("session"));
  if (kind == "erasure") exported_.insert(text("pseudonym"));
  if (kind == "person" && wasErased(text("name"))) {
    const std::string name = text("name"), full_name = text("full_name");
    accounts_.insert(name);
    RETURN_IF_ERROR(expect(name, name));
    RETURN_IF_ERROR(expect(full_name, name));
    for (std::size_t at = 0; at < full_name.size();) {
      const std::size_t end = std::min(full_name.find_first_of(kBetweenWords, at), full_name.size());
      RETURN_IF_ERROR(expect(full_name.substr(at, end - at), name));
      at = end + 1;
    }
  }
  if (kind == "session" && wasErased(text("trainee"))) perhaps_owners_[text("id")] = text("trainee");
  if (kind == "unknown_trainee") {
    const std::string given = text("given");
    if (wasErased(given)) RETURN_IF_ERROR(expect(given, given));
    if (const auto owner = perhaps_owners_.find(text("session")); owner != perhaps_owners_.end())
      RETURN_IF_ERROR(expect(given, owner->second));
  }
  return {};
}

bool ImportErasures::wasErased(const std::string& name) const {
  return !name.empty() && lines_of_.contains(key_->nameHash(name));
}

Status ImportErasures::expect(const std::string& word, const std::string& person) {
  // a word takes some hundred times its bytes
  constexpr std::size_t kMostBytes = 1 << 20;
  if (word.size() <= kMostBytes - index_bytes_) {
    if (index_.add(word, person)) index_bytes_ += word.size();
    return {};
  }
  return Error{ErrorCode::kInvalidInput,
               fmt::format("records: the different names that they have for people who were erased here take "
                           "more than {} bytes: that is no export of a lab. Import people by people",
                           kMostBytes)};
}

void ImportErasures::meet(const std::string& name, const ErasureLine& erasure) {
  met_.try_emplace(name, Person{met_.size(), erasure.pseudonym, erasure.without_account, {}, {}});
}

template <typename Replace>
Status ImportErasures::eachNamedIn(const RecordTable& table, const std::string& text,
                                   const Replace& replace) {
  struct Found {
    const std::string* name;
    const Person* person;
    const std::set<std::string>* words;
  };
  const auto owners = index_.in(text);
  std::vector<Found> found;
  for (const auto& [name, words] : owners)
    if (const auto met = met_.find(name); met != met_.end()) found.push_back({&name, &met->second, &words});
  if (found.empty()) return {};
  const auto [of_kind, is_new] = names_.try_emplace(table.kind);
  ErasedNames& names = of_kind->second;
  if (is_new) {
    ASSIGN_OR_RETURN(auto others, namesOfStore(writer_, true));
    std::erase_if(others, [&](const std::string& other) { return index_.in(other).empty(); });
    names.others = OtherNames(std::move(others));
  }
  std::sort(found.begin(), found.end(),
            [](const Found& a, const Found& b) { return a.person->number < b.person->number; });
  for (const Found& one : found) {
    names.name = *one.name;
    names.in_its_place = one.person->pseudonym;
    names.typed = one.person->typed;
    names.full_names.assign(one.person->full_names.begin(), one.person->full_names.end());
    names.given.clear();
    for (const std::string& word : *one.words)
      if (one.person->given.contains(word)) names.given.push_back(word);
    ++replaced_;
    replace(names);
  }
  return {};
}

bool ImportErasures::wasLeft(const std::string& id_digits, const std::string& name,
                             const std::string& pseudonym) const {
  return waiting_.contains(id_digits) && (met_.contains(name) || exported_.contains(pseudonym));
}

const ErasureLine* ImportErasures::erasureOf(const std::string& name, std::int64_t made_unix_ns,
                                             Whose whose) const {
  if (!key_ || name.empty()) return nullptr;
  const auto lines = lines_of_.find(key_->nameHash(name));
  if (lines == lines_of_.end()) return nullptr;
  for (const std::size_t i : lines->second)
    if (lines_[i].unix_ns >= made_unix_ns && (whose == Whose::kAnybodys || !lines_[i].without_account))
      return &lines_[i];
  return nullptr;
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
  const auto owner = [&](const char* name, const char* when, Whose whose = Whose::kAccounts) {
    return erasureOf(textOfField(record, name), timeOfField(record, when), whose);
  };
  if (table.kind == "person") {
    const ErasureLine* const erasure = owner("name", "created_unix_ns");
    if (erasure == nullptr) return false;
    const std::string name = textOfField(record, "name"), full_name = textOfField(record, "full_name");
    meet(name, *erasure);
    // an export has each person once
    constexpr std::size_t kMostFullNames = 16;
    auto& full_names = met_.at(name).full_names;
    if (!full_name.empty() && full_names.size() < kMostFullNames) full_names.insert(full_name);
    return true;
  }
  if (table.kind == "consent") return owner("person", "unix_ns") != nullptr;
  if (table.kind == "assignment") return owner("trainee", "created_unix_ns") != nullptr;
  if (table.kind == "group_member") {
    // the record has no time: decide by whether the person existed before it
    return met_.contains(textOfField(record, "person"));
  }
  if (table.kind == "session") {
    const std::string id = textOfField(record, "id"), trainee = textOfField(record, "trainee");
    const ErasureLine* const erasure = owner(
        "trainee", "received_unix_ns", accounts_.contains(trainee) ? Whose::kAccounts : Whose::kAnybodys);
    const bool erased = erasure != nullptr && !wasLeft(id, trainee, erasure->pseudonym);
    if (!erased && timeOfField(record, "erased") != 0) return false;  // an exported pseudonym
    if (erased) {
      sessions_[id] = true;
      owners_[id] = trainee;
      if (const auto bytes = bytesOfHex(id)) session_texts_.insert(sessionText(*bytes));
      return true;
    }
    return isOfErasedSession(id);
  }
  if (table.kind == "unknown_trainee") {
    if (const auto owner_of = owners_.find(textOfField(record, "session")); owner_of != owners_.end()) {
      if (const auto met = met_.find(owner_of->second); met != met_.end())
        met->second.given.insert(lowerCase(textOfField(record, "given")));
    }
  }
  if (record.contains("session") && (table.kind == "score" || table.kind == "event" ||
                                     table.kind == "annotation" || table.kind == "unknown_trainee"))
    return isOfErasedSession(textOfField(record, "session"));
  return false;
}

void ImportErasures::replaceDoer(RecordJson& record, const char* doer, const char* when) const {
  if (!record.contains(doer) || !record.contains(when)) return;
  if (const ErasureLine* const erasure =
          erasureOf(textOfField(record, doer), timeOfField(record, when), Whose::kAccounts))
    record[doer] = erasure->pseudonym;
}

Status ImportErasures::replaceGiven(RecordJson& record) {
  const auto bytes = bytesOfHex(textOfField(record, "session"));
  if (!bytes) return {};
  ASSIGN_OR_RETURN(const auto received_unix_ns,
                   writer_.query("SELECT received_unix_ns FROM sessions WHERE id = ?", viewOf(*bytes))
                       .first([](const Statement& row) { return row.integer(0); }));
  if (!received_unix_ns) return {};  // the import says that it is not there
  const std::string given = textOfField(record, "given");
  const ErasureLine* const erasure = erasureOf(given, *received_unix_ns);
  if (erasure == nullptr || wasLeft(textOfField(record, "session"), given, erasure->pseudonym)) return {};
  // remarks and lines of the audit log, which come later, may have it too
  meet(given, *erasure);
  record["given"] = erasure->pseudonym;
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
    std::string text = textOfField(record, "text");
    RETURN_IF_ERROR(eachNamedIn(table, textOfField(record, "text"),
                                [&](const ErasedNames& names) { text = withoutNames(text, names, false); }));
    record["text"] = text;
  }
  if (table.kind == "group") {
    std::string name = textOfField(record, "name");
    RETURN_IF_ERROR(eachNamedIn(table, textOfField(record, "name"), [&](const ErasedNames& names) {
      if (erasureOf(names.name, timeOfField(record, "changed_unix_ns")) != nullptr)
        name = withoutNames(name, names, false);
    }));
    record["name"] = name;
  }
  if (table.kind == "audit") {
    AuditRow line{0,
                  timeOfField(record, "unix_ns"),
                  textOfField(record, "who"),
                  textOfField(record, "action"),
                  textOfField(record, "subject"),
                  textOfField(record, "detail")};
    const std::string text = line.who + "\n" + line.subject + "\n" + line.detail;
    RETURN_IF_ERROR(eachNamedIn(table, text, [&](const ErasedNames& names) {
      if (erasureOf(names.name, line.unix_ns) != nullptr) line = withoutNames(line, names, session_texts_);
    }));
    // an erased person without a record in this import, as far as the line shows it
    for (std::string* name : {&line.who, &line.subject}) {
      const ErasureLine* const erasure = erasureOf(*name, line.unix_ns);
      if (erasure == nullptr) continue;
      const ErasedNames names{*name, {}, {}, erasure->pseudonym, {}, erasure->without_account};
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
