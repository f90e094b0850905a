/// For targets that feed Protobuf: silences Protobuf's message for each text that is not UTF-8. The messages
/// would take most of the time.
#pragma once

#include <google/protobuf/stubs/logging.h>

namespace needlelab::fuzz {

inline google::protobuf::LogHandler* const kSpokeBefore = google::protobuf::SetLogHandler(nullptr);

}  // namespace needlelab::fuzz
