/// Tests whether the measures separate a skilled hand from an unskilled one: the server's scoring code scores
/// simulated hands of known skill. This only checks the machinery; it is not evidence about people.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "client/device/hand/hand_options.h"
#include "client/sim/skill/effect_size.h"
#include "common/base/result.h"

namespace needlelab {

struct SkillStudyOptions {
  /// 4-200, even: half are novices, half experts. With 12, p is at least 2/924, which exceeds 0.05 after
  /// correction for 37 measures.
  std::size_t trainees = 16;
  std::size_t attempts = 4;  ///< per trainee and exercise, 1-100
  std::uint64_t seed = 1;
  std::size_t shuffles = 2000;
  std::size_t exercises = 6;  ///< the first ones of the course injection-steps, 1-6
};

/// Skill of trainee `i` of `n`: novices from 0 to 0.4, experts from 0.6 to 1, evenly spaced.
double levelOf(std::size_t i, std::size_t n);

/// Where the experts are relative to the novices, for a measure that separates.
enum class Separation : std::uint8_t {
  kNone,
  kTowardsBetter,  ///< more where more is better, or less where less is
  kTowardsWorse,
  kNoBetterEnd,  ///< neither end of the measure is better
};
/// "no", "yes", "the other way", "yes, no better end".
const char* separationName(Separation separation);

/// One measure over all trainees. A trainee counts once, by the mean over attempts and exercises.
struct SkillRow {
  std::string measure, unit, better;
  double novice_mean = 0, expert_mean = 0;  ///< in the measure's unit, over all exercises
  double novice_sd = 0, expert_sd = 0;      ///< between trainees
  /// Of the standardised values: per exercise (value − mean)/spread, averaged over exercises.
  double hedges_g = 0;
  Interval g_95;
  double cliffs_delta = 0;     ///< of experts relative to novices
  double p = 1;                ///< of the permutation test (effect_size.h), uncorrected
  double p_holm = 1;           ///< corrected for all rows of the report
  double shuffled_share = 0;   ///< share of shuffles with p ≤ 0.05, uncorrected
  std::vector<double> values;  ///< standardised, one per trainee, ordered by skill
  /// 500 Hz compared with 2 kHz: the largest difference over the tested gestures, in the unit, and as a share
  /// of the spread between trainees (0 without spread).
  double rate_difference = 0, rate_share_of_spread = 0;
  double rate_tolerance = 0;  ///< largest difference that still counts as equal (rateTolerance)
  [[nodiscard]] bool sameAtBothRates() const { return rate_difference <= rate_tolerance; }
  /// From p_holm ≤ 0.05 and the sign of Cliff's delta, the tested quantity.
  [[nodiscard]] Separation separation() const;
};

/// Largest allowed difference of a measure of the same movement between 500 Hz and 2 kHz, in its unit. Set by
/// hand, below the usual steps of a requirement: 8 ms, 0.2 mm, 5 mm², 0.1 N (a peak may fall between two
/// ticks), 2 mm/s, 5 µJ, 0.5 % of a share, 0.5 of SPARC and of LDLJ (sums over a spectrum, and a logarithm);
/// counts must be equal.
double rateTolerance(const std::string& measure, const std::string& unit);

struct SkillReport {
  SkillStudyOptions options;
  std::vector<std::string> exercises;    ///< profiles
  std::vector<HandSkill> hands;          ///< per trainee
  std::size_t gestures = 0, faults = 0;  ///< faults: gestures ended by the gate, not scored
  std::vector<SkillRow> rows;            ///< largest |g| first
  std::vector<std::string> constant;     ///< measures with the same value for all trainees
  double shuffled_any_share = 0;         ///< share of shuffles in which any measure separates (p_holm)
  double shuffled_mean_share = 0;  ///< share of measures with p ≤ 0.05, uncorrected, mean over shuffles
  double shuffled_most_share = 0;  ///< in the worst shuffle
  bool exact_test = false;
  std::size_t rate_gestures = 0;
};

/// `progress(done, all)`: called now and then on this thread; may be empty. Errors: kInvalidInput (options).
Result<SkillReport> runSkillStudy(const SkillStudyOptions& options,
                                  const std::function<void(std::size_t, std::size_t)>& progress = {});

/// The finding in one sentence, and its caution. Counts the measures that separate towards their better end
/// ("find them better", of those that have one) and, separately, those that separate the other way.
std::string findingOf(const SkillReport& report);
extern const char* const kSkillCaution;

}  // namespace needlelab
