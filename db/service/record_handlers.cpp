// Exports a person's data, or the whole store, as records; imports records.
#include <fmt/core.h>
#include <functional>
#include <optional>
#include <set>
#include <unordered_set>
#include <vector>

#include "common/base/text.h"
#include "common/profile/strict_json.h"
#include "db/attempt_sums.h"
#include "db/audit.h"
#include "db/audit_chain.h"
#include "db/connection.h"
#include "db/documents.h"
#include "db/erasure.h"
#include "db/service/export_ledger.h"
#include "db/service/handlers.h"
#include "db/service/import_erasures.h"
#include "db/service/import_rules.h"
#include "db/service/lesson_texts.h"
#include "db/service/record_tables.h"
#include "db/text_pages.h"
#include "db/unknown_trainees.h"

namespace needlelab::handlers {
namespace {

constexpr int kMostFaults = 100;
constexpr std::uint64_t kMostImportBytes = 512ull << 20;
constexpr std::string_view kNotHere = "imported without its recording";

/// The position of a page: after the row with these keys. Pages exclude rows added after the first page.
struct RecordPage {
  std::size_t table = 0;
  RecordJson keys;                 ///< null: from the table's first row
  std::int64_t last_session = 0;   ///< later rows were added after the first page
  std::vector<std::int64_t> open;  ///< sessions that were open: excluded, even if they are closed meanwhile
  std::uint64_t audit_id = 0;      ///< the audit log's last line at the start of the export
};

std::string placeOf(const RecordPage& page) {
  return RecordJson::array({page.table, page.keys, page.last_session, page.open, page.audit_id}).dump();
}

/// Parses only the output of placeOf() (ExportLedger).
RecordPage recordPageOf(const std::string& place) {
  const auto parts = RecordJson::parse(place);
  return {parts.at(0).get<std::size_t>(), parts.at(1), parts.at(2).get<std::int64_t>(),
          parts.at(3).get<std::vector<std::int64_t>>(), parts.at(4).get<std::uint64_t>()};
}

Result<RecordPage> firstPage(Connection& reader) {
  RecordPage page;
  {
    auto row = reader.prepare(
        "SELECT (SELECT coalesce(max(number), 0) FROM sessions), (SELECT coalesce(max(id), 0) FROM audit)");
    RETURN_IF_ERROR(row.step());
    page.last_session = row.integer(0);
    page.audit_id = row.natural(1);
  }
  auto open = reader.prepare("SELECT number FROM sessions WHERE state = 1");
  for (;;) {
    ASSIGN_OR_RETURN(const auto row, open.step());
    if (!row) return page;
    page.open.push_back(open.integer(0));
  }
}

/// Pages are read one after another: a change in rows that others refer to would make the whole export
/// impossible to import. kConflict.
Status sameAsBefore(Connection& reader, const RecordPage& page) {
  auto row = reader.query(
      "SELECT who, action, subject FROM audit WHERE id > ? AND action IN ('user add', 'user import', 'group "
      "set', 'group remove', 'person erase', 'station add', 'session assign', 'import-all') LIMIT 1",
      page.audit_id);
  ASSIGN_OR_RETURN(const auto found, row.step());
  if (!found) return {};
  return Error{ErrorCode::kConflict, "what is exported was changed meanwhile ('" + row.text(1) + "' by " +
                                         row.text(0) + "): begin again"};
}

/// A condition on a table's rows, for an export of the whole store.
std::string conditionOf(const RecordTable& table, const RecordPage& page) {
  // settings are not of sessions
  if (table.only.empty() || table.kind == "lab_setting") return std::string(table.only);
  std::string open;
  for (const std::int64_t number : page.open) open += (open.empty() ? "" : ",") + std::to_string(number);
  std::string then = fmt::format("number <= {}", page.last_session);
  if (!open.empty()) then += fmt::format(" AND number NOT IN ({})", open);
  if (table.kind == "session") return std::string(table.only) + " AND " + then;
  return std::string(table.only) + " AND session IN (SELECT number FROM sessions WHERE " + then + ")";
}

/// `person`: exports only this person's rows; nothing: all rows. `what` names the request, for its page
/// tokens.
Result<pb::Reply> recordsReply(const Context& context, const std::string& what, const std::string& given,
                               const std::string* person, bool secrets) {
  ASSIGN_OR_RETURN(const auto place, context.exports.open(context.who, what, given));
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  RecordPage page;
  if (place.empty()) {
    ASSIGN_OR_RETURN(auto first, firstPage(context.reader));
    page = first;
  } else {
    page = recordPageOf(place);
    if (person == nullptr) {
      RETURN_IF_ERROR(sameAsBefore(context.reader, page));
    }
  }
  pb::Reply reply;
  auto* list = reply.mutable_records();
  PageRoom room;
  RowsAtOnce at_once(kMaxReplyBytes);
  const auto tables = recordTables();
  for (; page.table < tables.size(); ++page.table, page.keys = nullptr) {
    const RecordTable& table = tables[page.table];
    if (person != nullptr && table.of_person.empty()) continue;
    const std::string where = person != nullptr ? std::string(table.of_person) : conditionOf(table, page);
    for (bool more = true; more;) {
      ASSIGN_OR_RETURN(
          auto rows, recordsAfter(context.reader, table, where, person, page.keys, secrets, at_once.count()));
      for (more = false; !more;) {
        ASSIGN_OR_RETURN(const auto row, rows.step());
        if (!row) break;
        const RecordJson record = recordOf(table, rows, secrets);
        std::string text = record.dump();
        if (!room.take(text.size() + 8)) {
          list->set_next_page(context.exports.seal(context.who, what, placeOf(page)));
          return reply;
        }
        page.keys = keysOf(table, record);
        more = at_once.took(text.size());
        list->add_records(std::move(text));
      }
    }
  }
  return reply;
}

/// An import of all records in one transaction of the writer.
class Import {
 public:
  Import(Connection& writer, pb::ImportReport& report, std::int64_t now_unix_ns, std::string importer,
         const pb::ImportAll& call)
      : writer_(writer),
        report_(report),
        now_unix_ns_(now_unix_ns),
        importer_(std::move(importer)),
        import_id_(call.import_id()),
        sums_(writer),
        numbers_(writer),
        rules_(writer, call.with_policies(), now_unix_ns) {}

