/// Sounds for alarms.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>

namespace needlelab {

/// Which alarms sound. `kDanger`: fault, hazard and bone.
enum class ToneChoice { kOff, kDanger, kAll };

/// Thread: any may call `sound`, which returns at once.
class Tone {
 public:
  virtual ~Tone() = default;
  /// `danger`: three high tones, else one low one.
  virtual void sound(bool danger) = 0;
};

/// Plays through ALSA (libasound, loaded when the first tone is due); without it or without a card, rings the
/// terminal's bell; without a terminal, is silent. A tone that is due while another plays is left out.
class AudibleTone final : public Tone {
 public:
  AudibleTone();
  /// Waits for a tone that plays.
  ~AudibleTone() override;
  void sound(bool danger) override;

 private:
  enum class Due { kNothing, kLow, kHigh, kEnd };
  void play();
  std::mutex mutex_;
  std::condition_variable changed_;
  Due due_ = Due::kNothing;
  std::thread player_;
};

}  // namespace needlelab
