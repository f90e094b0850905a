#include "client/instructor/terminal/headless.h"

#include "client/instructor/terminal/update.h"

namespace needlelab {

void HeadlessRun::line(const std::string& text) const {
  out << text << '\n' << std::flush;
}

void HeadlessRun::note(const std::string& text) const {
  line(noteLine(text, options.json));
}

Status HeadlessRun::recover(const Error& why) const {
  note(why.message + "; connecting again");
  auto status = client.reconnect(end, stop);
  if (status.ok()) note("connected again");
  return status;
}

Status runHeadless(const HeadlessRun& run) {
  if (run.options.replay) return replaySession(run);
  if (!run.options.station.empty() || !run.options.session.empty()) return watchLive(run);
  return overview(run);
}

}  // namespace needlelab