  /// kFailed ends the import: the database failed. Faults of a record go into the report.
  Status take(const std::string& text) {
    ++number_;
    const auto record = readShallowJson<RecordJson>(text);
    const auto kind = record.is_object() && record.contains("kind") && record["kind"].is_string()
                          ? record["kind"].get<std::string>()
                          : std::string();
    const RecordTable* table = recordTable(kind);
    if (table == nullptr) {
      fault(kind, "is no record: a JSON object with a known \"kind\"");
      return {};
    }
    const auto done = store(*table, record);
    if (done) return {};
    if (writer_.damaged()) return done;
    // a row that PostgreSQL refuses ends what can be asked within the transaction
    const bool goes_on = writer_.sqlite() != nullptr || writer_.query("SELECT 1").step().ok();
    fault(kind, done.error().message +
                    (goes_on ? "" : ". The records behind it were not looked at: mend it and import again"));
    return goes_on ? Status() : done;
  }

  Status begin() {
    ASSIGN_OR_RETURN(auto erasures, ImportErasures::open(writer_));
    erasures_.emplace(std::move(erasures));
    return {};
  }

  /// For every record, before the first is taken.
  Status foresee(const std::string& text) { return erasures_->foresee(readShallowJson<RecordJson>(text)); }

  /// Stores the exercises of the courses' newest revisions; flags sessions of trainees whom nobody knew, and
  /// counts the attempts. Call it once all records are taken.
  Status finish() {
    for (const std::string& note : rules_.notes()) report_.add_notes(note);
    RETURN_IF_ERROR(flagUnknownTrainees());
    RETURN_IF_ERROR(sums_.count());
    RETURN_IF_ERROR(numbers_.finish());
    for (const std::string& id : courses_) {
      const auto course = CurriculumStore(writer_).get(id);
      if (!course) return course.error();
      const auto parsed =
          storedCurriculumOf(course->json, "course '" + id + "'", course->author, course->created_unix_ns);
      auto done = parsed ? CurriculumStore(writer_).setExercises(*parsed) : Status(parsed.error());
      if (!done && writer_.damaged()) return done;
      if (!done) fault("course", id + ": " + done.error().message);
    }
    return {};
  }

  /// For the audit log: what was left out of sessions that are here.
  [[nodiscard]] std::string leftOutText() const { return rules_.leftOutText(); }

