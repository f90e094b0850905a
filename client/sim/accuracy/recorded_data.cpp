#include "client/sim/accuracy/recorded_data.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <system_error>

#include "common/base/csv.h"
#include "common/base/files.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostRows = 1'000'000;

// the first cell of each line after the header; readCsv has checked the lines' number of cells
std::vector<std::string> firstCells(const std::string& text) {
  std::vector<std::string> cells;
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line))
    if (!line.empty() && line != "\r") cells.push_back(line.substr(0, line.find(',')));
  return cells;
}

}  // namespace

std::filesystem::path recordedDataFolder() {
  const char* text = std::getenv("NEEDLELAB_DATA");
  return text != nullptr && *text != '\0' ? std::filesystem::path(text)
                                          : std::filesystem::path("../shared/data");
}

bool hasRecording(const std::filesystem::path& folder, const char* file) {
  std::error_code unreadable;  // an unreadable folder counts as empty
  return std::filesystem::is_regular_file(folder / file, unreadable);
}

std::string missingRecording(const std::filesystem::path& folder, const char* file) {
  return "skipped: " + (folder / file).string() +
         " is not there; set NEEDLELAB_DATA to the folder that holds needle_force";
}

Result<std::vector<ForceAtDepth>> readForceOverDepth(const std::filesystem::path& file, int* backward_steps) {
  ASSIGN_OR_RETURN(const auto table, readCsv(file, {"depth_m", "force_n"}, {}, kMostRows));
  const auto& depth = table.columns[static_cast<std::size_t>(table.find("depth_m"))];
  const auto& force = table.columns[static_cast<std::size_t>(table.find("force_n"))];
  std::vector<ForceAtDepth> rows;
  int backward = 0;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    rows.push_back({depth[i], force[i]});
    if (i > 0 && depth[i] < depth[i - 1]) ++backward;
  }
  std::stable_sort(rows.begin(), rows.end(),
                   [](const ForceAtDepth& a, const ForceAtDepth& b) { return a.depth_m < b.depth_m; });
  if (backward_steps != nullptr) *backward_steps = backward;
  return rows;
}

Result<std::vector<ForceAtTime>> readForceOverTime(const std::filesystem::path& file) {
  ASSIGN_OR_RETURN(const auto table, readCsv(file, {"t_s", "force_n"}, {}, kMostRows));
  const auto& time = table.columns[static_cast<std::size_t>(table.find("t_s"))];
  const auto& force = table.columns[static_cast<std::size_t>(table.find("force_n"))];
  std::vector<ForceAtTime> rows;
  for (std::size_t i = 0; i < time.size(); ++i) rows.push_back({time[i], force[i]});
  std::stable_sort(rows.begin(), rows.end(),
                   [](const ForceAtTime& a, const ForceAtTime& b) { return a.t_s < b.t_s; });
  return rows;
}

Result<std::vector<FilmTrace>> readFilmTraces(const std::filesystem::path& file) {
  // numbers are checked by readCsv; the traces' names are the first column
  ASSIGN_OR_RETURN(const auto table, readCsv(file, {"sample", "force_n"}, {}, kMostRows));
  ASSIGN_OR_RETURN(const auto text, readWholeFile(file, 64u << 20));
  const std::vector<std::string> names = firstCells(text);
  const auto& force = table.columns[static_cast<std::size_t>(table.find("force_n"))];
  if (names.size() != force.size())
    return Error{ErrorCode::kInvalidInput, fmt::format("{}: {} rows of numbers, but {} names of traces",
                                                       file.string(), force.size(), names.size())};
  std::vector<FilmTrace> traces;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (traces.empty() || traces.back().name != names[i]) {
      const std::size_t dash = names[i].find('-');
      if (dash == std::string::npos || dash < 2 || names[i][dash - 1] != 'G')
        return Error{ErrorCode::kInvalidInput,
                     fmt::format("{}:{}: trace is \"{}\", expected a gauge and a number as 16G-1",
                                 file.string(), i + 2, names[i])};
      traces.push_back({names[i], names[i].substr(0, dash), {}});
    }
    traces.back().force_N.push_back(force[i]);
  }
  return traces;
}

}  // namespace needlelab
