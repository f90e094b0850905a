#include "db/service/score_reference.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "common/scoring/measures.h"
#include "common/scoring/reference.h"
#include "db/service/handlers.h"
#include "db/session_results.h"

namespace needlelab {
namespace {

struct ReferenceScores {
  std::uint32_t version = 0;
  std::vector<std::vector<Measure>> gestures;
};

/// Scores of this version, of those sessions that have one; version 0: the newest that any of them has.
Result<ReferenceScores> referenceScores(Connection& reader, const pb::Reference& reference,
                                        std::uint32_t version) {
  std::vector<pb::Score> scores;
  for (const std::string& bytes : reference.session_ids()) {
    const auto id = handlers::sessionId(bytes);
    if (!id) return id.error();
    auto score = ScoreStore(reader).get(*id, version);
    if (!score && score.error().code != ErrorCode::kNotFound) return score.error();
    if (score) scores.push_back(std::move(*score));
  }
  ReferenceScores taken{version, {}};
  for (const pb::Score& score : scores) taken.version = std::max(taken.version, score.definition_version());
  for (const pb::Score& score : scores) {
    if (score.definition_version() != taken.version) continue;
    auto measures = parseScore(score.measures_json());
    if (!measures) return measures.error();
    taken.gestures.push_back(std::move(*measures));
  }
  return taken;
}

constexpr const char* kDistance = "dtw_distance_m";

/// The bands of stored measures, and that of the distances among the references as they are now.
std::vector<ReferenceBand> bandsWith(Connection& reader, ReferencePaths& paths,
                                     const pb::Reference& reference, const ReferenceScores& scores) {
  auto bands = referenceBands(scores.gestures);
  std::erase_if(bands, [](const ReferenceBand& band) { return band.name == kDistance; });
  const auto distances = distancesAmong(paths.ofReference(reader, reference, std::nullopt));
  if (!distances.empty()) bands.push_back(bandOf(kDistance, "m", distances));
  return bands;
}

}  // namespace

Status addBands(Connection& reader, ReferencePaths& paths, pb::Reference& reference) {
  const auto scores = referenceScores(reader, reference, 0);
  if (!scores) return scores.error();
  reference.set_definition_version(scores->version);
  for (const ReferenceBand& band : bandsWith(reader, paths, reference, *scores)) {
    auto* row = reference.add_bands();
    row->set_measure(band.name);
    row->set_unit(band.unit);
    row->set_n(static_cast<std::uint32_t>(band.n));
    row->set_mean(band.mean);
    if (band.n > 1) row->set_sd(band.sd);
    row->set_least(band.least);
    if (band.p10) row->set_p10(*band.p10);
    if (band.p25) row->set_p25(*band.p25);
    row->set_median(band.median);
    if (band.p75) row->set_p75(*band.p75);
    if (band.p90) row->set_p90(*band.p90);
    row->set_greatest(band.greatest);
  }
  return {};
}

Result<std::string> comparisonWith(Connection& reader, ReferencePaths& paths, const std::string& exercise_id,
                                   const pb::Score& score) {
  const auto reference = ReferenceStore(reader).get(exercise_id);
  if (!reference) return reference.error();
  if (reference->session_ids().empty()) return std::string();
  const auto scores = referenceScores(reader, *reference, score.definition_version());
  if (!scores) return scores.error();
  if (scores->gestures.empty()) return std::string();
  auto measures = parseScore(score.measures_json());
  if (!measures) return measures.error();
  const auto bands = bandsWith(reader, paths, *reference, *scores);
  std::erase_if(*measures, [](const Measure& measure) { return measure.name == kDistance; });
  const auto id = handlers::sessionId(score.session_id());
  if (!id) return id.error();
  if (const TipPath path = paths.of(reader, *id); !path.empty()) {
    std::optional<double> nearest;
    for (const TipPath& other : paths.ofReference(reader, *reference, *id)) {
      const auto distance = dtwDistance(path, other);
      if (distance && (!nearest || *distance < *nearest)) nearest = distance;
    }
    if (nearest) {
      Measure row;
      row.name = kDistance;
      row.unit = "m";
      row.value = *nearest;
      measures->push_back(row);
    }
  }
  return comparisonJson(compareWithReference(*measures, bands));
}

}  // namespace needlelab
