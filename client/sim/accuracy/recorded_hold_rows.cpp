/// Rows of the hold's relaxation and of the film's punctures.
#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/recorded_film.h"
#include "client/sim/accuracy/recorded_hold.h"
#include "client/sim/accuracy/recorded_rows.h"
#include "client/sim/accuracy/recorded_text.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr const char* kScene = "insert_hold_withdraw";

struct HoldChoice {
  const char* words;
  BlockChoice fit_on;
  bool extrapolates;
};
const std::vector<HoldChoice>& holdChoices() {
  // blocks of 0.5 s are counted from 0 s: the hold from 2.2 s to 9.85 s has the blocks 4 to 19
  static const std::vector<HoldChoice> choices = {
      {"even blocks of 0.5 s", [](int block) { return block % 2 != 0; }, false},
      {"odd blocks of 0.5 s", [](int block) { return block % 2 == 0; }, false},
      {"all from 5 s on (extrapolation)", [](int block) { return block < 10; }, true}};
  return choices;
}

AccuracyRow holdRow(const HoldFit& fit, const HoldChoice& choice) {
  const bool exponential = fit.mode == StopMode::kExponential;
  AccuracyRow row;
  row.scene = kScene;
  row.model = axialModelName(AxialModel::kEnhancedTrackingWall);
  row.variant = exponential
                    ? formatted("stop EXPONENTIAL, relax_time %.2f s, relax_residual %.3f, from %.3f N",
                                fit.relax_time_s, fit.relax_residual, fit.force_N)
                    : formatted("stop RAMP, over %.2f s from %.3f N to %.3f N", fit.stop_duration_s,
                                fit.force_N, fit.rejection_force_N);
  row.reference = std::string("recorded force over the hold (2.2 s to 9.85 s); held out: ") + choice.words;
  row.rms_error_n = fit.held_out.rms;
  row.max_error_n = fit.held_out.max;
  row.noticeable_n = noticeableForce_N(fit.force_N);
  AxialRun hold;
  const auto from = static_cast<std::ptrdiff_t>((kHoldFrom_s - fit.from_s) * fit.gesture.rate_hz);
  hold.force_N.assign(fit.run.force_N.begin() + from, fit.run.force_N.end());
  hold.flags.assign(fit.run.flags.begin() + from, fit.run.flags.end());
  addGreatestStep(hold, row);
  row.uncertainty = formatted(
      "%zu means over 0.1 s held out; error on the fitted part %.4f N; by single rows %.4f N, of which %.4f "
      "N is "
      "their scatter about those means (a noisy line, digitised)",
      fit.held_out.bins, fit.fitted.rms, fit.held_out.rows_rms, fit.held_out.floor);
  if (const auto model = compile(fit.scene, fit.gesture.rate_hz); model.ok())
    row.uncertainty += "; " + addTickTime(*model, fit.gesture, row);
  row.cannot_show =
      "one hold at one depth in one specimen: nothing about how residual and time depend on tissue, depth or "
      "speed "
      "before the stop";
  return row;
}

AccuracyRow withdrawalRow(const WithdrawalFit& fit, const HoldFit& hold) {
  AccuracyRow row;
  row.scene = kScene;
  row.model = axialModelName(AxialModel::kEnhancedTrackingWall);
  row.variant = formatted("attracted force %.3f N; the force turns at %.2f N/s", fit.attracted_force_N,
                          fit.speed_mps * 500);
  row.reference = "recorded force over the withdrawal (9.85 s to 11.5 s); held out: odd blocks of 0.1 s";
  row.rms_error_n = fit.held_out.rms;
  row.max_error_n = fit.held_out.max;
  row.noticeable_n = noticeableForce_N(hold.force_N);
  row.uncertainty =
      formatted("%zu means over 0.05 s held out; error on the fitted part %.4f N; by single rows %.4f N",
                fit.held_out.bins, fit.fitted.rms, fit.held_out.rows_rms);
  row.cannot_show =
      "the recording has no displacement: wall stiffness and speed act as one product, attracted force and "
      "inserted "
      "depth cannot be told apart from a slow needle, and the peak of 0.147 N may as well be a place as a "
      "force";
  return row;
}

