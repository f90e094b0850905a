// Every message of the protocol with its number, as published. Append only: a number never changes its
// meaning and is never reused.
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "needlelab/envelope.pb.h"
#include "needlelab/faculty.pb.h"

namespace needlelab {
namespace {

struct NumberedName {
  int number;
  std::string_view name;
};

constexpr NumberedName kEnvelopeMessages[] = {
    {1, "chunk"},
    {2, "ack"},
    {3, "live_frame"},
    {4, "station_status"},
    {5, "ping"},
    {6, "pong"},
    {7, "request"},
    {8, "reply"},
    {20, "hello"},
    {21, "refusal"},
    {22, "login"},
    {23, "welcome"},
    {24, "bye"},
    {25, "open_session"},
    {26, "session_opened"},
    {27, "close_session"},
    {28, "session_closed"},
    {29, "clock_offset"},
    {40, "watch_state"},
    {41, "subscribe"},
    {42, "subscribed"},
    {43, "unsubscribe"},
    {44, "trainee_message"},
    {45, "next_exercise"},
    {46, "set_aids"},
    {47, "stop_lesson"},
};

constexpr NumberedName kRequestCalls[] = {
    {10, "add_user"},
    {11, "set_password"},
    {12, "disable_user"},
    {13, "list_users"},
    {14, "set_code"},
    {15, "get_lab_settings"},
    {16, "change_lab_settings"},
    {20, "add_station"},
    {21, "revoke_station"},
    {22, "list_stations"},
    {30, "import_profile"},
    {31, "get_profile"},
    {32, "list_profiles"},
    {40, "import_curriculum"},
    {41, "get_curriculum"},
    {42, "list_curricula"},
    {43, "assign"},
    {44, "list_assignments"},
    {45, "get_lesson"},
    {46, "check_trainee"},
    {50, "list_sessions"},
    {51, "get_session"},
    {52, "read_chunks"},
    {53, "verify_session"},
    {54, "list_events"},
    {55, "seek_session"},
    {56, "assign_session"},
    {57, "get_section"},
    {60, "annotate"},
    {61, "list_annotations"},
    {70, "backup"},
    {71, "check"},
    {72, "list_audit"},
    {73, "list_retention"},
    {74, "set_retention"},
    {75, "run_retention"},
    {80, "trainee_message"},
    {81, "next_exercise"},
    {82, "set_aids"},
    {83, "stop_lesson"},
    {100, "get_user"},
    {101, "change_user"},
    {102, "set_consent"},
    {103, "list_consents"},
    {104, "import_people"},
    {105, "export_person"},
    {106, "erase_person"},
    {107, "list_mentions"},
    {108, "redact"},
    {110, "put_group"},
    {111, "get_group"},
    {112, "list_groups"},
    {113, "remove_group"},
    {120, "list_profile_revisions"},
    {121, "list_curriculum_revisions"},
    {122, "check_text"},
    {123, "preview_profile"},
    {124, "list_exercises"},
    {125, "list_measures"},
    {126, "remove_assignment"},
    {127, "list_tried"},
    {128, "get_attempt"},
    {129, "get_today"},
    {130, "get_results"},
    {131, "get_progress"},
    {132, "excuse_attempt"},
    {133, "get_score"},
    {134, "rescore_session"},
    {135, "list_scores"},
    {136, "set_reference"},
    {137, "get_reference"},
    {138, "rescore_all"},
    {140, "export_study"},
    {141, "read_study_recording"},
    {150, "export_all"},
};

constexpr NumberedName kReplyResults[] = {
    {2, "done"},
    {10, "users"},
    {14, "new_code"},
    {15, "lab_settings"},
    {20, "station_key"},
    {21, "stations"},
    {30, "profile"},
    {31, "profiles"},
    {40, "curriculum"},
    {41, "curricula"},
    {42, "assignments"},
    {43, "lesson"},
    {46, "trainee_checked"},
    {50, "sessions"},
    {51, "session"},
    {52, "chunks"},
    {53, "verified"},
    {54, "events"},
    {55, "sought"},
    {57, "section"},
    {60, "annotation"},
    {61, "annotations"},
    {70, "backup_done"},
    {71, "check_report"},
    {72, "audit"},
    {73, "retention"},
    {74, "retention_report"},
    {100, "user"},
    {103, "consents"},
    {104, "people_import"},
    {105, "records"},
    {106, "erasure"},
    {107, "mentions"},
    {110, "group"},
    {112, "groups"},
    {120, "revisions"},
    {122, "text_check"},
    {123, "profile_preview"},
    {124, "exercises"},
    {125, "measures"},
    {127, "tried_exercises"},
    {129, "today"},
    {130, "results"},
    {131, "progress"},
    {132, "attempt"},
    {133, "score"},
    {135, "scores"},
    {137, "reference"},
    {138, "rescore_report"},
};

constexpr NumberedName kRefusalReasons[] = {
    {0, "REASON_UNSPECIFIED"},
    {1, "VERSION"},
    {2, "LOGIN"},
    {3, "ROLE"},
    {4, "STATE"},
    {5, "INVALID"},
    {6, "UNKNOWN_SESSION"},
    {7, "GAP"},
    {8, "CONTRADICTION"},
    {9, "TOO_LARGE"},
    {10, "RATE_LIMITED"},
    {11, "QUEUE_OVERFLOW"},
    {12, "TIMEOUT"},
    {13, "SHUTTING_DOWN"},
    {14, "INTERNAL"},
    {15, "NOT_FOUND"},
    {16, "CONFLICT"},
    {17, "REVISION_CONFLICT"},
    {18, "CODE"},
    {19, "NO_ROOM"},
    {20, "DEPOSED"},
};

/// The messages between servers.
constexpr std::pair<std::string_view, int> kFacultyFields[] = {
    {"Origin.lab", 1},
    {"Origin.server", 2},
    {"Origin.instance", 3},
    {"Origin.number", 4},
    {"Presence.origin", 1},
    {"Presence.stations", 2},
    {"Presence.ends", 3},
    {"PresentStation.station", 1},
    {"PresentStation.epoch", 2},
    {"PresentStation.status", 3},
    {"PresentStation.gone", 4},
    {"RemoteWatch.origin", 1},
    {"RemoteWatch.station", 2},
    {"RemoteWatch.watched", 3},
    {"RemoteWatch.rate_hz", 4},
    {"RemoteFrame.live_frame", 3},
    {"RemoteFrame.origin", 20},
    {"RemoteFrame.epoch", 21},
    {"RemoteFrame.rate_hz", 22},
    {"StationAsk.origin", 1},
    {"StationAsk.server", 2},
    {"StationAsk.station", 3},
    {"StationAsk.epoch", 4},
    {"StationAsk.trainee_message", 10},
    {"StationAsk.next_exercise", 11},
    {"StationAsk.set_aids", 12},
    {"StationAsk.stop_lesson", 13},
    {"StationAnswer.origin", 1},
    {"StationAnswer.server", 2},
    {"StationAnswer.instance", 3},
    {"StationAnswer.number", 4},
    {"StationAnswer.delivered", 10},
    {"StationAnswer.refused", 11},
    {"StationAnswer.not_here", 12},
    {"NotHere.server", 1},
    {"NotHere.epoch", 2},
};

using Names = std::map<int, std::string>;

template <std::size_t N>
Names tableOf(const NumberedName (&table)[N]) {
  Names names;
  for (const auto& entry : table)
    EXPECT_TRUE(names.emplace(entry.number, entry.name).second) << entry.number << " comes twice";
  return names;
}

Names fieldsOf(const google::protobuf::OneofDescriptor* oneof) {
  Names names;
  for (int i = 0; i < oneof->field_count(); ++i)
    names.emplace(oneof->field(i)->number(), oneof->field(i)->name());
  return names;
}

// A failure here means that a number has changed its meaning, or that a new number is missing in the lists
// above.
TEST(MessageNumbers, envelopeNumbersAreAsPublished) {
  EXPECT_EQ(fieldsOf(pb::Envelope::descriptor()->FindOneofByName("body")), tableOf(kEnvelopeMessages));
}
TEST(MessageNumbers, requestNumbersAreAsPublished) {
  EXPECT_EQ(fieldsOf(pb::Request::descriptor()->FindOneofByName("call")), tableOf(kRequestCalls));
}
TEST(MessageNumbers, replyNumbersAreAsPublished) {
  EXPECT_EQ(fieldsOf(pb::Reply::descriptor()->FindOneofByName("result")), tableOf(kReplyResults));
}
TEST(MessageNumbers, numbersBetweenServersAreAsPublished) {
  std::map<std::string, int> fields;
  const auto* const file = pb::Origin::descriptor()->file();
  for (int i = 0; i < file->message_type_count(); ++i) {
    const auto* const message = file->message_type(i);
    for (int j = 0; j < message->field_count(); ++j)
      fields.emplace(message->name() + "." + message->field(j)->name(), message->field(j)->number());
  }
  std::map<std::string, int> published;
  for (const auto& [name, number] : kFacultyFields) published.emplace(name, number);
  EXPECT_EQ(fields, published);
  EXPECT_EQ(int{pb::RemoteFrame::kLiveFrameFieldNumber}, int{pb::Envelope::kLiveFrameFieldNumber})
      << "an envelope's bytes are a part of it";
}
TEST(MessageNumbers, refusalReasonsAreAsPublished) {
  Names reasons;
  const auto* descriptor = pb::Refusal::Reason_descriptor();
  for (int i = 0; i < descriptor->value_count(); ++i)
    reasons.emplace(descriptor->value(i)->number(), descriptor->value(i)->name());
  EXPECT_EQ(reasons, tableOf(kRefusalReasons));
}

}  // namespace
}  // namespace needlelab
