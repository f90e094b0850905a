/// Every message of the wire with its number. Append only: a number never changes its meaning and is never
/// used again. A test compares the tables with the .proto files, so that a change there without one here
/// fails.
#pragma once

#include <string_view>

namespace needlelab {

struct NumberedName {
  int number;
  std::string_view name;
};

inline constexpr NumberedName kEnvelopeMessages[] = {
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
};

inline constexpr NumberedName kRequestCalls[] = {
    {10, "add_user"},       {11, "set_password"},   {12, "disable_user"},      {13, "list_users"},
    {20, "add_station"},    {21, "revoke_station"}, {22, "list_stations"},     {30, "import_profile"},
    {31, "get_profile"},    {32, "list_profiles"},  {40, "import_curriculum"}, {41, "get_curriculum"},
    {42, "list_curricula"}, {43, "assign"},         {44, "list_assignments"},  {45, "get_lesson"},
    {50, "list_sessions"},  {51, "get_session"},    {52, "read_chunks"},       {53, "verify_session"},
    {54, "list_events"},    {55, "seek_session"},   {60, "annotate"},          {61, "list_annotations"},
    {70, "backup"},         {71, "check"},          {72, "list_audit"},        {73, "list_retention"},
    {74, "set_retention"},  {75, "run_retention"},  {80, "trainee_message"},   {81, "next_exercise"},
};

inline constexpr NumberedName kReplyResults[] = {
    {2, "done"},      {10, "users"},      {20, "station_key"},      {21, "stations"},    {30, "profile"},
    {31, "profiles"}, {40, "curriculum"}, {41, "curricula"},        {42, "assignments"}, {43, "lesson"},
    {50, "sessions"}, {51, "session"},    {52, "chunks"},           {53, "verified"},    {54, "events"},
    {55, "sought"},   {60, "annotation"}, {61, "annotations"},      {70, "backup_done"}, {71, "check_report"},
    {72, "audit"},    {73, "retention"},  {74, "retention_report"},
};

inline constexpr NumberedName kRefusalReasons[] = {
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
};

}  // namespace needlelab
