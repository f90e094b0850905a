// A person's data, and everything, as records; everything read in again.
#include <map>
#include <set>

#include "base/text_rules.h"
#include "db/audit_store.h"
#include "db/curriculum_store.h"
#include "service/handlers.h"
#include "service/lesson_texts.h"
#include "service/page.h"
#include "service/record_tables.h"

namespace needlelab::handlers {
namespace {

constexpr int kMostFaults = 100;
constexpr std::uint64_t kMostImportBytes = 512ull << 20;
constexpr std::int64_t kPieceLife_ns = 86'400LL * 1'000'000'000;
constexpr std::string_view kNotHere = "imported without its recording";

/// "table:row", where a page goes on.
struct RecordPage {
  std::size_t table = 0;
  std::uint64_t row = 0;
};

Result<RecordPage> recordPageOf(const std::string& page) {
  const std::size_t colon = page.find(':');
  if (page.empty()) return RecordPage{};
  const auto table = numberOfPage(page.substr(0, colon));
  const auto row = numberOfPage(colon == std::string::npos ? "x" : page.substr(colon + 1));
  if (!table) return table.error();
  if (!row) return row.error();
  return RecordPage{*table, *row};
}

/// `person`: only what is theirs; nothing: all.
Result<pb::Reply> recordsReply(const Context& context, const std::string& page, const std::string* person,
                               bool secrets) {
  const auto from = recordPageOf(page);
  if (!from) return from.error();
  pb::Reply reply;
  auto* list = reply.mutable_records();
  PageRoom room;
  const auto tables = recordTables();
  for (std::size_t i = from->table; i < tables.size(); ++i) {
    const RecordTable& table = tables[i];
    if (person != nullptr && table.of_person.empty()) continue;
    const std::uint64_t first = i == from->table ? from->row : 0;
    auto rows = context.reader.prepare(
        selectRecords(table, person != nullptr ? table.of_person : table.only, secrets) +
        (person != nullptr ? " LIMIT -1 OFFSET ?2" : " LIMIT -1 OFFSET ?"));
    if (person != nullptr) rows.bind(*person);
    rows.bind(first);
    for (std::uint64_t at = first;; ++at) {
      const auto row = rows.step();
      if (!row) return row.error();
      if (!*row) break;
      std::string record = recordOf(table, rows, secrets).dump();
      if (!room.take(record.size() + 8)) {
        list->set_next_page(std::to_string(i) + ":" + std::to_string(at));
        return reply;
      }
      list->add_records(std::move(record));
    }
  }
  return reply;
}

/// Everything at once, in the writer's transaction.
class Import {
 public:
  Import(Connection& writer, pb::ImportReport& report, std::int64_t now_unix_ns)
      : writer_(writer), report_(report), now_unix_ns_(now_unix_ns) {}

  /// kFailed ends it: the database. What is wrong with a record stands in the report.
  Status take(const std::string& text) {
    ++number_;
    const auto record = RecordJson::parse(text, nullptr, false);
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
    fault(kind, done.error().message);
    return {};
  }

