/// One function per call. The caller has checked the role; the functions check access to each person's data.
/// Their tools are in context.h; functions that take the service's parts borrow their own readers or run in
/// several steps. Private to db/service.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/service/context/context.h"
#include "needlelab/control.pb.h"
#include "needlelab/live.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab::handlers {

/// kDenied unless the requester may assign or remove `role`, or set the password of a person with it. An
/// administrator may do so for all roles; a curriculum manager for roles up to its own, except researchers.
Status mayManage(const Context& context, pb::Role role);
/// Same, for replacing one role with another: a curriculum manager cannot change the role of another
/// curriculum manager.
Status mayChangeRole(const Context& context, pb::Role from, pb::Role to);
/// "a, b, c, d, e and 3 more"
std::string someNames(const std::vector<std::string>& names);
/// The differences between two states of a group as text, for the audit log and for the person whose edit
/// conflicts.
std::string groupChange(const pb::Group& before, const pb::Group& after);

// people and groups: people_handlers.cpp, group_handlers.cpp
Result<pb::Reply> addUser(const Context& context, const pb::AddUser& call);
Result<pb::Reply> setPassword(const Context& context, const pb::SetPassword& call);
Result<pb::Reply> disableUser(const Context& context, const pb::DisableUser& call);
Result<pb::Reply> listUsers(const Context& context, const pb::ListUsers& call);
Result<pb::Reply> getUser(const Context& context, const pb::GetUser& call);
Result<pb::Reply> changeUser(const Context& context, const pb::ChangeUser& call);
Result<pb::Reply> setConsent(const Context& context, const pb::SetConsent& call);
Result<pb::Reply> listConsents(const Context& context, const pb::ListConsents& call);
Result<pb::Reply> importPeople(const Context& context, const pb::ImportPeople& call);  ///< people_import.cpp
Result<pb::Reply> putGroup(const Context& context, const pb::PutGroup& call);
Result<pb::Reply> getGroup(const Context& context, const pb::GetGroup& call);
Result<pb::Reply> listGroups(const Context& context, const pb::ListGroups& call);
Result<pb::Reply> removeGroup(const Context& context, const pb::RemoveGroup& call);

// stations, and messages to them (the server delivers those): station_handlers.cpp
Result<pb::Reply> addStation(const Context& context, const pb::AddStation& call);
Result<pb::Reply> revokeStation(const Context& context, const pb::RevokeStation& call);
Result<pb::Reply> listStations(const Context& context, const pb::ListStations& call);
Result<pb::Reply> traineeMessage(const Context& context, const pb::TraineeMessage& call);
Result<pb::Reply> nextExercise(const Context& context, const pb::NextExercise& call);
Result<pb::Reply> setAids(const Context& context, const pb::SetAids& call);
Result<pb::Reply> stopLesson(const Context& context, const pb::StopLesson& call);

// profiles, curricula, lessons: lesson_handlers.cpp; profile_preview.cpp
Result<pb::Reply> importProfile(const Context& context, const pb::ImportProfile& call);
Result<pb::Reply> getProfile(const Context& context, const pb::GetProfile& call);
Result<pb::Reply> listProfiles(const Context& context, const pb::ListProfiles& call);
Result<pb::Reply> importCurriculum(const Context& context, const pb::ImportCurriculum& call);
Result<pb::Reply> getCurriculum(const Context& context, const pb::GetCurriculum& call);
Result<pb::Reply> listCurricula(const Context& context, const pb::ListCurricula& call);
Result<pb::Reply> getLesson(const Context& context, const pb::GetLesson& call);
Result<pb::Reply> profileRevisions(const Context& context, const pb::ListRevisions& call);
Result<pb::Reply> curriculumRevisions(const Context& context, const pb::ListRevisions& call);
Result<pb::Reply> checkJson(const Context& context, const pb::CheckText& call);
Result<pb::Reply> listExercises(const Context& context, const pb::ListExercises& call);
Result<pb::Reply> listMeasures(const Context& context, const pb::ListMeasures& call);
Result<pb::Reply> previewProfile(const Context& context, const pb::PreviewProfile& call);

// assignments and results: result_handlers.cpp
Result<pb::Reply> assign(const Context& context, const pb::Assign& call);
Result<pb::Reply> removeAssignment(const Context& context, const pb::RemoveAssignment& call);
Result<pb::Reply> listAssignments(const Context& context, const pb::ListAssignments& call);
Result<pb::Reply> getResults(const Context& context, const pb::GetResults& call);  ///< course_results.cpp
Result<pb::Reply> getProgress(const Context& context, const pb::GetProgress& call);
Result<pb::Reply> listTried(const Context& context, const pb::ListTried& call);
Result<pb::Reply> getAttempt(const Context& context, const pb::GetAttempt& call);
Result<pb::Reply> getToday(const Context& context, const pb::GetToday& call);  ///< today_handlers.cpp
Result<pb::Reply> excuseAttempt(const Context& context, const pb::ExcuseAttempt& call);

