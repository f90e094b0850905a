#include "client/station/window/verdict.h"

#include <algorithm>
#include <utility>

#include "common/base/text.h"
#include "common/scoring/measures.h"

namespace needlelab {
namespace {

void judge(const std::vector<Measure>& measures, LessonVerdict& verdict) {
  std::size_t missing = 0;
  for (const Measure& measure : measures) {
    VerdictRow row{measure.words, measure.passed};
    if (!measure.passed) {
      verdict.others.push_back(std::move(row));
      continue;
    }
    if (!*measure.passed) ++missing;
    verdict.required.push_back(std::move(row));
  }
  std::stable_sort(verdict.required.begin(), verdict.required.end(),
                   [](const VerdictRow& a, const VerdictRow& b) { return *a.passed < *b.passed; });
  const std::size_t all = verdict.required.size();
  if (all == 0) {
    verdict.kind = LessonVerdict::Kind::kNoRequirements;
    verdict.title = "Done: nothing is required here";
  } else if (missing == 0) {
    verdict.kind = LessonVerdict::Kind::kPassed;
    verdict.title = all == 1 ? "Passed" : formatted("Passed: all %zu requirements are met", all);
  } else {
    verdict.kind = LessonVerdict::Kind::kNotYet;
    verdict.title =
        formatted("Not yet: %zu of %zu requirements %s not met", missing, all, missing == 1 ? "is" : "are");
  }
}

}  // namespace

LessonVerdict verdictOf(const LessonOutcome& outcome) {
  const StationSummary& s = outcome.summary;
  LessonVerdict verdict;
  if (const auto measures = parseScore(s.score_json); !s.score_json.empty() && measures.ok()) {
    judge(*measures, verdict);
    verdict.by = s.score_source == "server" ? "scored by the server" : "scored by this station";
  } else {
    verdict.title = "No score: too little was recorded";
  }
  verdict.ended = s.servo.fault != Fault::kNone ? std::string("FAULT: ") + faultText(s.servo.fault)
                  : s.stopped                   ? stopText(s.stopped)
                                                : servoEndText(s.servo.end);
  if (!outcome.stored.ok()) {
    verdict.kept = outcome.stored.error().message;
    verdict.kept_well = false;
  } else if (!s.uplink.current_trouble.empty() && !s.uplink.current_verdict) {
    verdict.kept = "the server did not take it: " + s.uplink.current_trouble;
    verdict.kept_well = false;
  } else if (s.state == "COMPLETE" || s.state == "INTERRUPTED") {
    verdict.kept = "the recording is in the server's database";
  } else if (s.has_server) {
    verdict.kept = "the recording is safe here, and on its way to the server";
  } else {
    verdict.kept = "the recording is safe in this station's spool; it is sent when a server is given";
  }
  return verdict;
}

}  // namespace needlelab