  /// The exercises of courses' newest revisions.
  Status finish() {
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

 private:
  Status store(const RecordTable& table, const RecordJson& record) {
    if (table.kind == "course") courses_.insert(record.value("id", std::string()));
    const bool secrets = record.contains("password_hash") || record.contains("key_hash");
    const auto there = storedRecord(writer_, table, record, secrets);
    if (!there) return there.error();
    if (!there->is_null()) {
      // the log of this store is its own; samples came with the program
      const bool same = *there == record || table.kind == "audit";
      const bool sample =
          (table.kind == "profile" || table.kind == "course") && (*there)["author"] == kSampleAuthor;
      if (same || !sample) {
        if (!same)
          return Error{ErrorCode::kAlreadyExists,
                       "differs from what is here: " + there->dump().substr(0, 200)};
        count(table.kind).set_unchanged(count(table.kind).unchanged() + 1);
        return {};
      }
      if (auto done = removeRecord(writer_, table, record); !done) return done;
    }
    if (auto valid = validate(table, record); !valid) return valid;
    if (auto done = insertRecord(writer_, table, record); !done) return done;
    if (table.kind == "session") {
      if (auto done = withoutRecording(record); !done) return done;
    }
    count(table.kind).set_added(count(table.kind).added() + 1);
    return {};
  }

  /// What the schema cannot say.
  static Status validate(const RecordTable& table, const RecordJson& record) {
    // a person's own export holds open sessions, too; their chunks are still with their station
    if (table.kind == "session" && record.value("state", RecordJson()) == 1)
      return Error{ErrorCode::kInvalidInput,
                   "state: is 1, an open session: only closed ones can be imported"};
    for (const char* name : {"name", "id"}) {
      if (table.kind != "person" && table.kind != "group" && table.kind != "station") break;
      if (record.contains(name) && record[name].is_string() &&
          (table.kind != "group" || std::string(name) == "id")) {
        if (auto valid = checkName(name, record[name].get<std::string>()); !valid) return valid;
      }
    }
    if (table.kind == "profile" || table.kind == "course") {
      const std::string json = record.value("json", std::string()), id = record.value("id", std::string());
      if (table.kind == "profile") {
        const auto profile = storedProfileOf(json, "json", "", 0);
        if (!profile) return profile.error();
        if (profile->id != id || profile->json != json)
          return Error{ErrorCode::kInvalidInput, "json: is not canonical, or has another id"};
      } else {
        const auto course = storedCurriculumOf(json, "json", "", 0);
        if (!course) return course.error();
        if (course->id != id || course->json != json)
          return Error{ErrorCode::kInvalidInput, "json: is not canonical, or has another id"};
      }
    }
    return {};
  }

  /// Its chunks are elsewhere: here it is one whose recording is gone.
  Status withoutRecording(const RecordJson& record) {
    if (auto done = writer_.run("UPDATE sessions SET recording = 3 WHERE number = ?", writer_.lastRowId());
        !done)
      return done;
    return writer_.run(
        "INSERT INTO removed_originals (session, removed_unix_ns, deleted_unix_ns, reason, by_whom, "
        "leftover, crcs)"
        " SELECT number, ?1, ?1, ?2, 'import', 0, zeroblob(4 * chunks) FROM sessions WHERE lower(hex(id)) = "
        "?3",
        now_unix_ns_, kNotHere, record["id"].get<std::string>());
  }

  pb::ImportReport::Count& count(std::string_view kind) {
    for (auto& one : *report_.mutable_counts()) {
      if (one.kind() == kind) return one;
    }
    auto* added = report_.add_counts();
    added->set_kind(std::string(kind));
    return *added;
  }

  void fault(const std::string& kind, const std::string& words) {
    auto& of_kind = count(kind.empty() ? "?" : kind);
    of_kind.set_faults(of_kind.faults() + 1);
    if (report_.faults_size() >= kMostFaults) return;
    auto* problem = report_.add_faults();
    problem->set_path("record " + std::to_string(number_) + (kind.empty() ? "" : " (" + kind + ")"));
    problem->set_message(printable(words));
  }

  Connection& writer_;
  pb::ImportReport& report_;
  const std::int64_t now_unix_ns_;
  std::uint64_t number_ = 0;
  std::set<std::string> courses_;
};

/// All pieces, in order, a record a line.
Status takePieces(Connection& writer, const std::string& import_id, Import& import) {
  auto pieces =
      writer.query("SELECT records FROM import_pieces WHERE import_id = ? ORDER BY position", import_id);
  for (;;) {
    const auto row = pieces.step();
    if (!row) return row.error();
    if (!*row) return {};
    const std::string records = pieces.text(0);
    for (std::size_t at = 0; at < records.size();) {
      const std::size_t end = std::min(records.find('\n', at), records.size());
      if (end > at) {
        if (auto done = import.take(records.substr(at, end - at)); !done) return done;
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
  auto reply = recordsReply(context, call.page(), &call.name(), false);
  if (!reply) return reply;
  if (call.page().empty() && reply->records().records().empty())
    return Error{ErrorCode::kNotFound,
                 "there is no person named '" + printable(call.name()) + "', and no data of one"};
  if (call.page().empty() && call.name() != context.who.name) {
    if (auto noted = write(context, call.name(), "", [](Connection&) { return Status(); }); !noted)
      return noted.error();
  }
  return reply;
}

Result<pb::Reply> exportAll(const Context& context, const pb::ExportAll& call) {
  if (call.page().empty()) {
    const auto noted = write(context, "", call.with_passwords() ? "with hashes of passwords and keys" : "",
                             [](Connection&) { return Status(); });
    if (!noted) return noted.error();
  }
  return recordsReply(context, call.page(), nullptr, call.with_passwords());
}

Result<pb::Reply> importAll(const Context& context, const pb::ImportAll& call) {
  if (auto valid = checkName("import_id", call.import_id()); !valid) return valid.error();
  std::string piece;
  for (const std::string& record : call.records()) {
    if (!isUtf8(record) || record.find('\n') != std::string::npos)
      return Error{ErrorCode::kInvalidInput, "records: each is one line of UTF-8"};
    piece += record + "\n";
  }
  pb::Reply reply;
  auto* report = reply.mutable_import_report();
  const auto staged = context.writer.run([&](Connection& writer) -> Status {
    if (auto done =
            writer.run("DELETE FROM import_pieces WHERE unix_ns < ?", context.now_unix_ns - kPieceLife_ns);
        !done)
      return done;
    auto row = writer.query(
        "SELECT count(*), coalesce(sum(length(records)), 0) FROM import_pieces WHERE import_id = ?",
        call.import_id());
    const auto found = row.step();
    if (!found) return found.error();
    if (row.natural(1) + piece.size() > kMostImportBytes)
      return Error{ErrorCode::kInvalidInput, "records: more than " + std::to_string(kMostImportBytes >> 20) +
                                                 " MiB in one import: use a backup and restore"};
    return writer.run(
        "INSERT INTO import_pieces (import_id, position, records, by_whom, unix_ns) VALUES (?,?,?,?,?)",
        call.import_id(), row.integer(0), piece, context.who.name, context.now_unix_ns);
  });
  if (!staged) return staged.error();
  if (!call.last()) return reply;

  std::string detail;
  const auto status = write(context, call.import_id(), detail, [&](Connection& writer) -> Status {
    Import import(writer, *report, context.now_unix_ns);
    if (auto done = takePieces(writer, call.import_id(), import); !done) return done;
    if (auto done = import.finish(); !done) return done;
    // undone: the writer takes back what fails
    if (!report->faults().empty() || call.dry_run()) return Error{ErrorCode::kInvalidInput, "not done"};
    for (const auto& count : report->counts())
      detail += (detail.empty() ? "" : ", ") + std::to_string(count.added()) + " of " + count.kind();
    return writer.run("DELETE FROM import_pieces WHERE import_id = ?", call.import_id());
  });
  report->set_done(status.ok());
  if (status) return reply;
  const bool by_plan = call.dry_run() || !report->faults().empty();
  const auto dropped = context.writer.run([&](Connection& writer) {
    return writer.run("DELETE FROM import_pieces WHERE import_id = ?", call.import_id());
  });
  if (!by_plan) return status.error();
  if (!dropped) return dropped.error();
  return reply;
}

}  // namespace needlelab::handlers
