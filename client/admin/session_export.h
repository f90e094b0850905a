/// Exports a session's samples to a file. Reads them in parts and writes atomically; memory does not depend
/// on the session's length.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "client/admin/backend.h"
#include "client/admin/output.h"
#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "common/export/export_formats.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// The part of a session to export, and the treatment of damage.
struct ExportRange {
  std::optional<double> from_s,
      to_s;  ///< since the first sample, by the station's clock; `from` inclusive, `to` exclusive
  bool around_damage =
      false;  ///< write the readable part around damaged chunks; the result is still a failure
};

/// `format`: of kSessionExport; a format of whole chunks has a part of a session in whole chunks. Checks
/// every chunk; after a whole export, compares the hash over all chunks with the recording's. A fault leaves
/// no file, except with `around_damage`: then each fault is reported, the file is written, and kCorrupt is
/// returned. Exports a thinned recording as it is, and the stored part of an open session.
Status exportSession(Backend& backend, Output& output, const Uuid& session, const ExportFormat& format,
                     const std::filesystem::path& file, const ExportRange& range = {});

// A session as JSON.

/// Returns everything except profile, score and remarks.
Json sessionRow(const pb::SessionInfo& session);

// The samples of one session of a study's export.

/// Reads the recording of a session's pseudonym; ticks and times start at 0. Errors: kNotFound if the session
/// is not, or no longer, in the study; those of `take`. Thread: the caller's.
Status readStudyChunks(Backend& backend, const std::string& study, const std::string& session,
                       const std::function<Status(ByteView chunk)>& take);

/// Writes it. `format`: of kStudyRecording. A fault leaves no file.
Status exportStudyRecording(Backend& backend, Output& output, const std::string& study,
                            const std::string& session, const ExportFormat& format,
                            const std::filesystem::path& file);

/// Writes the study as a new folder, a Motion-BIDS dataset (files/README.md). `ask` sets a page's name in the
/// request for its records. Errors: also kInvalidInput if `folder` exists. A fault leaves no folder.
Status exportStudyFolder(Backend& backend, Output& output, const std::string& study,
                         const std::filesystem::path& folder,
                         const std::function<void(pb::Request&, const std::string&)>& ask);

}  // namespace needlelab
