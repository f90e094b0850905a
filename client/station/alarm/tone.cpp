#include "client/station/alarm/tone.h"

#include <dlfcn.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

namespace needlelab {
namespace {

constexpr unsigned kRate_Hz = 48'000;

/// A tone and an equally long pause, `times` times; fades in and out to avoid clicks.
std::vector<std::int16_t> beeps(double pitch_Hz, double length_s, int times) {
  const auto count = static_cast<std::size_t>(length_s * kRate_Hz);
  std::vector<std::int16_t> samples(2 * count * static_cast<std::size_t>(times), 0);
  for (int k = 0; k < times; ++k) {
    for (std::size_t i = 0; i < count; ++i) {
      const double t_s = static_cast<double>(i) / kRate_Hz;
      const double fade = std::min(1.0, std::min(t_s, length_s - t_s) / 0.01);
      samples[2 * count * static_cast<std::size_t>(k) + i] =
          static_cast<std::int16_t>(16'000 * fade * std::sin(2 * std::numbers::pi * pitch_Hz * t_s));
    }
  }
  return samples;
}

/// The five ALSA functions that a tone needs (alsa/pcm.h), loaded at run time, so that the program does not
/// depend on the library.
class Alsa {
 public:
  Alsa() {
    library_ = ::dlopen("libasound.so.2", RTLD_NOW | RTLD_LOCAL);
    if (library_ == nullptr) return;
    found_ = find("snd_pcm_open", open_) && find("snd_pcm_set_params", set_params_) &&
             find("snd_pcm_writei", write_) && find("snd_pcm_drain", drain_) &&
             find("snd_pcm_close", close_) && find("snd_lib_error_set_handler", set_handler_);
    // a computer without a card is not an error
    if (found_) set_handler_(silent);
  }
  ~Alsa() {
    if (library_ != nullptr) ::dlclose(library_);
  }
  Alsa(const Alsa&) = delete;
  Alsa& operator=(const Alsa&) = delete;

  bool play(const std::vector<std::int16_t>& samples) {
    constexpr int kPlayback = 0, kFormat16LittleEndian = 2, kInterleaved = 3;
    constexpr unsigned kLatency_us = 100'000;
    void* pcm = nullptr;
    if (!found_ || open_(&pcm, "default", kPlayback, 0) < 0) return false;
    const bool played =
        set_params_(pcm, kFormat16LittleEndian, kInterleaved, 1, kRate_Hz, 1, kLatency_us) == 0 &&
        write_(pcm, samples.data(), samples.size()) > 0 && drain_(pcm) == 0;
    close_(pcm);
    return played;
  }

 private:
  static void silent(const char*, int, const char*, int, const char*, ...) {}
  template <typename Function>
  bool find(const char* name, Function*& function) {
    function = reinterpret_cast<Function*>(::dlsym(library_, name));
    return function != nullptr;
  }
  void* library_ = nullptr;
  bool found_ = false;
  int (*open_)(void**, const char*, int, int) = nullptr;
  int (*set_params_)(void*, int, int, unsigned, unsigned, int, unsigned) = nullptr;
  long (*write_)(void*, const void*, unsigned long) = nullptr;
  int (*drain_)(void*) = nullptr;
  int (*close_)(void*) = nullptr;
  int (*set_handler_)(void (*)(const char*, int, const char*, int, const char*, ...)) = nullptr;
};

}  // namespace

AudibleTone::AudibleTone() : player_([this] { play(); }) {}

AudibleTone::~AudibleTone() {
  {
    const std::scoped_lock lock(mutex_);
    due_ = Due::kEnd;
  }
  changed_.notify_one();
  player_.join();
}

void AudibleTone::sound(bool danger) {
  {
    const std::scoped_lock lock(mutex_);
    if (due_ != Due::kNothing) return;
    due_ = danger ? Due::kHigh : Due::kLow;
  }
  changed_.notify_one();
}

void AudibleTone::play() {
  std::unique_ptr<Alsa> alsa;
  for (;;) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return due_ != Due::kNothing; });
    if (due_ == Due::kEnd) return;
    const bool danger = due_ == Due::kHigh;
    lock.unlock();
    if (!alsa) alsa = std::make_unique<Alsa>();
    const bool played = alsa->play(danger ? beeps(880, 0.1, 3) : beeps(440, 0.2, 1));
    if (!played && ::isatty(STDERR_FILENO) == 1) (void)!::write(STDERR_FILENO, "\a", 1);
    lock.lock();
    if (due_ == Due::kEnd) return;
    due_ = Due::kNothing;
  }
}

}  // namespace needlelab
