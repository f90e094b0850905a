/// `needlelab-sim anatomy`: what the layers along a needle's path cost, and how far off they are.
#include <fmt/core.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "client/sim/anatomy/anatomy_study.h"
#include "client/sim/command.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/profile/profile.h"
#include "common/profile/structure_kinds.h"
#include "common/profile/volume.h"

namespace needlelab {
namespace {

struct AnatomyOptions {
  std::filesystem::path profile, out;
  std::string normal = "y";
  AnatomyStudyOptions study;
  JsonOption json;
};

nlohmann::ordered_json rowsOf(const AnatomyReport& report) {
  auto rows = nlohmann::ordered_json::array();
  for (const AnatomyRow& row : report.rows)
    rows.push_back({{"method", row.method.name()},
                    {"step_mm", 1e3 * row.method.step_m},
                    {"boundary_p50_mm", row.boundary_p50_mm},
                    {"boundary_p99_mm", row.boundary_p99_mm},
                    {"boundary_max_mm", row.boundary_max_mm},
                    {"missed_percent", row.missed_percent},
                    {"extra_percent", row.extra_percent},
                    {"force_rms_n", row.force_rms_N},
                    {"path_rms_p99_n", row.path_rms_p99_N},
                    {"force_max_n", row.force_max_N},
                    {"march_p50_us", row.march_p50_us},
                    {"march_p99_us", row.march_p99_us}});
  return rows;
}

std::string hashText(const AnatomyReport& report) {
  return fmt::format("{:016x}", report.hash);
}

void printReport(const AnatomyReport& report) {
  std::printf("%s: %zu paths, %.1f layers each, of a field of %zu numbers; against a march of 0.02 mm\n\n",
              report.profile.c_str(), report.paths, report.layers_per_path, report.numbers);
  std::printf("%-13s %7s  %27s  %15s  %27s  %15s\n", "", "", "BOUNDARY, mm", "LAYERS, %", "FORCE, N",
              "MARCH, µs");
  std::printf("%-13s %7s  %8s %8s %8s   %7s %7s  %8s %9s %8s  %7s %7s\n", "METHOD", "STEP mm", "p50", "p99",
              "max", "missed", "extra", "rms", "path p99", "max", "p50", "p99");
  for (const AnatomyRow& row : report.rows)
    std::printf("%-13s %7.2f  %8.5f %8.5f %8.4f   %7.2f %7.2f  %8.5f %9.5f %8.3f  %7.1f %7.1f\n",
                row.method.name(), 1e3 * row.method.step_m, row.boundary_p50_mm, row.boundary_p99_mm,
                row.boundary_max_mm, row.missed_percent, row.extra_percent, row.force_rms_N,
                row.path_rms_p99_N, row.force_max_N, row.march_p50_us, row.march_p99_us);
  if (report.palpation_p50_us > 0)
    std::printf("\na tick with the cap on: %.1f us p50, %.1f us p99\n", report.palpation_p50_us,
                report.palpation_p99_us);
  std::printf("\nhash of the stacks (sphere steps, 0.1 mm): %s\n", hashText(report).c_str());
}

/// anatomy.csv: the rows; section.csv: across, up, structure of each pixel; anatomy.png from both.
Status writeFiles(const AnatomyReport& report, const pb::Profile& profile, char normal,
                  const std::filesystem::path& folder) {
  PlotTable rows("is_sphere,step_mm,boundary_p99_mm,force_rms_n,march_p50_us,method");
  for (const AnatomyRow& row : report.rows)
    if (row.method.steps != AnatomySteps::kEngine)
      rows.row({row.method.steps == AnatomySteps::kSphere ? 1.0 : 0.0, 1e3 * row.method.step_m,
                row.boundary_p99_mm, row.force_rms_N, row.march_p50_us},
               {row.method.name()});
  RETURN_IF_ERROR(writeFileAtomically(folder / "anatomy.csv", viewOf(rows.take())));

  ASSIGN_OR_RETURN(const Field field, fieldOf(profile.volume()));
  const AnatomySection section = anatomySection(field, profile, normal);
  PlotTable pixels("across_mm,up_mm,structure");
  for (std::size_t i = 0; i < section.pixels.size(); ++i) {
    const double across_m =
        section.left_m + (static_cast<double>(i % section.columns) + 0.5) * section.pixel_m;
    const double up_m = section.bottom_m + (static_cast<double>(i / section.columns) + 0.5) * section.pixel_m;
    const bool outside = section.pixels[i] == kOutside;
    pixels.row({1e3 * across_m, 1e3 * up_m, outside ? -1.0 : static_cast<double>(section.pixels[i])});
  }
  RETURN_IF_ERROR(writeFileAtomically(folder / "section.csv", viewOf(pixels.take())));
  if (!hasGnuplot()) {
    std::fprintf(stderr,
                 "needlelab-sim anatomy: gnuplot is not on the PATH: tables only (Debian: gnuplot-nox)\n");
    return {};
  }
  std::vector<std::string> names;
  std::vector<double> tissues;
  for (const auto& structure : profile.volume().structures()) {
    names.push_back(structure.layer().has_name() ? structure.layer().name() : structure.id());
    tissues.push_back(static_cast<double>(tissueOf(structure)));
  }
  return drawPlot("anatomy", folder / "anatomy.png",
                  {{"rows", (folder / "anatomy.csv").string()},
                   {"section", (folder / "section.csv").string()},
                   {"patient", profile.name()},
                   {"across", std::string(1, section.across)},
                   {"up", std::string(1, section.up)},
                   {"cut", fmt::format("{} = {:.0f} mm", normal, 1e3 * section.at_m)},
                   {"names", names},
                   {"tissues", tissues}});
}

int anatomy(const AnatomyOptions& options) {
  if (!options.out.empty()) {
    std::error_code made;
    std::filesystem::create_directories(options.out, made);
    if (made)
      return failed("anatomy", {ErrorCode::kInvalidInput, "--out " + options.out.string() +
                                                              ": cannot make the folder: " + made.message()});
  }
  if (const Status status = checkFolderOutputs({{"PROFILE", options.profile}}, {"--out", options.out},
                                               {"anatomy.csv", "section.csv", "anatomy.png"}, options.json);
      !status.ok())
    return failed("anatomy", status.error());
  const Result<pb::Profile> profile = loadProfile(options.profile);
  if (!profile.ok()) return failed("anatomy", profile.error());
  const bool shows = ::isatty(STDERR_FILENO) == 1;
  int shown = -1;
  const auto report = anatomyStudy(*profile, options.study, [&](double share) {
    const int percent = static_cast<int>(100 * share);
    if (shows && percent != shown)
      std::fprintf(stderr, "\r%d %%%s", shown = percent, percent == 100 ? "\n" : "");
  });
  if (!report.ok())
    return failed("anatomy", {report.error().code, options.profile.string() + ": " + report.error().message});
  if (options.json.wanted) {
    if (const Status status = writeJson(options.json, rowsOf(*report),
                                        {{"profile", report->profile},
                                         {"paths", report->paths},
                                         {"layers_per_path", report->layers_per_path},
                                         {"numbers", report->numbers},
                                         {"palpation_p50_us", report->palpation_p50_us},
                                         {"palpation_p99_us", report->palpation_p99_us},
                                         {"hash", hashText(*report)}});
        !status.ok())
      return failed("anatomy", status.error());
  } else {
    printReport(*report);
  }
  if (options.out.empty()) return kExitDone;
  const Status written = writeFiles(*report, *profile, options.normal.front(), options.out);
  return written.ok() ? kExitDone : failed("anatomy", written.error());
}

}  // namespace

void addAnatomyCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<AnatomyOptions>();
  CLI::App* command = app.add_subcommand(
      "anatomy",
      "What the layers along a needle's path cost in a profile with a volume, and how far off they are");
  command->add_option("PROFILE", options->profile, "a profile with a volume")->required();
  command->add_option("--paths", options->study.paths, "random needle paths")
      ->check(CLI::Range(1, 100'000))
      ->capture_default_str();
  command->add_option("--seed", options->study.seed, "of the paths")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--section", options->normal,
                   "the picture's section is perpendicular to this axis: x, y or z")
      ->check(CLI::IsMember({"x", "y", "z"}))
      ->capture_default_str();
  command->add_option("--out", options->out, "folder for anatomy.csv, section.csv and anatomy.png (gnuplot)");
  addJsonOption(*command, options->json);
  command->callback([options, &chosen] { chosen = [options] { return anatomy(*options); }; });
}

}  // namespace needlelab
