#include "client/sim/accuracy/recorded_film.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/recorded.h"
#include "client/sim/accuracy/recorded_fit.h"

namespace needlelab {

const std::array<FilmNeedle, 3>& filmNeedles() {
  static const std::array<FilmNeedle, 3> needles = {
      {{"16G", 1.651e-3, 0.364, 0.013}, {"18G", 1.270e-3, 0.298, 0.028}, {"21G", 0.8192e-3, 0.231, 0.023}}};
  return needles;
}

Result<std::vector<FilmForce>> filmForcesOf(const std::vector<FilmTrace>& traces) {
  std::vector<FilmForce> forces;
  for (const FilmNeedle& needle : filmNeedles()) {
    FilmForce force{needle.name, needle.diameter_m, 0, 0, 0};
    for (const FilmTrace& trace : traces) {
      if (trace.needle != needle.name || trace.force_N.empty()) continue;
      force.mean_N += *std::max_element(trace.force_N.begin(), trace.force_N.end());
      ++force.punctures;
    }
    if (force.punctures == 0)
      return Error{ErrorCode::kInvalidInput, "no trace of a " + needle.name + " needle in the recording"};
    force.mean_N /= force.punctures;
    force.sd_N = needle.stated_sd_N / std::sqrt(static_cast<double>(force.punctures));
    forces.push_back(force);
  }
  return forces;
}

std::vector<FilmForce> statedFilmForces() {
  std::vector<FilmForce> forces;
  for (const FilmNeedle& needle : filmNeedles())
    forces.push_back({needle.name, needle.diameter_m, needle.stated_mean_N, needle.stated_sd_N, 1});
  return forces;
}

FilmPrediction predictFilmForce(const FilmForce& left_out, const FilmForce& a, const FilmForce& b) {
  FilmPrediction p;
  p.measured = left_out;
  // ln F is linear in ln d: between (or beyond) the two others at share t
  const double span = std::log(b.diameter_m / a.diameter_m);
  const double t = std::log(left_out.diameter_m / a.diameter_m) / span;
  p.exponent = std::log(b.mean_N / a.mean_N) / span;
  p.predicted_N = std::exp(std::lerp(std::log(a.mean_N), std::log(b.mean_N), t));
  p.predicted_sd_N = p.predicted_N * std::hypot((1 - t) * a.sd_N / a.mean_N, t * b.sd_N / b.mean_N);
  p.z = (p.predicted_N - left_out.mean_N) / std::hypot(p.predicted_sd_N, left_out.sd_N);
  return p;
}

Result<double> renderedPuncture_N(double force_N) {
  // a film that gives way by 1 mm; nothing behind it
  SceneSpec scene = fittedSceneBase();
  scene.effects = bitOf(Effect::kPuncture);
  scene.layers.push_back({});
  scene.layers[0].thickness_m = 0.01;
  scene.layers[0].membrane = MembraneSpec{force_N / 1e-3, 0, force_N};
  ASSIGN_OR_RETURN(const auto run, runStraight(scene, constantSpeed(-0.0005, 0.003, 0.003, 1000)));
  return *std::max_element(run.force_N.begin(), run.force_N.end());
}

namespace {

AccuracyRow filmRow(const FilmPrediction& p, double rendered_N, bool stated) {
  AccuracyRow row;
  row.scene = "film_puncture";
  row.model = axialModelName(AxialModel::kEnhancedTrackingWall);
  row.variant = fmt::format(
      "PUNCTURE of {}: predicted {:.3f} ± {:.3f} N, measured {:.3f} ± {:.3f} N, z = {:+.2f}",
      p.measured.needle, p.predicted_N, p.predicted_sd_N, p.measured.mean_N, p.measured.sd_N, p.z);
  row.reference = std::string(stated ? "puncture force that the source states for the needle"
                                     : "greatest force of the needle's recorded traces") +
                  "; held out: that needle, predicted from the two others by a power law of outer diameter";
  row.rms_error_n = row.max_error_n = std::fabs(rendered_N - p.measured.mean_N);
  row.noticeable_n = noticeableForce_N(p.measured.mean_N);
  row.uncertainty = fmt::format(
      "z = (predicted - measured)/sd of both = {:+.2f} (criterion |z| <= 2: {}); exponent {:.2f}; the engine "
      "ruptures at {:.4f} N; ",
      p.z, std::fabs(p.z) <= 2 ? "met" : "missed", p.exponent, rendered_N);
  row.uncertainty += stated ? "sd of a single puncture, as stated"
                            : fmt::format("{} recorded, sd of a single puncture as stated by the source",
                                          p.measured.punctures);
  row.cannot_show =
      "three needles leave one number to test with: a power law is not shown to hold, only not contradicted; "
      "a film is "
      "no tissue, and its stretch before puncture is not compared";
  return row;
}

}  // namespace

Result<AccuracyRows> recordedFilmRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes) {
  if (!hasRecording(options.data, kFilmFile)) {
    notes.push_back(missingRecording(options.data, kFilmFile));
    return AccuracyRows{};
  }
  if (progress) progress("puncture of a film", 0);
  ASSIGN_OR_RETURN(const auto traces, readFilmTraces(options.data / kFilmFile));
  ASSIGN_OR_RETURN(const auto measured, filmForcesOf(traces));
  AccuracyRows rows;
  for (const bool stated : {false, true}) {
    const std::vector<FilmForce> forces = stated ? statedFilmForces() : measured;
    for (std::size_t i = 0; i < forces.size(); ++i) {
      const FilmPrediction p =
          predictFilmForce(forces[i], forces[(i + 1) % forces.size()], forces[(i + 2) % forces.size()]);
      ASSIGN_OR_RETURN(const auto rendered, renderedPuncture_N(p.predicted_N));
      rows.push_back(filmRow(p, rendered, stated));
    }
  }
  return rows;
}