 private:
  Status store(const RecordTable& table, RecordJson record) {
    // first: later code relies on the fields' types
    RETURN_IF_ERROR(checkFields(table, record));
    const bool secrets = record.contains("password_hash") || record.contains("key_hash");
    fillOlder(table, record, secrets);
    ASSIGN_OR_RETURN(const auto verdict, erasures_->look(table, record));
    if (verdict == ImportErasures::Verdict::kLeftOut) {
      count(table.kind).set_erased(count(table.kind).erased() + 1);
      return {};
    }
    if (table.kind == "audit") return storeLine(table, std::move(record));
    if (table.kind == "person" && record.contains("name") && record["name"].is_string())
      people_.insert(record["name"].get<std::string>());
    if (table.kind == "course" && record.contains("id") && record["id"].is_string())
      courses_.insert(record["id"].get<std::string>());
    ASSIGN_OR_RETURN(const auto there, storedRecord(writer_, table, record, secrets));
    // an import changes no mark that is here
    if (table.kind == "erasure" && !there.is_null()) record["without_account"] = there["without_account"];
    bool same = !there.is_null() && (there == record || erasures_->isErasuresWork(table, there, record));
    if (!same) {
      ASSIGN_OR_RETURN(const auto rule, rules_.look(table, record, there));
      if (rule == ImportRules::Verdict::kLeftOut) {
        (void)count(table.kind);  // the kind has its row, and its note
        return {};
      }
      same = there == record;
    }
    if (!there.is_null()) {
      // samples came with the program
      const bool sample =
          (table.kind == "profile" || table.kind == "course") && (there)["author"] == kSampleAuthor;
      if (same || !sample) {
        if (!same)
          return Error{ErrorCode::kAlreadyExists,
                       "differs from what is here: " + there.dump().substr(0, 200)};
        count(table.kind).set_unchanged(count(table.kind).unchanged() + 1);
        return {};
      }
      RETURN_IF_ERROR(removeRecord(writer_, table, record));
    }
    RETURN_IF_ERROR(checkRecord(table, record));
    const bool session = table.kind == "session";
    if (session) RETURN_IF_ERROR(sums_.willAdd(textIn(record, "exercise_id"), textIn(record, "trainee")));
    ASSIGN_OR_RETURN(const auto number, insertRecord(writer_, table, record, session ? "number" : ""));
    RETURN_IF_ERROR(rules_.noteStored(table, record));
    if (session) {
      new_sessions_.push_back({number, record["trainee"].get<std::string>()});
      RETURN_IF_ERROR(withoutRecording(number));
    }
    count(table.kind).set_added(count(table.kind).added() + 1);
    return {};
  }

  /// Stores a line of the audit log, unless it exists: under its number, or, when another line has that
  /// number, under a new one. Marks it as imported, whatever the record says of that: what the line tells is
  /// as true as its source.
  Status storeLine(const RecordTable& table, RecordJson record) {
    RETURN_IF_ERROR(readLines(table));
    const std::string text = lineText(record);
    if (lines_->contains(text)) {
      count(table.kind).set_unchanged(count(table.kind).unchanged() + 1);
      return {};
    }
    ASSIGN_OR_RETURN(const auto there, storedRecord(writer_, table, record, false));
    record["imported_by"] = importer_;
    record["imported_from"] = import_id_ + ", line " + record["id"].dump();
    // one that has another line's number gets the next one
    ASSIGN_OR_RETURN(
        const auto number,
        numbers_.next(there.is_null() ? std::optional(record["id"].get<std::int64_t>()) : std::nullopt));
    record["id"] = number ? RecordJson(*number) : RecordJson();
    ASSIGN_OR_RETURN(const auto id, insertRecord(writer_, table, record, "id"));
    RETURN_IF_ERROR(AuditChain(writer_).append(id));
    lines_->insert(text);
    count(table.kind).set_added(count(table.kind).added() + 1);
    return {};
  }

  /// The text of a line, without its number and the way that it came.
  static std::string lineText(RecordJson record) {
    for (const char* field : {"id", "imported_by", "imported_from"}) record.erase(field);
    return record.dump();
  }

  Status readLines(const RecordTable& table) {
    if (lines_) return {};
    lines_.emplace();
    RowsAtOnce at_once(kBytesOfPage);
    RecordJson keys;  // of the last line
    for (bool more = true; more;) {
      at_once.goOn();
      ASSIGN_OR_RETURN(auto rows, recordsAfter(writer_, table, "", nullptr, keys, false, at_once.count()));
      for (more = false; !more;) {
        ASSIGN_OR_RETURN(const auto row, rows.step());
        if (!row) break;
        RecordJson record = recordOf(table, rows, false);
        keys = keysOf(table, record);
        std::string text = lineText(std::move(record));
        more = at_once.took(text.size());
        lines_->insert(std::move(text));
      }
    }
    return {};
  }

