/// `needlelab-sim skill`: finds the measures that separate simulated hands of different skill.
#include <fmt/core.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "client/sim/command.h"
#include "client/sim/skill/skill_study.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

struct SkillOptions {
  SkillStudyOptions study;
  std::filesystem::path pictures;
  JsonOption json;
};

nlohmann::ordered_json finiteOrNull(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
}

nlohmann::ordered_json rowsOfStudy(const SkillReport& report) {
  auto rows = nlohmann::ordered_json::array();
  for (const SkillRow& row : report.rows) {
    rows.push_back({{"measure", row.measure},
                    {"unit", row.unit},
                    {"better", row.better},
                    {"novice_mean", row.novice_mean},
                    {"novice_sd", row.novice_sd},
                    {"expert_mean", row.expert_mean},
                    {"expert_sd", row.expert_sd},
                    {"hedges_g", finiteOrNull(row.hedges_g)},
                    {"g_low_95", finiteOrNull(row.g_95.low)},
                    {"g_high_95", finiteOrNull(row.g_95.high)},
                    {"cliffs_delta", row.cliffs_delta},
                    {"p", row.p},
                    {"p_holm", row.p_holm},
                    {"separates", separationName(row.separation())},
                    {"shuffled_share", row.shuffled_share},
                    {"rate_difference", row.rate_difference},
                    {"rate_tolerance", row.rate_tolerance},
                    {"same_at_both_rates", row.sameAtBothRates()},
                    {"rate_share_of_spread", row.rate_share_of_spread}});
  }
  return rows;
}

nlohmann::ordered_json restOfStudy(const SkillReport& report) {
  auto hands = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < report.hands.size(); ++i) {
    const HandSkill& hand = report.hands[i];
    hands.push_back({{"level", levelOf(i, report.hands.size())},
                     {"tremor_m", hand.tremor_m},
                     {"speed_m_s", hand.speed_mps},
                     {"aim_m", hand.aim_m},
                     {"overshoot_m", hand.overshoot_m},
                     {"pieces", hand.pieces}});
  }
  const auto measuresOf = [&](Separation separation) {
    std::vector<std::string> measures;
    for (const SkillRow& row : report.rows)
      if (row.separation() == separation) measures.push_back(row.measure);
    return measures;
  };
  std::vector<std::string> differ;
  for (const SkillRow& row : report.rows)
    if (!row.sameAtBothRates()) differ.push_back(row.measure);
  return {{"finding", findingOf(report)},
          {"caution", kSkillCaution},
          {"seed", report.options.seed},
          {"trainees", report.options.trainees},
          {"attempts", report.options.attempts},
          {"exercises", report.exercises},
          {"gestures", report.gestures},
          {"faults", report.faults},
          {"do_not_separate", measuresOf(Separation::kNone)},
          {"separate_the_other_way", measuresOf(Separation::kTowardsWorse)},
          {"separate_without_a_better_end", measuresOf(Separation::kNoBetterEnd)},
          {"differ_between_rates", differ},
          {"the_same_for_all", report.constant},
          {"shuffles", report.options.shuffles},
          {"shuffled_any_share", report.shuffled_any_share},
          {"shuffled_mean_share", report.shuffled_mean_share},
          {"shuffled_most_share", report.shuffled_most_share},
          {"exact_test", report.exact_test},
          {"rate_gestures", report.rate_gestures},
          {"hands", hands}};
}

void printStudy(const SkillReport& report) {
  std::printf("%s.\n%s\n\n", findingOf(report).c_str(), kSkillCaution);
  std::printf("%-28s %-8s %12s %12s %-4s %8s %17s %7s %7s %7s  %-18s  %s\n", "MEASURE", "BETTER", "NOVICES",
              "EXPERTS", "", "G", "95 %", "DELTA", "P", "P HOLM", "SEPARATES", "500 Hz/2 kHz");
  for (const SkillRow& row : report.rows) {
    std::printf("%-28s %-8s %12.5g %12.5g %-4s %8.2f [%6.2f, %6.2f] %7.2f %7.4f %7.4f  %-18s  %.2g%s\n",
                row.measure.c_str(), row.better.c_str(), row.novice_mean, row.expert_mean, row.unit.c_str(),
                row.hedges_g, row.g_95.low, row.g_95.high, row.cliffs_delta, row.p, row.p_holm,
                separationName(row.separation()), row.rate_difference,
                row.sameAtBothRates() ? "" : " (above its tolerance)");
  }
  if (!report.constant.empty()) {
    std::printf("\nthe same for all:");
    for (const std::string& name : report.constant) std::printf(" %s", name.c_str());
    std::printf("\n");
  }
  std::printf(
      "\n%zu gestures, %zu ended by the gate; seed %llu; labels shuffled %zu times: any measure separates in "
      "%.1f %% of them; uncorrected, %.1f %% of the measures would on average, %.1f %% at most\n",
      report.gestures, report.faults, static_cast<unsigned long long>(report.options.seed),
      report.options.shuffles, 100 * report.shuffled_any_share, 100 * report.shuffled_mean_share,
      100 * report.shuffled_most_share);
}

