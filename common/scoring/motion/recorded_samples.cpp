#include "common/scoring/motion/recorded_samples.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>
#include <utility>

namespace needlelab {
namespace {

constexpr double kFarthest_m = 1e3;
constexpr double kGreatestForce_N = 1e6;

bool isWithin(double value, double bound) {
  return std::abs(value) <= bound;
}  // false for NaN

bool isUsable(const GestureSample& s) {
  double q_squared = 0;
  for (const double q : s.q_WT) q_squared += q * q;
  bool usable = q_squared > 0.25 && q_squared < 4;
  for (const double p : s.p_WT_m) usable = usable && isWithin(p, kFarthest_m);
  for (const double f : s.force_W_N) usable = usable && isWithin(f, kGreatestForce_N);
  return usable && isWithin(s.insertion_m, kFarthest_m) && isWithin(s.lateral_error_m, kFarthest_m);
}

}  // namespace

std::span<const GestureSample> cleaned(std::span<const GestureSample> samples,
                                       std::vector<GestureSample>& storage) {
  std::uint64_t last_tick = 0;
  bool any = false;
  const auto isKept = [&](const GestureSample& sample) {
    const bool kept = isUsable(sample) && (!any || sample.tick > last_tick);
    if (kept) last_tick = sample.tick, any = true;
    return kept;
  };
  if (std::all_of(samples.begin(), samples.end(), isKept)) return samples;
  any = false;
  storage.clear();
  std::copy_if(samples.begin(), samples.end(), std::back_inserter(storage), isKept);
  return storage;
}

void keepUsable(std::vector<GestureSample>& samples, std::uint64_t& last_tick, bool& any) {
  std::erase_if(samples, [&](const GestureSample& sample) {
    const bool kept = isUsable(sample) && (!any || sample.tick > last_tick);
    if (kept) last_tick = sample.tick, any = true;
    return !kept;
  });
}

RecordedSamples::RecordedSamples(std::span<const GestureSample> samples) {
  const std::span<const GestureSample> usable = cleaned(samples, storage_);
  data_ = usable.data();
  size_ = count_ = usable.size();
  if (usable.empty()) return;
  front_ = usable.front();
  back_ = usable.back();
}

Result<RecordedSamples> RecordedSamples::inBlocks(std::size_t blocks, Read read, std::size_t max_held) {
  RecordedSamples all = ofBlocks(std::move(read), max_held);
  while (all.blocks_.size() < blocks) RETURN_IF_ERROR(all.addBlock());
  return all;
}

RecordedSamples RecordedSamples::ofBlocks(Read read, std::size_t max_held) {
  RecordedSamples none;
  none.read_ = std::move(read);
  none.limit_ = max_held;
  return none;
}

Result<std::size_t> RecordedSamples::addBlock() {
  const std::size_t number = blocks_.size();
  ASSIGN_OR_RETURN(auto samples, read_(number));
  const std::size_t read_samples = samples.size();
  Block block;
  block.first = size_;
  block.last_tick = last_tick_;
  block.any_before = any_;
  blocks_.push_back(std::move(block));
  keepUsable(samples, last_tick_, any_);
  if (samples.empty()) return read_samples;
  if (size_ == 0) front_ = samples.front();
  back_ = samples.back();
  size_ += samples.size();
  hold(number, std::move(samples));
  count_ = 0;  // the last requested part may have been released
  return read_samples;
}

std::size_t RecordedSamples::countOf(std::size_t block) const {
  return (block + 1 < blocks_.size() ? blocks_[block + 1].first : size_) - blocks_[block].first;
}

void RecordedSamples::hold(std::size_t block, std::vector<GestureSample> samples) const {
  // release the least recently used one
  while (held_.size() >= kMinHeld && held_samples_ + samples.capacity() > limit_) {
    Block& given_up = blocks_[held_.front()];
    held_samples_ -= given_up.samples.capacity();
    given_up.samples = std::vector<GestureSample>();  // `= {}` would keep the memory
    held_samples_ += given_up.samples.capacity();
    given_up.held = false;
    held_.pop_front();
  }
  held_samples_ += samples.capacity();
  max_held_ = std::max(max_held_, held_samples_);
  blocks_[block].samples = std::move(samples);
  blocks_[block].held = true;
  blocks_[block].place = held_.insert(held_.end(), block);
}

void RecordedSamples::show(std::size_t block) const {
  held_.splice(held_.end(), held_, blocks_[block].place);
  data_ = blocks_[block].samples.data();
  first_ = blocks_[block].first;
  count_ = blocks_[block].samples.size();
}

void RecordedSamples::find(std::size_t i) const {
  assert(i < size_);
  // the last block that begins at or before sample i; blocks without usable samples begin where the next one
  // does
  const auto after = std::upper_bound(blocks_.begin(), blocks_.end(), i,
                                      [](std::size_t number, const Block& b) { return number < b.first; });
  const auto block = static_cast<std::size_t>(after - blocks_.begin()) - 1;
  if (!blocks_[block].held) {
    const std::size_t count = countOf(block);
    std::vector<GestureSample> samples;
    if (fault_.ok()) {
      auto read = read_(block);
      if (read) {
        samples = std::move(*read);
        std::uint64_t last_tick = blocks_[block].last_tick;
        bool any = blocks_[block].any_before;
        keepUsable(samples, last_tick, any);
        if (samples.size() != count)
          fault_ = Error{ErrorCode::kUnavailable, "the recording was changed while it was read"};
      } else {
        fault_ = read.error();
      }
    }
    // after a fault: return samples of the right number, so that readers terminate
    samples.resize(count);
    hold(block, std::move(samples));
  }
  show(block);
}

}  // namespace needlelab
