/// What libFuzzer, the coverage run and the replay in ctest have in common: one function for each kind of
/// hostile bytes.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "base/bytes.h"

namespace needlelab::fuzz {

/// Takes any bytes; a fault is a crash, a sanitizer's report or a failed `require`.
using Run = void (*)(ByteView data);
/// Mends the checks (CRC) of bytes that the fuzzer has changed, so that it gets behind them. Same size.
using Repair = void (*)(std::span<std::uint8_t> data);

struct Target {
  std::string_view name;
  Run run = nullptr;
  Repair repair = nullptr;  ///< none: nothing to mend
};

void envelope(ByteView data);
void chunk(ByteView data);
void recording(ByteView data);
void profile(ByteView data);
void curriculum(ByteView data);
void spool(ByteView data);
void live(ByteView data);
void trajectory(ByteView data);
void address(ByteView data);
void http(ByteView data);

void repairChunk(std::span<std::uint8_t> data);
void repairRecording(std::span<std::uint8_t> data);
void repairSpool(std::span<std::uint8_t> data);
void repairLive(std::span<std::uint8_t> data);

inline constexpr Target kTargets[] = {
    {"envelope", envelope, nullptr},
    {"chunk", chunk, repairChunk},
    {"recording", recording, repairRecording},
    {"profile", profile, nullptr},
    {"curriculum", curriculum, nullptr},
    {"spool", spool, repairSpool},
    {"live", live, repairLive},
    {"trajectory", trajectory, nullptr},
    {"address", address, nullptr},
    {"http", http, nullptr},
};

/// Built with -DNEEDLELAB_FUZZ_PLANT every target has one more fault, to show that its fuzzer finds such.
#ifdef NEEDLELAB_FUZZ_PLANT
inline constexpr bool kPlanted = true;
#else
inline constexpr bool kPlanted = false;
#endif

/// What must hold whatever the bytes are.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: does not hold: %s\n", what);
  std::abort();
}

/// A folder of this process' own in memory (or under /tmp), emptied by the caller, removed at the end.
const std::filesystem::path& scratchFolder();
/// Writes a file without syncing it.
void writeFile(const std::filesystem::path& path, ByteView bytes);

}  // namespace needlelab::fuzz