// Writes skill.csv, and skill.png if gnuplot is found. Effects point to the measure's better end: if less is
// better, g and its interval change sign.
Status drawSkill(const SkillReport& report, const std::filesystem::path& folder) {
  if (report.rows.empty())
    return Error{ErrorCode::kFailed, "no measure differs between trainees: nothing to draw"};
  PlotTable table("place,g_to_better,low_95,high_95,separates,measure");
  for (std::size_t i = 0; i < report.rows.size(); ++i) {
    const SkillRow& row = report.rows[i];
    const bool turned = row.better == "less";
    table.row({static_cast<double>(report.rows.size() - i), turned ? -row.hedges_g : row.hedges_g,
               turned ? -row.g_95.high : row.g_95.low, turned ? -row.g_95.low : row.g_95.high,
               static_cast<double>(row.separation())},
              {row.measure});
  }
  const auto csv = folder / "skill.csv";
  RETURN_IF_ERROR(writeFileAtomically(csv, viewOf(table.take())));
  if (!hasGnuplot()) {
    std::fprintf(stderr,
                 "needlelab-sim skill: gnuplot is not on the PATH: table only (Debian: gnuplot-nox)\n");
    return {};
  }
  return drawPlot("skill", folder / "skill.png", {{"csv", csv.string()}, {"finding", findingOf(report)}});
}

int skill(const SkillOptions& options) {
  if (!options.pictures.empty()) {
    std::error_code made;
    std::filesystem::create_directories(options.pictures, made);
    if (made)
      return failed("skill", {ErrorCode::kInvalidInput, "--pictures " + options.pictures.string() +
                                                            ": cannot make the folder: " + made.message()});
  }
  if (const Status status =
          checkFolderOutputs({}, {"--pictures", options.pictures}, {"skill.csv", "skill.png"}, options.json);
      !status.ok())
    return failed("skill", status.error());
  const bool shows = ::isatty(STDERR_FILENO) == 1;
  const auto report = runSkillStudy(options.study, [&](std::size_t done, std::size_t all) {
    if (shows && (done % 16 == 0 || done == all))
      std::fprintf(stderr, "\r%zu of %zu gestures%s", done, all, done == all ? "\n" : "");
  });
  if (!report.ok()) return failed("skill", report.error());
  if (options.json.wanted) {
    if (const Status status = writeJson(options.json, rowsOfStudy(*report), restOfStudy(*report));
        !status.ok())
      return failed("skill", status.error());
  } else {
    printStudy(*report);
  }
  if (!options.pictures.empty()) {
    if (const Status status = drawSkill(*report, options.pictures); !status.ok())
      return failed("skill", status.error());
  }
  return kExitDone;
}

}  // namespace

void addSkillCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<SkillOptions>();
  CLI::App* command = app.add_subcommand(
      "skill", "Which measures tell simulated hands of different skill apart; no evidence about people");
  command->add_option("--trainees", options->study.trainees, "simulated people, an even number from 4 to 200")
      ->check(CLI::NonNegativeNumber)  // -1 would be read as the largest number
      ->capture_default_str();
  command->add_option("--attempts", options->study.attempts, "of each at each exercise, 1 to 100")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--exercises", options->study.exercises,
                   "the first so many of the course injection-steps, 1 to 6")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--seed", options->study.seed, "of everything that is left to chance")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--pictures", options->pictures, "a folder for skill.csv and skill.png (gnuplot)");
  addJsonOption(*command, options->json);
  command->callback([options, &chosen] { chosen = [options] { return skill(*options); }; });
}

}  // namespace needlelab