Result<pb::Reply> checkTrainee(const Context& context,
                               const pb::CheckTrainee& call);  ///< trainee_handlers.cpp

// codes of trainees: code_handlers.cpp
Result<pb::Reply> setCode(const Context& context, const pb::SetCode& call);
Result<pb::Reply> getLabSettings(const Context& context, const pb::GetLabSettings& call);
Result<pb::Reply> changeLabSettings(const Context& context, const pb::ChangeLabSettings& call);
/// Whether a station may begin a lesson of `name`, who may practise (mayPractise, standing.h), with this
/// code. Returns whether the code was compared; false: none is required. Only stations are checked. kCode,
/// with a text for the trainee: the code is missing or wrong, or must wait; kDenied: the person has no code,
/// and the lab requires one. Hashes a given code: call it where threadsOf() puts such requests.
Result<bool> checkCodeOf(const Context& context, const std::string& name, const std::string& code);

// score_handlers.cpp
Result<pb::Reply> getScore(const Context& context, const pb::GetScore& call);
Result<pb::Reply> listScores(const Context& context, const pb::ListScores& call);
Result<pb::Reply> setReference(const Context& context, const pb::SetReference& call);
Result<pb::Reply> getReference(const Context& context, const pb::GetReference& call);
/// In steps.
Result<pb::Reply> rescore(const ServiceParts& parts, const Principal& who, const pb::RescoreSession& call,
                          RequestUnderWay& under_way);
Result<pb::Reply> rescoreAll(const ServiceParts& parts, const Principal& who, const pb::RescoreAll& call,
                             RequestUnderWay& under_way);

// study_handlers.cpp, record_handlers.cpp
/// In steps (Erasures).
Result<pb::Reply> erasePerson(const ServiceParts& parts, const Principal& who, const pb::ErasePerson& call,
                              RequestUnderWay& under_way);
Result<pb::Reply> listMentions(const Context& context, const pb::ListMentions& call);
Result<pb::Reply> redact(const Context& context, const pb::Redact& call);
Result<pb::Reply> exportStudy(const Context& context, const pb::ExportStudy& call);
Result<pb::Reply> readStudyRecording(const Context& context, const pb::ReadStudyRecording& call);
Result<pb::Reply> exportPerson(const Context& context, const pb::ExportPerson& call);
Result<pb::Reply> exportAll(const Context& context, const pb::ExportAll& call);

// sessions, annotations, events: session_handlers.cpp

/// Bytes that one step of VerifySession reads, counted as in SessionStore::hashOn(): about 80 ms, for which
/// an import of a class or a backup waits. Smaller: more reads of the session's row; greater: longer waits.
inline constexpr std::uint64_t kVerifiedBytesAtOnce = std::uint64_t{16} << 20;

Result<pb::Reply> listSessions(const Context& context, const pb::ListSessions& call);
Result<pb::Reply> getSession(const Context& context, const pb::GetSession& call);
Result<pb::Reply> assignSession(const Context& context, const pb::AssignSession& call);
Result<pb::Reply> readChunks(const Context& context, const pb::ReadChunks& call);
/// Same without an audit line, for a caller that has written its own.
Result<pb::Reply> readChunksUnnoted(const Context& context, const pb::ReadChunks& call);
Result<pb::Reply> seekSession(const Context& context, const pb::SeekSession& call);
Result<pb::Reply> verifySession(const Context& context, const pb::VerifySession& call);
Result<pb::Reply> annotate(const Context& context, const pb::Annotate& call);
Result<pb::Reply> listAnnotations(const Context& context, const pb::ListAnnotations& call);
Result<pb::Reply> listEvents(const Context& context, const pb::ListEvents& call);
Result<pb::Reply> getSection(const Context& context, const pb::GetSection& call);

/// A session by its id from the network, if the requester may see it: a trainee sees only their own, and gets
/// the error for unknown sessions for all others.
Result<pb::SessionInfo> visibleSession(const Context& context, const std::string& bytes);

// the database itself: upkeep_handlers.cpp
/// One at a time. kUnavailable: another one is in progress.
Result<pb::Reply> backup(const ServiceParts& parts, const Principal& who, const pb::Backup& call,
                         RequestUnderWay& under_way);
Result<pb::Reply> check(const Context& context, const pb::Check& call);
Result<pb::Reply> listAudit(const Context& context, const pb::ListAudit& call);
Result<pb::Reply> listRetention(const Context& context, const pb::ListRetention& call);
Result<pb::Reply> setRetention(const Context& context, const pb::SetRetention& call);
Result<pb::Reply> runRetentionNow(const ServiceParts& parts, const Principal& who,
                                  const pb::RunRetention& call, RequestUnderWay& under_way);

}  // namespace needlelab::handlers
