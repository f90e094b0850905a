// Exports for researchers: sessions of consenting people, under pseudonyms. Records contain no name, station
// or time of day. Measured data is unchanged, so anyone who has the same data from another source can
// recognise it.
#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "common/base/program.h"
#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/gesture/chunk.h"
#include "common/haptics/body/path_snapshot.h"
#include "common/haptics/cut_snapshot.h"
#include "db/audit/audit.h"
#include "db/people/people.h"
#include "db/people/person_refs.h"
#include "db/people/pseudonyms.h"
#include "db/service/context/export_ledger.h"
#include "db/service/requests/handlers.h"
#include "db/sessions/session_results.h"
#include "db/sessions/session_store.h"
#include "db/store/connection.h"
#include "db/teaching/attempts.h"
#include "needlelab/profile.pb.h"

namespace needlelab::handlers {
namespace {

using StudyJson = nlohmann::ordered_json;

/// A session in the study, with its person.
struct StudySession {
  Uuid id{};
  std::string person;           ///< the pseudonym
  std::int64_t since_days = 0;  ///< from the person's first session to this one, whole days
  pb::Attempt attempt;
};

class Study {
 public:
  static Result<Study> open(Connection& reader, const std::string& name) {
    RETURN_IF_ERROR(checkName("study", name));
    ASSIGN_OR_RETURN(auto key, PseudonymKey::ofFolder(reader.path().parent_path()));
    return Study(reader, name, key);
  }

  [[nodiscard]] std::string sessionName(const Uuid& id) const { return key_.ofSession(name_, id); }

  /// By the person's pseudonym, then by time: the order reveals nothing about names.
  Result<std::vector<StudySession>> sessions(const std::string& exercise_id) {
    ASSIGN_OR_RETURN(const auto refs, ConsentStore(reader_).consenting());
    std::vector<StudySession> all;
    for (const std::string& ref : refs) {
      ASSIGN_OR_RETURN(const auto outer, outerRef(reader_, ref));
      if (!outer) continue;
      const std::string pseudonym = key_.ofPerson(name_, *outer);
      ASSIGN_OR_RETURN(auto attempts, AttemptStore(reader_).list(ref, "", false));
      const std::int64_t first_ns = attempts.empty() ? 0 : attempts.front().started_unix_ns();
      for (pb::Attempt& attempt : attempts) {
        if (attempt.state() == pb::SESSION_OPEN ||
            (!exercise_id.empty() && attempt.exercise_id() != exercise_id))
          continue;
        ASSIGN_OR_RETURN(const auto id, sessionId(attempt.session_id()));
        const std::int64_t since_days = (attempt.started_unix_ns() - first_ns) / 86'400'000'000'000;
        all.push_back({id, pseudonym, since_days, std::move(attempt)});
      }
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const auto& a, const auto& b) { return a.person < b.person; });
    return all;
  }

  /// Removes the names of all people, not only consenting ones, from a remark or a description. Ids and
  /// numbers contain no names and stay unchanged.
  Result<std::string> withoutNames(std::string text) {
    if (!people_) {
      ASSIGN_OR_RETURN(auto people, PeopleStore(reader_).list());
      people_ = std::move(people);
    }
    // because a person may be called "name"
    constexpr char kMark = '\x01';
    for (const Person& person : *people_)
      text = withoutName(text, person.name, person.full_name, std::string_view(&kMark, 1));
    std::string marked;
    for (const char c : text) marked += c == kMark ? std::string("[name]") : std::string(1, c);
    return marked;
  }

  /// A session's profile without names. Many sessions share a profile.
  Result<StudyJson> profileOf(const std::string& text) {
    if (const auto known = profiles_.find(text); known != profiles_.end()) return known->second;
    StudyJson profile = readShallowJson<StudyJson>(text);
    if (profile.is_discarded()) profile = nullptr;
    RETURN_IF_ERROR(eraseNames(profile, pb::Profile::descriptor(), nullptr));
    return profiles_.emplace(text, std::move(profile)).first->second;
  }

