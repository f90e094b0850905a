/// `needlelab-admin study recording`: the samples of one session of a study's export.
#pragma once

#include <filesystem>
#include <string>

#include "client/admin/backend.h"
#include "client/admin/output.h"
#include "common/base/result.h"

namespace needlelab {

/// Writes the recording behind a session's pseudonym; ticks and times begin with 0. `format`: csv, json or
/// recording, as in `session export`. Errors: kNotFound when the study has no such session (any more); on any
/// fault there is no file. Thread: the caller's.
Status exportStudyRecording(Backend& backend, Output& output, const std::string& study,
                            const std::string& session, const std::string& format,
                            const std::filesystem::path& file);

}  // namespace needlelab
