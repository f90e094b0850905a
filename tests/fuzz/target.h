/// Shared by libFuzzer, the coverage run and the replay in ctest: one function for each kind of hostile
/// bytes.
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
/// Repairs the checksums (CRC) of bytes that the fuzzer has changed, so that the fuzzer gets past the checks.
/// Keeps the size. `how` is random: its low bits select the other fields that are repaired or left
/// inconsistent.
using Repair = void (*)(std::span<std::uint8_t> data, unsigned how);

/// Mutates the first `size` bytes of `room` according to their format. Returns the new size, or 0 if the
/// bytes are not in this format. The result depends on `seed` only.
using Mutate = std::size_t (*)(std::span<std::uint8_t> room, std::size_t size, unsigned seed);

struct Target {
  std::string_view name;
  Run run = nullptr;
  Repair repair = nullptr;  ///< null: nothing to repair
  Mutate mutate = nullptr;  ///< null: only libFuzzer's byte mutations; otherwise used half of the time
};

void envelope(ByteView data);
void chunk(ByteView data);
void recording(ByteView data);
void profile(ByteView data);
void curriculum(ByteView data);
void spool(ByteView data);
void live(ByteView data);
void trajectory(ByteView data);
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
    {"http", http, nullptr},
};

/// With -DNEEDLELAB_FUZZ_PLANT every target has one extra fault, to prove that its fuzzer finds faults.
#ifdef NEEDLELAB_FUZZ_PLANT
inline constexpr bool kPlanted = true;
#else
inline constexpr bool kPlanted = false;
#endif

/// Planted faults read and write through this function; otherwise the optimiser would remove unused accesses,
/// and the fault with them.
template <typename T>
volatile T& surely(T& place) {
  return place;
}

/// Checks a condition that must hold for all inputs.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: does not hold: %s\n", what);
  std::abort();
}

/// Separates the parts of an input with several parts (files, operations). There are no lengths, so a part
/// can grow or shrink without changing the others.
inline constexpr std::string_view kPartMark = "\x1E\xA7|";
/// Returns at most the first `most` parts, as views into `data`; drops the rest.
std::vector<std::span<std::uint8_t>> partsOf(std::span<std::uint8_t> data, std::size_t most);
std::vector<ByteView> partsOf(ByteView data, std::size_t most);

/// A private folder of this process in memory (or under /tmp). The caller empties it; it is removed at the
/// end.
const std::filesystem::path& scratchFolder();
/// Writes a file without syncing it.
void writeFile(const std::filesystem::path& path, ByteView bytes);

}  // namespace needlelab::fuzz
