#include "common/scoring/recorded_samples.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "common/scoring/track.h"

namespace needlelab {

RecordedSamples::RecordedSamples(std::span<const GestureSample> samples) {
  const std::span<const GestureSample> usable = cleaned(samples, storage_);
  data_ = usable.data();
  size_ = count_ = usable.size();
  if (usable.empty()) return;
  front_ = usable.front();
  back_ = usable.back();
}

Result<RecordedSamples> RecordedSamples::inBlocks(std::size_t blocks, Read read, std::size_t most_held) {
  RecordedSamples all;
  all.read_ = std::move(read);
  all.limit_ = most_held;
  std::uint64_t last_tick = 0;
  bool any = false;
  for (std::size_t number = 0; number < blocks; ++number) {
    ASSIGN_OR_RETURN(auto samples, all.read_(number));
    Block block;
    block.first = all.size_;
    block.last_tick = last_tick;
    block.any_before = any;
    all.blocks_.push_back(std::move(block));
    keepUsable(samples, last_tick, any);
    if (samples.empty()) continue;
    if (all.size_ == 0) all.front_ = samples.front();
    all.back_ = samples.back();
    all.size_ += samples.size();
    all.hold(number, std::move(samples));
  }
  return all;
}

std::size_t RecordedSamples::countOf(std::size_t block) const {
  return (block + 1 < blocks_.size() ? blocks_[block + 1].first : size_) - blocks_[block].first;
}

void RecordedSamples::hold(std::size_t block, std::vector<GestureSample> samples) const {
  // the one that was asked for longest ago gives way
  while (held_.size() >= kLeastHeld && held_samples_ + samples.size() > limit_) {
    Block& given_up = blocks_[held_.front()];
    held_samples_ -= given_up.samples.size();
    given_up.samples = {};
    given_up.held = false;
    held_.pop_front();
  }
  held_samples_ += samples.size();
  most_held_ = std::max(most_held_, held_samples_);
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
  // the last block that begins at or before it; blocks without usable samples begin where the next one does
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
    // after a fault: something of the right length, so that whoever reads comes to an end
    samples.resize(count);
    hold(block, std::move(samples));
  }
  show(block);
}

}  // namespace needlelab
