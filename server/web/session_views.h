/// A stored session's samples for a browser: decimated for a plot, or all of them as CSV.
#pragma once

#include "common/base/result.h"
#include "db/service/service.h"
#include "server/base/http_message.h"
#include "server/web/web_call.h"

namespace needlelab {

/// `?from_s=&to_s=&points=` (2-10000, by default 2000): {rate_hz, samples, from_s, to_s, decimated, columns:
/// {name: []}} with the names of the CSV. Times are s since the recording's first sample. Where there are
/// more samples than points, each of `points`/2 equal spans of time gives two rows: positions and states of
/// two of its samples, and of forces, speed, depth and errors the least and the greatest, in the order in
/// which they came: no peak is lost. Damaged chunks are left out. Memory: the points. Thread: a worker's.
Result<WebJson> samplePlot(Service& service, const WebCall& call);

/// All columns of gesture/sample_csv.h, `?from_s=&to_s=` (to is not in it); units stand in the header. A
/// piece is a few chunks, whatever the session's length. A damaged chunk ends the stream with an error.
Result<WebStream> sampleCsv(Service& service, const WebCall& call);

}  // namespace needlelab
