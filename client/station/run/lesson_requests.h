/// Requests of the window and of instructors to the running lesson. Any thread makes them; the lesson's
/// thread handles them.
#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "common/profile/aid_list.h"

namespace needlelab {

/// A person's stop of a lesson.
struct StopCause {
  std::string by;      ///< an instructor's name; empty: the trainee, at the window
  std::string reason;  ///< as written; may be empty
};

/// Aids that an instructor chose for the running lesson.
struct ChosenAids {
  std::string by;
  AidList aids;
  bool reset = false;  ///< back to the exercise's aids; ignores `aids`
};

/// Each request is taken once. Thread: any but the haptic one.
class LessonRequests {
 public:
  void stop(StopCause cause) {
    const std::scoped_lock lock(mutex_);
    if (!stop_) stop_ = std::move(cause);  // the first request counts
  }
  /// A person has seen the present fault.
  void acknowledge() {
    const std::scoped_lock lock(mutex_);
    acknowledged_ = true;
  }
  /// The trainee begins the exam that waits (LessonObserver::examWaits).
  void beginExam() {
    const std::scoped_lock lock(mutex_);
    begins_exam_ = true;
  }
  /// The needle's cap: off, or on again.
  void switchCap() {
    const std::scoped_lock lock(mutex_);
    switches_cap_ = true;
  }
  /// The trainee's hand: up, or down again. It is up until it is lowered, or the next lesson begins.
  void switchHand() {
    const std::scoped_lock lock(mutex_);
    hand_raised_ = !hand_raised_;
  }
  [[nodiscard]] bool handRaised() const {
    const std::scoped_lock lock(mutex_);
    return hand_raised_;
  }
  void setAids(ChosenAids chosen) {
    const std::scoped_lock lock(mutex_);
    aids_ = std::move(chosen);
  }

  std::optional<StopCause> takeStop() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(stop_, std::nullopt);
  }
  bool takeAcknowledgement() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(acknowledged_, false);
  }
  bool takeExamBegin() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(begins_exam_, false);
  }
  bool takeCapSwitch() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(switches_cap_, false);
  }
  std::optional<ChosenAids> takeAids() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(aids_, std::nullopt);
  }
  /// Drops the requests to an earlier lesson.
  void clear() {
    const std::scoped_lock lock(mutex_);
    stop_.reset();
    aids_.reset();
    acknowledged_ = begins_exam_ = switches_cap_ = hand_raised_ = false;
  }

 private:
  mutable std::mutex mutex_;
  std::optional<StopCause> stop_;
  std::optional<ChosenAids> aids_;
  bool acknowledged_ = false, begins_exam_ = false, switches_cap_ = false, hand_raised_ = false;
};

}  // namespace needlelab
