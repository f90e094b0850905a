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
  /// `danger`: three high tones; otherwise one low tone.
  virtual void sound(bool danger) = 0;
};

/// Plays through ALSA (libasound, loaded for the first tone); without it or without a card, rings the
/// terminal's bell; without a terminal, stays silent. Omits a tone that is due while another plays.
class AudibleTone final : public Tone {
 public:
  AudibleTone();
  /// Waits for a playing tone.
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
