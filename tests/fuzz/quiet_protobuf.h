/// Included by targets that feed Protobuf: it says nothing of each text that is no UTF-8, which would cost
/// most of the time.
#pragma once

#include <google/protobuf/stubs/logging.h>

namespace needlelab::fuzz {

inline google::protobuf::LogHandler* const kSpokeBefore = google::protobuf::SetLogHandler(nullptr);

}  // namespace needlelab::fuzz
