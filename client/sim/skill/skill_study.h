/// Tests whether the measures separate a sure hand from an unsure one. The server's scoring code scores
/// simulated hands of known skill. This checks the machinery only; it is not evidence about people.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "client/device/hand_options.h"
#include "client/sim/skill/effect_size.h"
#include "common/base/result.h"

namespace needlelab {

struct SkillStudyOptions {
  /// 4-200, an even number: half of them are novices, half experts. With 12 no p can be below 2/924, which is
  /// above 0.05 once it is corrected for 37 measures.
  std::size_t trainees = 16;
  std::size_t attempts = 4;  ///< of each at each exercise, 1-100
  std::uint64_t seed = 1;
  std::size_t shuffles = 2000;
  std::size_t exercises = 6;  ///< the first so many of the course injection-steps, 1-6
};

/// Skill of trainee `i` of `n`: novices from 0 to 0.4, experts from 0.6 to 1, evenly spread.
double levelOf(std::size_t i, std::size_t n);

/// Where the experts stand by a measure that separates.
enum class Separation : std::uint8_t {
  kNone,
  kTowardsBetter,  ///< they have more where more is better, or less where less is
  kTowardsWorse,
  kNoBetterEnd,  ///< neither less nor more of it is better
};
/// "no", "yes", "the other way", "yes, no better end".
const char* separationName(Separation separation);

/// One measure over all trainees; a trainee counts once, by the mean over attempts and exercises.
struct SkillRow {
  std::string measure, unit, better;
  double novice_mean = 0, expert_mean = 0;  ///< in the measure's unit, over all exercises
  double novice_sd = 0, expert_sd = 0;      ///< between trainees
  /// Of the standardised values: each exercise's less its mean, over its spread, averaged over exercises.
  double hedges_g = 0;
  Interval g_95;
  double cliffs_delta = 0;     ///< of experts against novices
  double p = 1;                ///< of the permutation test (effect_size.h), by itself
  double p_holm = 1;           ///< corrected for all rows of the report
  double shuffled_share = 0;   ///< of the shuffles in which p ≤ 0.05, uncorrected
  std::vector<double> values;  ///< standardised, one per trainee, in order of skill
  /// 500 Hz against 2 kHz: greatest difference over the gestures tried, in the unit, and as a share of the
  /// spread between trainees (0 where there is no spread).
  double rate_difference = 0, rate_share_of_spread = 0;
  double rate_tolerance = 0;  ///< the difference up to which it counts as the same (rateTolerance)
  [[nodiscard]] bool sameAtBothRates() const { return rate_difference <= rate_tolerance; }
  /// By p_holm ≤ 0.05 and the sign of Cliff's delta, which the test is of.
  [[nodiscard]] Separation separation() const;
};

/// How far a measure of the same movement may be off between 500 Hz and 2 kHz, in its unit. Set by hand,
/// below the usual steps of a requirement: 8 ms, 0.2 mm, 5 mm², 0.1 N (a peak may fall between two ticks), 2
/// mm/s, 5 µJ, 0.5 % of a share, 0.5 of SPARC and of LDLJ (sums over a spectrum, and a logarithm); counts
/// must be the same.
double rateTolerance(const std::string& measure, const std::string& unit);

struct SkillReport {
  SkillStudyOptions options;
  std::vector<std::string> exercises;    ///< profiles
  std::vector<HandSkill> hands;          ///< by trainee
  std::size_t gestures = 0, faults = 0;  ///< faults: the gate ended them, they were not scored
  std::vector<SkillRow> rows;            ///< greatest |g| first
  std::vector<std::string> constant;     ///< measures that are the same for every trainee
  double shuffled_any_share = 0;         ///< of the shuffles in which any measure separates (p_holm)
  double shuffled_mean_share = 0;        ///< of the measures with p ≤ 0.05, uncorrected, mean over shuffles
  double shuffled_most_share = 0;        ///< in the worst of them
  bool exact_test = false;
  std::size_t rate_gestures = 0;
};

/// `progress(done, all)`: called now and then, from this thread; may be empty. Errors: kInvalidInput
/// (options).
Result<SkillReport> runSkillStudy(const SkillStudyOptions& options,
                                  const std::function<void(std::size_t, std::size_t)>& progress = {});

/// The finding in one sentence, and the caution that goes with it. It counts the measures that separate
/// towards their better end ("find them better", of those that have one) and, apart, those that separate the
/// other way.
std::string findingOf(const SkillReport& report);
extern const char* const kSkillCaution;

}  // namespace needlelab
