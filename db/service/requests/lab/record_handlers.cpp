// Data stored about a person: exporting it (or the whole store), finding mentions in others' texts,
// erasing.
#include <fmt/core.h>
#include <utility>
#include <vector>

#include "common/base/text/text.h"
#include "db/audit/audit_chain.h"
#include "db/people/person_refs.h"
#include "db/service/context/export_ledger.h"
#include "db/service/records/erasures.h"
#include "db/service/records/mentions.h"
#include "db/service/records/record_tables.h"
#include "db/service/requests/handlers.h"
#include "db/service/requests/requests.h"
#include "db/service/scoring/held_results.h"
#include "db/store/connection.h"
#include "db/store/rows.h"

namespace needlelab::handlers {
namespace {

/// The position of a page: after the row with these keys. Pages exclude rows added after the first page.
struct RecordPage {
  std::size_t table = 0;
  RecordJson keys;                 ///< null: from the table's first row
  std::int64_t last_session = 0;   ///< later rows were added after the first page
  std::vector<std::int64_t> open;  ///< sessions open at the start: excluded, even if closed meanwhile
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

/// Pages are read one after another: if rows that others refer to have changed, the pages would be
/// inconsistent. kConflict.
Status sameAsBefore(Connection& reader, const RecordPage& page) {
  auto row = reader.query(
      "SELECT who, action, subject FROM audit WHERE id > ? AND action IN ('user add', 'user import', 'group "
      "set', 'group remove', 'person erase', 'station add', 'session assign') LIMIT 1",
      page.audit_id);
  ASSIGN_OR_RETURN(const auto found, row.step());
  if (!found) return {};
  return Error{ErrorCode::kConflict, "what is exported was changed meanwhile ('" + row.text(1) + "' by " +
                                         row.text(0) + "): begin again"};
}

/// A condition on a table's rows, for an export of the whole store.
std::string conditionOf(const RecordTable& table, const RecordPage& page) {
  // settings do not belong to sessions
  if (table.only.empty() || table.kind == "lab_setting") return std::string(table.only);
  std::string open;
  for (const std::int64_t number : page.open) open += (open.empty() ? "" : ",") + std::to_string(number);
  std::string then = fmt::format("number <= {}", page.last_session);
  if (!open.empty()) then += fmt::format(" AND number NOT IN ({})", open);
  if (table.kind == "session") return std::string(table.only) + " AND " + then;
  return std::string(table.only) + " AND session IN (SELECT number FROM sessions WHERE " + then + ")";
}

/// `person`: exports only this person's rows; null: all rows. `what` identifies the request, for its page
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
  // trainees see exam results only where they could see them elsewhere
  const bool own = person != nullptr && context.who.role == pb::TRAINEE;
  WithheldResults held(context);
  const auto tables = recordTables();
  for (; page.table < tables.size(); ++page.table, page.keys = nullptr) {
    const RecordTable& table = tables[page.table];
    if (person != nullptr && table.of_person.empty()) continue;
    std::string where = person != nullptr ? std::string(table.of_person) : conditionOf(table, page);
    if (own && (table.kind == "score" || table.kind == "event"))
      where += " AND session NOT IN " + withheldSessions(context.now_unix_ns);
    for (bool more = true; more;) {
      ASSIGN_OR_RETURN(
          auto rows, recordsAfter(context.reader, table, where, person, page.keys, secrets, at_once.count()));
      for (more = false; !more;) {
        ASSIGN_OR_RETURN(const auto row, rows.step());
        if (!row) break;
        RecordJson record = recordOf(table, rows, secrets);
        if (table.kind == "audit") {
          const auto refs = refsIn(record["detail"].get_ref<const std::string&>());
          const std::vector<std::string> list_of_refs(refs.begin(), refs.end());
          ASSIGN_OR_RETURN(const auto names, namesOfRefs(context.reader, list_of_refs));
          record["detail"] = withNames(record["detail"].get_ref<const std::string&>(), names);
        }
        if (own && table.kind == "session") {
          ASSIGN_OR_RETURN(const auto until, held.until(record["exercise_id"].get_ref<const std::string&>()));
          if (until != 0) record["score_json"] = record["passed"] = nullptr;
        }
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

constexpr std::size_t kMaxMentions = 500;

/// The person's names, and the text. kInvalidInput: there is no word.
Result<Phrases> phrasesOf(Connection& reader, const std::string& ref, const std::string& text) {
  std::vector<std::string> texts = {text};
  // an erased person has no name any more: the text must contain it
  if (isPersonRef(ref)) {
    ASSIGN_OR_RETURN(const auto named,
                     reader
                         .query("SELECT n.name, n.full_name FROM people p JOIN names n ON"
                                " n.person = p.id WHERE p.ref = ?",
                                ref)
                         .first([](const Statement& row) { return std::pair(row.text(0), row.text(1)); }));
    if (named) texts.insert(texts.end(), {named->first, named->second});
  }
  Phrases phrases(texts);
  if (!phrases.empty()) return phrases;
  return Error{ErrorCode::kInvalidInput,
               "there is no name to look for: the person is erased or unknown; give the words (text)"};
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
    // the head in the export's own line is an anchor outside this store
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

Result<pb::Reply> listMentions(const Context& context, const pb::ListMentions& call) {
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  ASSIGN_OR_RETURN(const auto phrases, phrasesOf(context.reader, call.name(), call.text()));
  pb::Reply reply;
  ASSIGN_OR_RETURN(const auto skipped, numberOfPage(call.page()));
  ASSIGN_OR_RETURN(*reply.mutable_mentions(),
                   MentionStore(context.reader).find(phrases, skipped, kMaxMentions));
  return reply;
}

Result<pb::Reply> redact(const Context& context, const pb::Redact& call) {
  ASSIGN_OR_RETURN(const auto phrases, phrasesOf(context.reader, call.name(), call.text()));
  RETURN_IF_ERROR(writeIfChanged(context, isPersonRef(call.name()) ? call.name() : "", call.where(),
                                 [&](Connection& writer) -> Result<bool> {
                                   ASSIGN_OR_RETURN(const std::size_t places,
                                                    MentionStore(writer).redact(phrases, call.where()));
                                   return places > 0;
                                 }));
  return doneReply();
}

Result<pb::Reply> erasePerson(const ServiceParts& parts, const Principal& who, const pb::ErasePerson& call,
                              RequestUnderWay& under_way) {
  if (under_way.erasure) return parts.erasures.goOn(under_way);
  return withReader(parts, who, callName(pb::Request::kErasePerson), under_way,
                    [&](const Context& context) { return parts.erasures.begin(context, call); });
}

}  // namespace needlelab::handlers