  /// An export of schema 6 or later has a record for each session of an unknown trainee. For one of before,
  /// the rule of migration 0006 holds with the export's people: an account here may be another person's.
  Status flagUnknownTrainees() {
    for (const NewSession& session : new_sessions_) {
      if (people_.contains(session.trainee)) continue;
      ASSIGN_OR_RETURN(const bool flagged, UnknownTraineeStore(writer_).flagImported(session.number));
      if (flagged) count("unknown_trainee").set_added(count("unknown_trainee").added() + 1);
    }
    return {};
  }

  /// Chunks are not imported: the session becomes one whose recording was removed.
  Status withoutRecording(std::int64_t number) {
    RETURN_IF_ERROR(writer_.run("UPDATE sessions SET recording = 3 WHERE number = ?", number));
    return writer_.run(
        "INSERT INTO removed_originals (session, removed_unix_ns, deleted_unix_ns, reason, by_whom, "
        "leftover, crcs)"
        " SELECT number, ?1, ?1, ?2, 'import', 0, zeroblob(4 * chunks) FROM sessions WHERE number = ?3",
        now_unix_ns_, kNotHere, number);
  }

  struct NewSession {
    std::int64_t number = 0;
    std::string trainee;
  };

  pb::ImportReport::Count& count(std::string_view kind) {
    for (auto& one : *report_.mutable_counts()) {
      if (one.kind() == kind) return one;
    }
    auto* added = report_.add_counts();
    added->set_kind(std::string(kind));
    return *added;
  }

  void fault(const std::string& kind, const std::string& text) {
    auto& of_kind = count(kind.empty() ? "?" : kind);
    of_kind.set_faults(of_kind.faults() + 1);
    if (report_.faults_size() >= kMostFaults) return;
    auto* problem = report_.add_faults();
    problem->set_path(fmt::format("record {}{}", number_, (kind.empty() ? "" : " (" + kind + ")")));
    problem->set_message(printable(text));
  }

