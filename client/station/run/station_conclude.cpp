// After the lesson: the server gets what it has not got yet, and a person reads how it went.
#include <algorithm>
#include <iostream>
#include <string>
#include <vector>

#include "client/net/uplink.h"
#include "client/station/run/local_score.h"
#include "client/station/run/say.h"
#include "client/station/run/signals.h"
#include "client/station/run/station_run.h"
#include "common/base/files.h"
#include "common/base/program.h"

namespace needlelab {

using namespace std::chrono_literals;

void StationRun::drain() {
  Uplink* const uplink = home_.uplink();
  if (uplink == nullptr) return;
  DrainPatience patience;
  patience.whole = std::chrono::duration<double>(options_.drain_s);
  // a disk that stayed full: the session ends at the next start only
  if (!session_->contents().ended)
    patience.whole = std::min(patience.whole, std::chrono::duration<double>(2));
  home_.requests().clear();
  // a second signal, or a person's second word, does not wait for the server any more
  const DrainEnd end = needlelab::drain(*uplink, patience, [&] {
    return signalWithin(signals_, 0ms) != 0 || home_.requests().takeStop().has_value();
  });
  if (const std::string words = drainText(end, uplink->state()); !words.empty()) say(words);
}

// once: it reads the whole recording again
void StationRun::scoreHere() {
  if (local_) return;
  local_ = localScore(*session_, lesson_, options_.X_WL);
  if (!local_->ok()) say("no score by this station: " + local_->error().message);
}

StationSummary StationRun::summarise() {
  StationSummary s;
  s.session_id = session_->idText();
  s.station = home_.station();
  s.trainee = options_.trainee;
  s.exercise = options_.exercise;
  s.profile = lesson_.profile.id();
  s.profile_revision = lesson_.profile_revision;
  s.device = device_->info().name;
  s.rate_hz = options_.rate_hz;
  s.servo = loop_->stats();
  s.writer = writer_->counts();
  s.ring_dropped = ring_.dropped();
  if (const SpoolLoss loss = session_->contents().loss; loss.samples > 0) s.lost_from_tick = loss.from_tick;
  s.axial_model = axialModelName(lesson_.model.axial_model);
  s.live_effects = liveEffects(lesson_.model);
  s.effect_costs = effect_costs_;
  s.realtime = realtime_;
  s.black_box = black_box_;
  s.device_notes = device_notes_;
  s.spool = options_.spool.string();
  if (stopped_) s.stopped = *stopped_;
  s.state = "OPEN";
  Uplink* const uplink = home_.uplink();
  s.has_server = uplink != nullptr;
  if (uplink != nullptr) {
    s.uplink = uplink->state();
    s.spool_left = s.uplink.chunks_left;
    s.samples_acked = session_->samplesIn(s.uplink.current_committed);
    if (s.uplink.current_verdict) {
      const auto& verdict = *s.uplink.current_verdict;
      s.state = verdict.state() == pb::SESSION_COMPLETE      ? "COMPLETE"
                : verdict.state() == pb::SESSION_INTERRUPTED ? "INTERRUPTED"
                                                             : "OPEN";
      s.score_json = verdict.score_json();
      s.score_source = "server";
    }
  } else {
    for (const auto& session : home_.spool().unfinished())
      s.spool_left +=
          session->contents().chunks - std::min(session->contents().chunks, session->receipt().committed);
  }
  if (local_->ok()) s.syringe_json = (*local_)->events_json;
  if (s.score_json.empty() && local_->ok()) {
    s.score_json = (*local_)->score_json;
    s.score_source = "station";
  }
  return s;
}

LessonOutcome StationRun::outcome() {
  scoreHere();
  LessonOutcome outcome;
  outcome.summary = summarise();
  outcome.stored = stored_;
  if (local_->ok()) outcome.curve = (*local_)->curve;
  return outcome;
}

int StationRun::report(const LessonOutcome& outcome, const std::vector<StationSummary>& earlier) {
  const StationSummary& summary = outcome.summary;
  const bool json_on_stdout = options_.json && options_.json_file.empty();
  (json_on_stdout ? std::cerr : std::cout) << summaryText(summary) << std::flush;
  if (json_on_stdout) std::cout << summaryJson(summary, earlier) << std::flush;
  if (options_.json && !json_on_stdout)
    if (auto status = writeFileAtomically(options_.json_file, viewOf(summaryJson(summary, earlier)));
        !status.ok()) {
      say(status.error().message);
      return kExitFailed;
    }
  if (summary.servo.fault != Fault::kNone) {
    say(std::string("the lesson ended in FAULT: ") + faultText(summary.servo.fault) +
        ". The force was taken away; the session is stored");
    return kExitFailed;
  }
  if (!std::cout) {
    say("cannot write the closing summary to standard output");
    return kExitFailed;
  }
  // the samples are safe in the spool, but nobody will ever see them there: that is no success
  if (!summary.uplink.current_trouble.empty() && !summary.uplink.current_verdict) {
    say("the server did not take the session: " + summary.uplink.current_trouble);
    return kExitFailed;
  }
  return outcome.stored.ok() ? kExitDone : kExitFailed;
}

}  // namespace needlelab
