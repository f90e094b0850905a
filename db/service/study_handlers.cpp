// What researchers see: sessions of those who consent, under pseudonyms. No record has a name, a station or a
// time of day in it.
#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "base/text_rules.h"
#include "db/annotation_store.h"
#include "db/attempt_store.h"
#include "db/audit_store.h"
#include "db/consent_store.h"
#include "db/erasure_store.h"
#include "db/people_store.h"
#include "db/pseudonym.h"
#include "db/score_store.h"
#include "db/session_store.h"
#include "db/transaction.h"
#include "service/handlers.h"
#include "service/page.h"

namespace needlelab::handlers {
namespace {

using StudyJson = nlohmann::ordered_json;

/// A session that may be seen, and whose it is.
struct StudySession {
  Uuid id{};
  std::string person;         ///< the pseudonym
  std::int64_t since_ns = 0;  ///< from the person's first session to this one
  pb::Attempt attempt;
};

class Study {
 public:
  static Result<Study> open(Connection& reader, const std::string& name) {
    if (auto valid = checkName("study", name); !valid) return valid.error();
    auto key = PseudonymKey::ofFolder(reader.path().parent_path());
    if (!key) return key.error();
    return Study(reader, name, *key);
  }

  [[nodiscard]] std::string sessionName(const Uuid& id) const { return key_.ofSession(name_, id); }

  /// By pseudonym of the person, then by time: an order that says nothing about names.
  Result<std::vector<StudySession>> sessions(const std::string& exercise_id) {
    const auto names = ConsentStore(reader_).consenting();
    if (!names) return names.error();
    std::vector<StudySession> all;
    for (const std::string& name : *names) {
      const auto person = PeopleStore(reader_).find(name);
      if (!person) return person.error();
      if (!*person) continue;
      const std::string pseudonym = key_.ofPerson(name_, name, (*person)->created_unix_ns);
      auto attempts = AttemptStore(reader_).list(name, "", false);
      if (!attempts) return attempts.error();
      const std::int64_t first_ns = attempts->empty() ? 0 : attempts->front().started_unix_ns();
      for (pb::Attempt& attempt : *attempts) {
        if (attempt.state() == pb::SESSION_OPEN ||
            (!exercise_id.empty() && attempt.exercise_id() != exercise_id))
          continue;
        const auto id = sessionId(attempt.session_id());
        if (!id) return id.error();
        all.push_back({*id, pseudonym, attempt.started_unix_ns() - first_ns, std::move(attempt)});
      }
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const auto& a, const auto& b) { return a.person < b.person; });
    return all;
  }

  /// Names that no text may hold: everybody's, not only of those who consent.
  Result<std::string> withoutNames(std::string text) {
    if (!people_) {
      auto people = PeopleStore(reader_).list();
      if (!people) return people.error();
      people_ = std::move(*people);
    }
    for (const Person& person : *people_) text = withoutName(text, person.name, person.full_name, "[name]");
    return text;
  }

  Result<std::vector<std::string>> recordsOf(const StudySession& session, bool with_remarks) {
    auto info = SessionStore(reader_).info(session.id);
    if (!info) return info.error();
    const pb::SessionDescription& d = info->description();
    StudyJson record = {
        {"kind", "session"},
        {"session", sessionName(session.id)},
        {"person", session.person},
        {"exercise_id", d.exercise_id()},
        {"attempt", session.attempt.number()},
        {"excused", session.attempt.excused()},
        {"begun_after_first_s", static_cast<double>(session.since_ns) * 1e-9},
        {"profile_id", d.profile_id()},
        {"profile_revision", d.profile_revision()},
        {"engine_version", d.engine_version()},
        {"rate_hz", d.rate_hz()},
        {"device", d.device()},
        {"axial_model", d.axial_model()},
        {"live_effects", std::vector<std::string>(d.live_effects().begin(), d.live_effects().end())},
        {"placement", std::vector<double>(d.placement().begin(), d.placement().end())},
        {"tool", std::vector<double>(d.tool().begin(), d.tool().end())},
        {"state", pb::SessionState_Name(info->state())},
        {"chunks", info->chunks()},
        {"samples", info->samples()},
        {"recording", !info->has_removed_original()                                     ? "ORIGINAL"
                      : info->removed_original().fate() == pb::RemovedOriginal::THINNED ? "THINNED"
                                                                                        : "DELETED"},
        {"passed", session.attempt.has_passed() ? StudyJson(session.attempt.passed()) : StudyJson(nullptr)}};
    auto profile = withoutNames(d.profile_json());
    if (!profile) return profile.error();
    const auto tree = StudyJson::parse(*profile, nullptr, false);
    record["profile"] = tree.is_discarded() ? StudyJson(*profile) : tree;
    std::vector<std::string> records{record.dump()};
    const auto scores = ScoreStore(reader_).list(session.id);
    if (!scores) return scores.error();
    for (const pb::Score& score : *scores) {
      const auto measures = StudyJson::parse(score.measures_json(), nullptr, false);
      records.push_back(
          StudyJson({{"kind", "score"},
                     {"session", sessionName(session.id)},
                     {"definition_version", score.definition_version()},
                     {"first", score.first()},
                     {"engine_version", score.engine_version()},
                     {"passed", score.has_passed() ? StudyJson(score.passed()) : StudyJson(nullptr)},
                     {"measures", measures.is_discarded() ? StudyJson::array() : measures}})
              .dump());
    }
    if (!with_remarks) return records;
    const auto remarks = AnnotationStore(reader_).list(session.id);
    if (!remarks) return remarks.error();
    for (const StoredAnnotation& remark : *remarks) {
      auto text = withoutNames(remark.text);
      if (!text) return text.error();
      records.push_back(StudyJson({{"kind", "remark"},
                                   {"session", sessionName(session.id)},
                                   {"tick", remark.tick},
                                   {"text", *text}})
                            .dump());
    }
    return records;
  }