  Connection& writer_;
  pb::ImportReport& report_;
  const std::int64_t now_unix_ns_;
  const std::string importer_, import_id_;
  std::uint64_t number_ = 0;
  std::set<std::string> courses_, people_;  ///< by id and by name: in these records
  std::vector<NewSession> new_sessions_;
  SumsOfManySessions sums_;
  NumbersOfManyLines numbers_;
  ImportRules rules_;
  std::optional<ImportErasures> erasures_;  ///< set by begin()
  /// Of the audit log; read for the first imported line.
  std::optional<std::unordered_set<std::string>> lines_;
};

/// Calls `take` with each record of all pieces in order, one record per line.
Status eachRecord(Connection& writer, const std::string& import_id,
                  const std::function<Status(const std::string&)>& take) {
  struct Piece {
    std::int64_t position = 0;
    std::string records;
  };
  // one at a time: all together may have 512 MB
  for (std::int64_t after = INT64_MIN;;) {
    ASSIGN_OR_RETURN(const auto piece,
                     writer
                         .query("SELECT position, records FROM import_pieces WHERE import_id = ? AND"
                                " position > ? ORDER BY position LIMIT 1",
                                import_id, after)
                         .first([](const Statement& row) {
                           return Piece{row.integer(0), row.text(1)};
                         }));
    if (!piece) return {};
    after = piece->position;
    const std::string& records = piece->records;
    for (std::size_t at = 0; at < records.size();) {
      const std::size_t end = std::min(records.find('\n', at), records.size());
      if (end > at) {
        RETURN_IF_ERROR(take(records.substr(at, end - at)));
      }
      at = end + 1;
    }
  }
}

}  // namespace

Result<pb::Reply> exportPerson(const Context& context, const pb::ExportPerson& call) {
  const bool managed = context.who.role == pb::CURRICULUM_MANAGER || context.who.role == pb::ADMINISTRATOR;
  if (!managed && call.name() != context.who.name)
    return Error{ErrorCode::kDenied,
                 "all of a person's data is for that person, curriculum managers and administrators"};
  auto reply = recordsReply(context, "person " + call.name(), call.page(), &call.name(), false);
  if (!reply) return reply;
  if (call.page().empty() && reply->records().records().empty())
    return Error{ErrorCode::kNotFound,
                 "there is no person named '" + printable(call.name()) + "', and no data of one"};
  if (call.page().empty() && call.name() != context.who.name) {
    RETURN_IF_ERROR(write(context, call.name(), "", [](Connection&) { return Status(); }));
  }
  return reply;
}

Result<pb::Reply> exportAll(const Context& context, const pb::ExportAll& call) {
  if (call.page().empty()) {
    // the head in the export's own line is an anchor outside of this store
    std::string detail = call.with_passwords() ? "with hashes of passwords and keys; " : "";
    RETURN_IF_ERROR(write(context, "", detail, [&](Connection& writer) -> Status {
      ASSIGN_OR_RETURN(const auto head, AuditChain(writer).head());
      detail += auditHeadText(head);
      return {};
    }));
  }
  return recordsReply(context, call.with_passwords() ? "all with hashes" : "all", call.page(), nullptr,
                      call.with_passwords());
}

Result<pb::Reply> importAll(const Context& context, const pb::ImportAll& call) {
  RETURN_IF_ERROR(checkName("import_id", call.import_id()));
  std::string piece;
  for (const std::string& record : call.records()) {
    if (!isUtf8(record) || record.find('\n') != std::string::npos)
      return Error{ErrorCode::kInvalidInput, "records: each is one line of UTF-8"};
    piece += record + "\n";
  }
  pb::Reply reply;
  auto* report = reply.mutable_import_report();
  bool dropped_before = false;
  const Status written = context.writer.run([&](Connection& writer) -> Status {
    RETURN_IF_ERROR(checkAccess(writer, context.who));
    RETURN_IF_ERROR(dropOldImports(writer, context.now_unix_ns));
    auto row = writer.query(
        "SELECT count(*), coalesce(sum(length(records)), 0), coalesce(min(position), 0) FROM import_pieces"
        " WHERE import_id = ?",
        call.import_id());
    RETURN_IF_ERROR(row.step());
    dropped_before = row.integer(2) == kDroppedPieces;
    if (dropped_before) return {};  // what was dropped just now is written
    if (row.natural(1) + piece.size() > kMostImportBytes)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("records: more than {} MiB in one import: use a backup and restore",
                               kMostImportBytes >> 20)};
    return writer.run(
        "INSERT INTO import_pieces (import_id, position, records, by_whom, unix_ns) VALUES (?,?,?,?,?)",
        call.import_id(), row.integer(0), piece, context.who.name, context.now_unix_ns);
  });
  if (!written) return written.error();
  if (dropped_before)
    return Error{ErrorCode::kConflict,
                 "import_id: earlier pieces of this import are gone, because more than a day passed by the "
                 "server's clock, or somebody was erased meanwhile. Nothing of it was stored: begin again, "
                 "with another import_id"};
  if (!call.last()) return reply;

  std::string detail;
  const auto status = write(context, call.import_id(), detail, [&](Connection& writer) -> Status {
    Import batch(writer, *report, context.now_unix_ns, context.who.name, call);
    RETURN_IF_ERROR(batch.begin());
    RETURN_IF_ERROR(
        eachRecord(writer, call.import_id(), [&](const std::string& text) { return batch.foresee(text); }));
    RETURN_IF_ERROR(
        eachRecord(writer, call.import_id(), [&](const std::string& text) { return batch.take(text); }));
    RETURN_IF_ERROR(batch.finish());
    // rollback: the writer undoes a failed item
    if (!report->faults().empty() || call.dry_run()) return Error{ErrorCode::kInvalidInput, "not done"};
    for (const auto& count : report->counts())
      detail += fmt::format("{}{} of {}", (detail.empty() ? "" : ", "), count.added(), count.kind());
    detail += batch.leftOutText();
    return writer.run("DELETE FROM import_pieces WHERE import_id = ?", call.import_id());
  });
  report->set_done(status.ok());
  const bool by_plan = call.dry_run() || !report->faults().empty();
  Status dropped;
  if (!status)
    dropped = context.writer.run([&](Connection& writer) {
      return writer.run("DELETE FROM import_pieces WHERE import_id = ?", call.import_id());
    });
  // the pieces may name people whom this database has erased: the log must not keep them
  constexpr std::chrono::seconds kPatience{2};
  context.writer.emptyLog(kPatience);
  if (!status && !by_plan) return status.error();
  if (!dropped) return dropped.error();
  return reply;
}

}  // namespace needlelab::handlers