AccuracyRow filmRow(const FilmPrediction& p, double rendered_N, bool stated) {
  AccuracyRow row;
  row.scene = "film_puncture";
  row.model = axialModelName(AxialModel::kEnhancedTrackingWall);
  row.variant = formatted("PUNCTURE of %s: predicted %.3f ± %.3f N, measured %.3f ± %.3f N, z = %+.2f",
                          p.measured.needle.c_str(), p.predicted_N, p.predicted_sd_N, p.measured.mean_N,
                          p.measured.sd_N, p.z);
  row.reference = std::string(stated ? "puncture force that the source states for the needle"
                                     : "greatest force of the needle's recorded traces") +
                  "; held out: that needle, predicted from the two others by a power law of outer diameter";
  row.rms_error_n = row.max_error_n = std::fabs(rendered_N - p.measured.mean_N);
  row.noticeable_n = noticeableForce_N(p.measured.mean_N);
  row.uncertainty = formatted(
      "z = (predicted - measured)/sd of both = %+.2f (criterion |z| <= 2: %s); exponent %.2f; the engine "
      "ruptures at %.4f N; ",
      p.z, std::fabs(p.z) <= 2 ? "met" : "missed", p.exponent, rendered_N);
  row.uncertainty += stated ? "sd of a single puncture, as stated"
                            : formatted("%d recorded, sd of a single puncture as stated by the source",
                                        p.measured.punctures);
  row.cannot_show =
      "three needles leave one number to test with: a power law is not shown to hold, only not contradicted; "
      "a film is "
      "no tissue, and its stretch before puncture is not compared";
  return row;
}

}  // namespace

Result<AccuracyRows> recordedHoldRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes) {
  if (!hasRecording(options.data, kHoldFile)) {
    notes.push_back(missingRecording(options.data, kHoldFile));
    return AccuracyRows{};
  }
  const auto recorded = readForceOverTime(options.data / kHoldFile);
  if (!recorded.ok()) return recorded.error();
  AccuracyRows rows;
  double done = 0;
  for (const HoldChoice& choice : holdChoices()) {
    for (const StopMode mode : {StopMode::kExponential, StopMode::kRamp}) {
      if (progress) progress("fitting the hold's relaxation", done / 7);
      done += 1;
      const auto fit = fitHold(*recorded, mode, choice.fit_on);
      if (!fit.ok()) return fit.error();
      rows.push_back(holdRow(*fit, choice));
    }
  }
  if (progress) progress("fitting the withdrawal", done / 7);
  const auto hold = fitHold(*recorded, StopMode::kExponential, [](int) { return true; });
  if (!hold.ok()) return hold.error();
  const auto withdrawal = fitWithdrawal(*recorded, *hold);
  if (!withdrawal.ok()) return withdrawal.error();
  rows.push_back(withdrawalRow(*withdrawal, *hold));
  return rows;
}

Result<AccuracyRows> recordedFilmRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes) {
  if (!hasRecording(options.data, kFilmFile)) {
    notes.push_back(missingRecording(options.data, kFilmFile));
    return AccuracyRows{};
  }
  if (progress) progress("puncture of a film", 0);
  const auto traces = readFilmTraces(options.data / kFilmFile);
  if (!traces.ok()) return traces.error();
  const auto measured = filmForcesOf(*traces);
  if (!measured.ok()) return measured.error();
  AccuracyRows rows;
  for (const bool stated : {false, true}) {
    const std::vector<FilmForce> forces = stated ? statedFilmForces() : *measured;
    for (std::size_t i = 0; i < forces.size(); ++i) {
      const FilmPrediction p =
          predictFilmForce(forces[i], forces[(i + 1) % forces.size()], forces[(i + 2) % forces.size()]);
      const auto rendered = renderedPuncture_N(p.predicted_N);
      if (!rendered.ok()) return rendered.error();
      rows.push_back(filmRow(p, *rendered, stated));
    }
  }
  return rows;
}

}  // namespace needlelab
