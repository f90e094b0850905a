/// A stored session's samples for a browser: decimated for a plot, or complete as CSV.
#pragma once

#include "common/base/result.h"
#include "db/service/service.h"
#include "server/base/http_message.h"
#include "server/web/web_call.h"

namespace needlelab {

/// `?from_s=&to_s=&points=` (2-10000, by default 2000): {rate_hz, samples, from_s, to_s, decimated, columns:
/// {name: []}} with the names of the CSV. Times are s since the recording's first sample. When there are more
/// samples than points, each of `points`/2 equal time spans gives two rows: positions and states from two of
/// its samples; minimum and maximum of forces, speed, depth and errors, in time order, so that no peak is
/// lost. Omits damaged chunks. Memory: proportional to the points. Thread: a worker's.
Result<WebJson> samplePlot(Service& service, const WebCall& call);

/// All columns of gesture/sample_csv.h, `?from_s=&to_s=` (`to_s` exclusive); units are in the header. A piece
/// is a few chunks, whatever the session's length. A damaged chunk ends the stream with an error.
Result<WebStream> sampleCsv(Service& service, const WebCall& call);

}  // namespace needlelab
