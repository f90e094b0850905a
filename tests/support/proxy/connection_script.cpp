#include "tests/support/proxy/connection_script.h"

#include <sstream>

namespace needlelab::test {
namespace {

using std::chrono::milliseconds;

void print(std::ostream& out, const char* name, const WayScript& way) {
  out << ' ' << name << '{';
  if (way.delay.count() > 0 || way.jitter.count() > 0)
    out << "delay " << way.delay.count() << '+' << way.jitter.count() << " ms ";
  if (way.bytes_per_s > 0) out << way.bytes_per_s << " bytes/s ";
  if (way.piece_bytes > 0) out << "pieces of " << way.piece_bytes << ' ';
  if (way.stall_at) out << "stall of " << way.stall.count() << " ms at " << *way.stall_at << ' ';
  if (way.corrupt_at) out << "corrupt at " << *way.corrupt_at << ' ';
  out << '}';
}

}  // namespace

std::string ConnectionScript::text() const {
  static constexpr const char* kCuts[] = {"fin", "reset", "silent"};
  std::ostringstream out;
  if (refuse) out << "refuse";
  print(out, "up", up);
  print(out, "down", down);
  if (cut_at)
    out << " cut(" << kCuts[static_cast<int>(cut)] << ") at " << *cut_at
        << (cut_way == Way::kUp ? " up" : " down");
  if (hold_at) out << " held at " << *hold_at << ", late by " << late_after.count() << " ms";
  if (duplicates > 0) out << " duplicates " << duplicates;
  return out.str();
}

ConnectionScript randomScript(Random& random, std::uint64_t span_bytes) {
  ConnectionScript script;
  const auto below = [&](std::uint64_t count) { return random.below(count); };
  const auto ms = [&](std::uint64_t most) { return milliseconds(below(most + 1)); };
  if (random.chance(0.08)) {
    script.refuse = true;
    return script;
  }
  for (WayScript* way : {&script.up, &script.down}) {
    if (random.chance(0.3)) way->delay = ms(30);
    if (random.chance(0.3)) way->jitter = ms(30);
    // small pieces only with enough bandwidth: a thousand writes per second is slow enough
    if (random.chance(0.15)) way->piece_bytes = 1 + below(700);
    if (random.chance(0.15)) way->bytes_per_s = 50'000 + below(2'000'000);
    if (random.chance(0.2)) {
      way->stall_at = below(span_bytes);
      way->stall = ms(300);
    }
    if (random.chance(0.08)) way->corrupt_at = below(span_bytes);
  }
  if (random.chance(0.12)) {
    script.hold_at = below(span_bytes);
    script.late_after = ms(300);
  }
  if (random.chance(0.55)) {
    script.cut_at = below(span_bytes);
    script.cut_way = random.chance(0.5) ? Way::kUp : Way::kDown;
    script.cut = static_cast<Cut>(below(3));
  }
  if (random.chance(0.1)) script.duplicates = static_cast<unsigned>(1 + below(2));
  return script;
}

}  // namespace needlelab::test
