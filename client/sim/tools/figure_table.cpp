#include "client/sim/tools/figure_table.h"

#include <algorithm>
#include <cstdio>

namespace needlelab {
namespace {

// pale, so that lines stay readable: free motion, insertion, stop, withdrawal
const char* shadeOf(Phase phase) {
  switch (phase) {
    case Phase::kFree:
      return "#ffffff";
    case Phase::kInserting:
      return "#e8f1fa";
    case Phase::kStopped:
      return "#fdf3dc";
    case Phase::kWithdrawing:
      return "#e9f5ec";
  }
  return "#ffffff";
}

const char* wordsOf(Phase phase) {
  switch (phase) {
    case Phase::kFree:
      return "free motion";
    case Phase::kInserting:
      return "insertion";
    case Phase::kStopped:
      return "stop";
    case Phase::kWithdrawing:
      return "withdrawal";
  }
  return "";
}

}  // namespace

void FigureTable::row(std::span<const double> numbers, std::initializer_list<std::string_view> words) {
  char cell[40];
  bool first = true;
  for (const double number : numbers) {
    std::snprintf(cell, sizeof cell, "%s%.9g", first ? "" : ",", number);
    text_ += cell;
    first = false;
  }
  for (const std::string_view word : words) {
    text_ += ',';
    text_ += word;
  }
  text_ += '\n';
}

std::vector<PhaseSpan> phaseSpans(const FigureRun& run, double least_s) {
  std::vector<PhaseSpan> raw;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const Phase phase = run.ticks[i].report.phase;
    if (raw.empty() || raw.back().phase != phase) raw.push_back({phase, run.time_s(i), run.time_s(i)});
    raw.back().to_s = run.time_s(i) + 1 / run.rate_hz;
  }
  std::vector<PhaseSpan> spans;
  for (const PhaseSpan& span : raw) {
    const bool joins =
        !spans.empty() && (span.to_s - span.from_s < least_s || spans.back().phase == span.phase);
    if (joins)
      spans.back().to_s = span.to_s;
    else
      spans.push_back(span);
  }
  return spans;
}

std::string figureStyle() {
  return R"(set datafile separator ','
set datafile missing 'nan'
set border 3 lc rgb '#4a5560' lw 1.2
set tics nomirror out scale 0.6 textcolor rgb '#2b333b'
set grid back lc rgb '#d9dee3' lw 0.8 dt 1
set style line 1 lc rgb '#1f5fa8' lw 2.4
set style line 2 lc rgb '#e07b1f' lw 2.4 dt (12,5)
set style line 3 lc rgb '#c0303b' lw 2.4
set style line 4 lc rgb '#2a8a4a' lw 2.4
set style line 5 lc rgb '#d6338a' lw 2.0
set style line 6 lc rgb '#7d8790' lw 1.2 dt (4,4)
set key box lc rgb '#c9d0d6' lw 0.8 opaque samplen 2.6 spacing 1.25 width 1 height 0.4 textcolor rgb '#2b333b'
set xlabel textcolor rgb '#2b333b'
set ylabel textcolor rgb '#2b333b'
)";
}

std::string fixed(double number, int digits) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", digits, number);
  return text;
}

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c);
  return out + "'";
}

std::string phaseShades(const std::vector<PhaseSpan>& spans, int first) {
  std::string script;
  for (const PhaseSpan& span : spans)
    script += "set object " + std::to_string(first++) + " rectangle from first " + fixed(span.from_s, 4) +
              ", graph 0 to first " + fixed(span.to_s, 4) + ", graph 1 behind fc rgb '" +
              shadeOf(span.phase) + "' fs solid noborder\n";
  return script;
}

std::string phaseNames(const std::vector<PhaseSpan>& spans, double from_s, double to_s) {
  constexpr double kShare_per_letter = 0.0075;  // of the axis, in the font below on a picture of 1200 pixels
  std::string script;
  for (const PhaseSpan& span : spans) {
    const std::string words = wordsOf(span.phase);
    const double from = std::max(span.from_s, from_s), to = std::min(span.to_s, to_s);
    if (to - from < static_cast<double>(words.size()) * kShare_per_letter * (to_s - from_s)) continue;
    script += "set label '" + words + "' at first " + fixed((from + to) / 2, 4) +
              ", graph 1.035 center font 'DejaVu Sans,11' textcolor rgb '#4a5560'\n";
  }
  return script;
}

}  // namespace needlelab
