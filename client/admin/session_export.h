/// A session's samples to a file, read in parts, written atomically, in memory that does not grow with its
/// length.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "client/admin/backend.h"
#include "client/admin/output.h"
#include "common/base/result.h"
#include "common/base/uuid.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// The part of a session to export, and the treatment of damage.
struct ExportRange {
  std::optional<double> from_s,
      to_s;                    ///< since the first sample, by the station's clock; from is in, to is not
  bool around_damage = false;  ///< write what can be read around damaged chunks; that is still a failure
};

/// `format`: "csv" (columns of gesture/sample_csv.h), "json" ({"version", "machine", "session", "rows"}) or
/// "recording" (common/gesture/FORMAT.md; a part of a session in whole chunks). Every chunk is checked, and
/// at the end of a whole export the hash over all of them against that of the recording: on any fault there
/// is no file, except with `around_damage`: then each fault is named, the file is there, and the result is
/// kCorrupt. A thinned recording is exported as such; an open session as far as it is stored.
Status exportSession(Backend& backend, Output& output, const Uuid& session, const std::string& format,
                     const std::filesystem::path& file, const ExportRange& range = {});

// A session as JSON.

/// Everything but profile, score and remarks.
Json sessionRow(const pb::SessionInfo& session);
/// Lower-case hexadecimal digits.
std::string hexOfBytes(const std::string& bytes);

// `needlelab-admin study recording`: the samples of one session of a study's export.

/// Writes the recording behind a session's pseudonym; ticks and times begin with 0. `format`: csv, json or
/// recording, as in `session export`. Errors: kNotFound when the study has no such session (any more); on any
/// fault there is no file. Thread: the caller's.
Status exportStudyRecording(Backend& backend, Output& output, const std::string& study,
                            const std::string& session, const std::string& format,
                            const std::filesystem::path& file);

}  // namespace needlelab
