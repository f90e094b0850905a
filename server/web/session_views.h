/// A stored session's samples for a browser: decimated for a plot, or complete as a download.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/base/result.h"
#include "common/gesture/chunk.h"
#include "db/service/service.h"
#include "server/base/http_message.h"
#include "server/web/web_call.h"

namespace needlelab {

struct WebRoute;

/// A step of a plot or of a download ends when it has decoded this many samples or chunks. It holds one
/// chunk's samples (at most 65,536, some 13 MB) and decodes fewer than kMaxStepSamples + kMaxChunkSamples,
/// regardless of the recording.
inline constexpr std::size_t kMaxStepSamples = kMaxChunkSamples;
inline constexpr std::uint32_t kMaxStepChunks = 256;
/// A piece of a download ends after this many rows (some 4 MB at most) or with its step, usually sooner,
/// because samples outside the requested span are decoded but not written. Between two pieces a download
/// holds the piece and the bytes of the next chunks (at most 1 MiB), but no samples.
inline constexpr std::size_t kMaxPieceRows = 8'192;

/// `?from_s=&to_s=&points=` (2-10000, by default 2000): {rate_hz, samples, from_s, to_s, decimated, columns:
/// {name: []}} with the names of the CSV. Times are s since the recording's first sample. When there are more
/// samples than points, each of `points`/2 equal time spans gives two rows: positions and states from two of
/// its samples; minimum and maximum of forces, speed, depth and errors, in time order, so that no peak is
/// lost. Omits damaged chunks. Memory between two steps: proportional to the points, and 1 MiB of chunks.
/// Thread: a worker's.
Result<WebSteps> samplePlot(Service& service, const WebCall& call);

/// All samples in the route's format, `?from_s=&to_s=` (`to_s` exclusive). A piece is some rows, regardless
/// of the lengths of the session and its chunks. A damaged chunk ends the stream with an error; before the
/// first piece the request is refused.
Result<WebStream> sampleStream(Service& service, const WebRoute& route, const WebCall& call);

}  // namespace needlelab