Result<RecordedPicture> recordedFilmPicture(const AccuracyOptions& options) {
  ASSIGN_OR_RETURN(const auto traces, readFilmTraces(options.data / kFilmFile));
  ASSIGN_OR_RETURN(const auto forces, filmForcesOf(traces));
  PlotBlocks data;
  std::vector<double> d, measured, measured_sd, predicted, predicted_sd, z, scale, exponent, diameter_mm;
  std::vector<std::string> needle, legend;
  double greatest_z = 0;
  for (const bool stated : {false, true}) {
    const auto set = stated ? statedFilmForces() : forces;
    std::vector<std::vector<double>> m(3), p(3);
    for (std::size_t i = 0; i < set.size(); ++i) {
      const FilmForce &a = set[(i + 1) % 3], &b = set[(i + 2) % 3];
      const FilmPrediction prediction = predictFilmForce(set[i], a, b);
      const double x = set[i].diameter_m * 1e3;
      m[0].push_back(x);
      m[1].push_back(set[i].mean_N);
      m[2].push_back(set[i].sd_N);
      p[0].push_back(x * 1.012);  // beside, so that bars do not cover each other
      p[1].push_back(prediction.predicted_N);
      p[2].push_back(prediction.predicted_sd_N);
      d.push_back(set[i].diameter_m);
      measured.push_back(set[i].mean_N);
      measured_sd.push_back(set[i].sd_N);
      predicted.push_back(prediction.predicted_N);
      predicted_sd.push_back(prediction.predicted_sd_N);
      z.push_back(prediction.z);
      greatest_z = std::max(greatest_z, std::fabs(prediction.z));
      // the law of the two others
      scale.push_back(a.mean_N / std::pow(a.diameter_m * 1e3, prediction.exponent));
      exponent.push_back(prediction.exponent);
      diameter_mm.push_back(x);
      needle.push_back(set[i].needle);
      legend.push_back(fmt::format("{} left out: z = {:+.2f}", set[i].needle, prediction.z));
    }
    data.columns(fmt::format("measured {}", stated ? 1 : 0), m);
    data.columns(fmt::format("predicted {}", stated ? 1 : 0), p);
  }
  return RecordedPicture{
      "recorded_film",
      csvOf({{"diameter_m", d},
             {"measured_n", measured},
             {"measured_sd_n", measured_sd},
             {"predicted_n", predicted},
             {"predicted_sd_n", predicted_sd},
             {"z", z}}),
      data.text(),
      {{"finding",
        fmt::format("Each needle is predicted by the power law of the two others, |z| ≤ {:.2f}: not "
                    "contradicted, not proven",
                    greatest_z)},
       {"scale", scale},
       {"exponent", exponent},
       {"diameter_mm", diameter_mm},
       {"needle", needle},
       {"legend", legend}}};
}

}  // namespace needlelab
