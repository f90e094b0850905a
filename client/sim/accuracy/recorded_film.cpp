#include "client/sim/accuracy/recorded_film.h"

#include <algorithm>
#include <cmath>

#include "client/sim/accuracy/recorded_run.h"

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
  const auto run = runStraight(scene, constantSpeed(-0.0005, 0.003, 0.003, 1000));
  if (!run.ok()) return run.error();
  return *std::max_element(run->force_N.begin(), run->force_N.end());
}

}  // namespace needlelab