  /// The rows of a score without names: tissues and hazards are named in the profile.
  Result<StudyJson> measuresOf(const std::string& text) {
    StudyJson rows = readShallowJson<StudyJson>(text);
    if (rows.is_discarded()) return StudyJson::array();
    for (StudyJson& row : rows) {
      if (!row.is_object()) continue;
      for (const auto& [key, value] : row.items())
        if (key != "measure" && key != "unit") RETURN_IF_ERROR(eraseNames(value, nullptr, nullptr));
    }
    return rows;
  }

  Result<std::vector<std::string>> recordsOf(const StudySession& session, bool with_remarks,
                                             bool with_setup) {
    ASSIGN_OR_RETURN(auto info, SessionStore(reader_).info(session.id));
    const pb::SessionDescription& d = info.description();
    StudyJson record = {
        {"kind", "session"},
        {"session", sessionName(session.id)},
        {"person", session.person},
        {"exercise_id", d.exercise_id()},
        {"attempt", session.attempt.number()},
        {"excused", session.attempt.excused()},
        {"begun_after_first_days", session.since_days},
        {"profile_id", d.profile_id()},
        {"profile_revision", d.profile_revision()},
        {"engine_version", d.engine_version()},
        {"rate_hz", d.rate_hz()},
        {"axial_model", d.axial_model()},
        {"live_effects", std::vector<std::string>(d.live_effects().begin(), d.live_effects().end())},
        {"state", pb::SessionState_Name(info.state())},
        {"chunks", info.chunks()},
        {"samples", info.samples()},
        {"recording", !info.has_removed_original()                                     ? "ORIGINAL"
                      : info.removed_original().fate() == pb::RemovedOriginal::THINNED ? "THINNED"
                                                                                       : "DELETED"},
        {"passed", session.attempt.has_passed() ? StudyJson(session.attempt.passed()) : StudyJson(nullptr)}};
    // these differ between stations
    if (with_setup) {
      record["device"] = d.device();
      record["placement"] = std::vector<double>(d.placement().begin(), d.placement().end());
      record["tool"] = std::vector<double>(d.tool().begin(), d.tool().end());
      record["stiffness_share"] = d.has_stiffness_share() ? d.stiffness_share() : 1;
      record["delay_stiffness_share"] = d.has_delay_stiffness_share() ? d.delay_stiffness_share() : 1;
    }
    auto profile = profileOf(d.profile_json());
    if (!profile) return profile.error();
    record["profile"] = std::move(*profile);
    std::vector<std::string> records{record.dump()};
    ASSIGN_OR_RETURN(const auto scores, ScoreStore(reader_).list(session.id));
    for (const pb::Score& score : scores) {
      auto measures = measuresOf(score.measures_json());
      if (!measures) return measures.error();
      records.push_back(
          StudyJson({{"kind", "score"},
                     {"session", sessionName(session.id)},
                     {"definition_version", score.definition_version()},
                     {"first", score.first()},
                     {"engine_version", score.engine_version()},
                     {"passed", score.has_passed() ? StudyJson(score.passed()) : StudyJson(nullptr)},
                     {"measures", std::move(*measures)}})
              .dump());
    }
    if (!with_remarks) return records;
    ASSIGN_OR_RETURN(const auto remarks, AnnotationStore(reader_).list(session.id));
    for (const StoredAnnotation& remark : remarks) {
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

  /// Removes names from all texts in `value`, at any depth. `type`: the message that an object represents;
  /// `field`: the field that a text belongs to; null if our messages do not know it, in which case field
  /// names are treated as texts, too. The profile's id and enumerators are not texts.
  Status eraseNames(StudyJson& value, const google::protobuf::Descriptor* type,
                    const google::protobuf::FieldDescriptor* field) {
    if (value.is_string()) {
      const std::string text = value.get<std::string>();
      const auto* enumerators = field != nullptr ? field->enum_type() : nullptr;
      if (enumerators != nullptr && enumerators->FindValueByName(text) != nullptr) return {};
      ASSIGN_OR_RETURN(value, withoutNames(text));
    } else if (value.is_array()) {
      for (StudyJson& item : value) RETURN_IF_ERROR(eraseNames(item, type, field));
    } else if (value.is_object()) {
      StudyJson without = StudyJson::object();
      for (const auto& [key, below] : value.items()) {
        const auto* known = type != nullptr ? type->FindFieldByName(key) : nullptr;
        std::string name = key;
        if (known == nullptr) {
          ASSIGN_OR_RETURN(name, withoutNames(key));
        }
        const bool is_id = known != nullptr && type == pb::Profile::descriptor() && key == "id";
        if (!is_id)
          RETURN_IF_ERROR(eraseNames(below, known != nullptr ? known->message_type() : nullptr, known));
        without[name] = std::move(below);
      }
      value = std::move(without);
    }
    return {};
  }
  Connection& reader_;
  std::string name_;
  PseudonymKey key_;
  std::optional<std::vector<Person>> people_;
  std::map<std::string, StudyJson> profiles_;  ///< by their JSON text
};

/// The position of a study's page: after this session or, if that session is no longer in the study, after
/// its person.
std::size_t placeBehind(const std::vector<StudySession>& sessions, const Study& study,
                        const std::string& place) {
  const std::size_t blank = place.find(' ');
  const std::string person = place.substr(0, blank);
  const std::string session = blank == std::string::npos ? std::string() : place.substr(blank + 1);
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    if (sessions[i].person == person && study.sessionName(sessions[i].id) == session) return i + 1;
  }
  const auto next = std::find_if(sessions.begin(), sessions.end(),
                                 [&](const StudySession& other) { return other.person > person; });
  return static_cast<std::size_t>(next - sessions.begin());
}

constexpr std::size_t kMaxShiftedSamples = 2 * kMaxChunkSamples;

/// A chunk's memory of the cut after a shift of its samples; an unreadable one is omitted.
Bytes shiftedCuts(ByteView cut_memory, std::uint64_t ticks) {
  auto cuts = cutsIn(cut_memory);
  if (!cuts || cuts->tick < ticks) return {};
  cuts->tick -= ticks;
  return encodeCuts(*cuts);
}

/// A chunk's paths after a shift of its samples, without those that cannot be read.
Bytes shiftedPaths(ByteView list, std::uint64_t ticks) {
  Bytes shifted;
  for (PathSnapshot path : pathsIn(list)) {
    if (path.tick < ticks) continue;
    path.tick -= ticks;
    appendPath(path, shifted);
  }
  return shifted;
}

/// Shifts a recording so that it begins with tick 0 at time 0: the station's clock would reveal the order of
/// several people's sessions, with exact gaps.
///
/// A reply may contain 1 MiB of chunks with 65,536 samples each, which all must be decoded and encoded. It
/// ends with the chunk that reaches kMaxShiftedSamples, so that it takes milliseconds.
Status beginWithZero(Connection& reader, const Uuid& session, pb::Chunks& chunks) {
  if (chunks.chunks().empty()) return {};
  const auto first = SessionStore(reader).readChunks(session, 0, 1, kMaxReplyBytes);
  if (!first) return first.error();
  if (first->empty()) return Error{ErrorCode::kCorrupt, "the recording has no first chunk"};
  ASSIGN_OR_RETURN(const auto origin, inspectChunk(first->front().bytes));
  std::size_t shifted = 0;
  for (int i = 0; i < chunks.chunks_size(); ++i) {
    pb::Chunk& chunk = *chunks.mutable_chunks(i);
    if (shifted >= kMaxShiftedSamples) {
      chunks.set_next_seq(chunk.seq());
      chunks.set_end(false);
      chunks.mutable_chunks()->DeleteSubrange(i, chunks.chunks_size() - i);
      break;
    }
    ASSIGN_OR_RETURN(const auto head, inspectChunk(viewOf(chunk.data())));
    ASSIGN_OR_RETURN(auto samples, decodeChunk(viewOf(chunk.data())));
    shifted += samples.size();
    for (GestureSample& sample : samples) {
      if (sample.tick < origin.first_tick)
        return Error{ErrorCode::kUnavailable, "the recording was thinned while it was read: start again"};
      sample.tick -= origin.first_tick;
      sample.time_ns -= origin.first_time_ns;
    }
    const Bytes cuts = shiftedCuts(cutMemoryOf(viewOf(chunk.data())), origin.first_tick);
    const Bytes paths = shiftedPaths(pathListOf(viewOf(chunk.data())), origin.first_tick);
    chunk.set_data(std::string(textOf(encodeChunk(head.resolution, samples, cuts, paths))));
  }
  return {};
}

}  // namespace

Result<pb::Reply> exportStudy(const Context& context, const pb::ExportStudy& call) {
  const std::string what = "study " + call.study() + "\n" + call.exercise_id() + "\n" +
                           (call.with_remarks() ? "remarks" : "") + "\n" + (call.with_setup() ? "setup" : "");
  ASSIGN_OR_RETURN(const auto place, context.exports.open(context.who, what, call.page()));
  pb::Reply reply;
  auto* list = reply.mutable_records();
  {
    ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
    auto study = Study::open(context.reader, call.study());
    if (!study) return study.error();
    const auto sessions = study->sessions(call.exercise_id());
    if (!sessions) return sessions.error();
    PageRoom room;
    if (place.empty()) {
      std::set<std::string> people;
      for (const StudySession& session : *sessions) people.insert(session.person);
      list->add_records(StudyJson({{"kind", "study"},
                                   {"study", call.study()},
                                   {"format", 2},
                                   {"people", people.size()},
                                   {"sessions", sessions->size()},
                                   {"program", "needlelab " + programVersion()}})
                            .dump());
      room.take(list->records(0).size());
    }
    for (std::size_t i = place.empty() ? 0 : placeBehind(*sessions, *study, place); i < sessions->size();
         ++i) {
      ASSIGN_OR_RETURN(auto records,
                       study->recordsOf((*sessions)[i], call.with_remarks(), call.with_setup()));
      std::size_t bytes = 0;
      for (const std::string& record : records) bytes += record.size() + 4;
      if (!room.take(bytes)) {
        const std::string behind =
            i == 0 ? " " : (*sessions)[i - 1].person + " " + study->sessionName((*sessions)[i - 1].id);
        list->set_next_page(context.exports.seal(context.who, what, behind));
        break;
      }
      for (std::string& record : records) list->add_records(std::move(record));
    }
  }
  if (!place.empty()) return reply;
  // the audit line is written with the first page, which all other pages require
  std::string detail;
  for (const auto& [with, words] :
       {std::pair{call.with_remarks(), "with remarks"}, std::pair{call.with_setup(), "with devices' places"}})
    if (with) detail += (detail.empty() ? "" : ", ") + std::string(words);
  RETURN_IF_ERROR(write(context, call.study(), detail, [](Connection&) { return Status(); }));
  return reply;
}

Result<pb::Reply> readStudyRecording(const Context& context, const pb::ReadStudyRecording& call) {
  auto study = Study::open(context.reader, call.study());
  if (!study) return study.error();
  ASSIGN_OR_RETURN(const auto sessions, study->sessions(""));
  for (const StudySession& session : sessions) {
    if (study->sessionName(session.id) != call.session()) continue;
    // before any data is returned
    const std::string what = call.study() + "\n" + call.session();
    if (context.exports.isNew(context.who, what, context.now_unix_ns)) {
      const Status noted = writeIfChanged(context, call.study(), call.session(), [&](Connection& writer) {
        return context.exports.isNewOnAllServers(writer, context.who, what);
      });
      if (!noted.ok()) {
        context.exports.revoke(context.who, what);
        return noted.error();
      }
    }
    pb::ReadChunks read;
    read.set_session_id(session.id.data(), session.id.size());
    read.set_from_seq(call.from_seq());
    read.set_max_chunks(call.max_chunks());
    // its audit line was written above, without a name
    auto reply = readChunksUnnoted(context, read);
    if (!reply) return reply.error();
    RETURN_IF_ERROR(beginWithZero(context.reader, session.id, *reply->mutable_chunks()));
    // the id contains the time
    for (auto& chunk : *reply->mutable_chunks()->mutable_chunks()) chunk.set_session_id(call.session());
    return reply;
  }
  return Error{ErrorCode::kNotFound,
               "study '" + call.study() + "' has no session '" + printable(call.session()) + "' (any more)"};
}

}  // namespace needlelab::handlers