 private:
  Study(Connection& reader, std::string name, PseudonymKey key)
      : reader_(reader), name_(std::move(name)), key_(key) {}
  Connection& reader_;
  std::string name_;
  PseudonymKey key_;
  std::optional<std::vector<Person>> people_;
};

}  // namespace

Result<pb::Reply> exportStudy(const Context& context, const pb::ExportStudy& call) {
  const auto from = numberOfPage(call.page());
  if (!from) return from.error();
  pb::Reply reply;
  auto* list = reply.mutable_records();
  {
    const auto view = Transaction::begin(context.reader, Transaction::Kind::kRead);
    if (!view) return view.error();
    auto study = Study::open(context.reader, call.study());
    if (!study) return study.error();
    const auto sessions = study->sessions(call.exercise_id());
    if (!sessions) return sessions.error();
    PageRoom room;
    if (*from == 0) {
      std::set<std::string> people;
      for (const StudySession& session : *sessions) people.insert(session.person);
      list->add_records(StudyJson({{"kind", "study"},
                                   {"study", call.study()},
                                   {"format", 1},
                                   {"people", people.size()},
                                   {"sessions", sessions->size()},
                                   {"program", "needlelab " NEEDLELAB_VERSION}})
                            .dump());
      room.take(list->records(0).size());
    }
    for (std::uint64_t i = *from; i < sessions->size(); ++i) {
      auto records = study->recordsOf((*sessions)[i], call.with_remarks());
      if (!records) return records.error();
      std::size_t bytes = 0;
      for (const std::string& record : *records) bytes += record.size() + 4;
      if (!room.take(bytes)) {
        list->set_next_page(std::to_string(i));
        break;
      }
      for (std::string& record : *records) list->add_records(std::move(record));
    }
  }
  if (*from != 0) return reply;
  // who took what out: written down once, with the first page
  const auto noted = write(context, call.study(), call.with_remarks() ? "with remarks" : "",
                           [](Connection&) { return Status(); });
  if (!noted) return noted.error();
  return reply;
}

Result<pb::Reply> readStudyRecording(const Context& context, const pb::ReadStudyRecording& call) {
  auto study = Study::open(context.reader, call.study());
  if (!study) return study.error();
  const auto sessions = study->sessions("");
  if (!sessions) return sessions.error();
  for (const StudySession& session : *sessions) {
    if (study->sessionName(session.id) != call.session()) continue;
    pb::ReadChunks read;
    read.set_session_id(session.id.data(), session.id.size());
    read.set_from_seq(call.from_seq());
    read.set_max_chunks(call.max_chunks());
    auto reply = readChunks(context, read);
    if (!reply) return reply.error();
    // the id has the time in it
    for (auto& chunk : *reply->mutable_chunks()->mutable_chunks()) chunk.set_session_id(call.session());
    return reply;
  }
  return Error{ErrorCode::kNotFound,
               "study '" + call.study() + "' has no session '" + printable(call.session()) + "' (any more)"};
}

}  // namespace needlelab::handlers
