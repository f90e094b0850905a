/// What libFuzzer, the coverage run and the replay in ctest have in common: one function for each kind of
/// hostile bytes.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/bytes.h"

namespace needlelab::fuzz {

/// Takes any bytes; a fault is a crash, a sanitizer's report or a failed `require`.
using Run = void (*)(ByteView data);
/// Mends the checks (CRC) of bytes that the fuzzer has changed, so that it gets behind them. Same size. `how`
/// is random: its low bits say what is mended beside, or left to contradict itself.
using Repair = void (*)(std::span<std::uint8_t> data, unsigned how);

/// Changes the first `size` bytes of `room` in the manner of their format; the new size, 0 when they are none
/// of it. `seed` alone decides.
using Mutate = std::size_t (*)(std::span<std::uint8_t> room, std::size_t size, unsigned seed);

struct Target {
  std::string_view name;
  Run run = nullptr;
  Repair repair = nullptr;  ///< none: nothing to mend
  Mutate mutate = nullptr;  ///< none: libFuzzer's mutations of bytes alone; else half of the time
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

void repairChunk(std::span<std::uint8_t> data, unsigned how);
void repairRecording(std::span<std::uint8_t> data, unsigned how);
void repairSpool(std::span<std::uint8_t> data, unsigned how);
void repairLive(std::span<std::uint8_t> data, unsigned how);
std::size_t mutateJson(std::span<std::uint8_t> room, std::size_t size, unsigned seed);

inline constexpr Target kTargets[] = {
    {"envelope", envelope, nullptr},
    {"chunk", chunk, repairChunk},
    {"recording", recording, repairRecording},
    {"profile", profile, nullptr, mutateJson},
    {"curriculum", curriculum, nullptr, mutateJson},
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

/// What a planted fault reads and writes goes through this: the optimiser would leave out what nobody uses,
/// and with it the fault.
template <typename T>
volatile T& surely(T& place) {
  return place;
}

/// What must hold whatever the bytes are.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: does not hold: %s\n", what);
  std::abort();
}

/// Between the parts of an input that has several (files, operations). No lengths: a part that grows or
/// shrinks leaves the others what they were.
inline constexpr std::string_view kPartMark = "\x1E\xA7|";
/// The parts, at most `most`; what is behind is left out. Views into `data`.
std::vector<std::span<std::uint8_t>> partsOf(std::span<std::uint8_t> data, std::size_t most);
std::vector<ByteView> partsOf(ByteView data, std::size_t most);

/// A folder of this process' own in memory (or under /tmp), emptied by the caller, removed at the end.
const std::filesystem::path& scratchFolder();
/// Writes a file without syncing it.
void writeFile(const std::filesystem::path& path, ByteView bytes);

}  // namespace needlelab::fuzz
