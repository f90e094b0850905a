/// The last minutes of a gesture, for plots and for scrolling back during the gesture.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/view/model/gesture_replica.h"
#include "client/view/model/plot.h"
#include "common/scoring/alarms.h"
#include "common/scoring/bone_contacts.h"

namespace needlelab {

/// A quantity that can be plotted over time, besides the effects' terms (`channelOf`).
enum class TraceChannel : std::uint8_t {
  kForce,  ///< |force| after the gate
  kDepth,  ///< δ
  kInsertion,
  kSpeed,  ///< along u
  kLateralError,
  kAlpha,
  kTilt,
  kTipX,
  kTipY,
  kTipZ,
  kWallX,
  kWallY,
  kWallZ,
  kForceX,
  kForceY,
  kForceZ,
  kPlunger,
  kLayer,
  kPhase,
};
inline constexpr std::size_t kChannelCount = 19 + kEffectCount;
/// Returns the channel of an effect's term: along u as resistance (positive pushes the hand out, negative
/// pulls it in), or a magnitude.
constexpr TraceChannel channelOf(Effect effect) {
  return static_cast<TraceChannel>(static_cast<std::size_t>(TraceChannel::kPhase) + 1 +
                                   static_cast<std::size_t>(effect));
}
static_assert(static_cast<std::size_t>(channelOf(Effect{})) + kEffectCount == kChannelCount);
struct ChannelInfo {
  std::string_view name;  ///< for an axis: "force", "from own line"
  std::string_view unit;  ///< as shown: "N", "mm", "°"
  double shown_per_si;    ///< 1000 for mm, 180/π for °
};
ChannelInfo infoOf(TraceChannel channel);
/// Returns the channel's value in SI; NaN if it has none (no wall, no tilt outside).
double valueOf(TraceChannel channel, const Moment& moment);

/// An event of the gesture.
struct TraceEvent {
  enum class Kind : std::uint8_t {
    kEntry,
    kExit,
    kLayerChange,
    kRupture,
    kTurn,
    kStop,
    kFault,
    kGap,
    kRemark,
    kBoneContact,
    kHubContact,
    kHazard
  };
  Kind kind = Kind::kEntry;
  double time_s = 0;
  int layer = -1;  ///< the entered layer
  std::uint8_t fault = 0;
  std::string text;           ///< of a remark; of a hazard, its name
  std::uint64_t missing = 0;  ///< samples that a kGap has lost
  double missing_s = 0;       ///< the time of those samples
};
/// What is said of an event: a remark's text, the numbers of a gap ("20 samples missing (20 ms)"), else the
/// kind's name.
std::string wordsOf(const TraceEvent& event);
/// A short text for people: "in", "out", "rupture", … and one glyph.
std::string_view nameOf(TraceEvent::Kind kind);
std::string_view signOf(TraceEvent::Kind kind);

/// Every moment's channels as 32-bit floats for `span_s` seconds, oldest overwritten; whole Moments at up to
/// 100 Hz (for the 3-D view of a past time); events. Memory: about 120 B a tick and 40 KiB/s: 50 MiB for
/// 5 minutes at 1 kHz, allocated as it fills. Thread: one at a time.
class GestureTrace {
 public:
  /// `bones`: where the tip makes a contact with bone; none by default. `ticks_per_sample`: above 1 where the
  /// samples were thinned; more ticks from one sample to the next are a gap. `alarms`: of the scene.
  explicit GestureTrace(double span_s = 300, BoneContacts bones = {}, double ticks_per_sample = 1,
                        GestureAlarms alarms = {});
  GestureTrace(GestureTrace&&) noexcept;
  GestureTrace& operator=(GestureTrace&&) noexcept;
  ~GestureTrace();

  /// Times must ascend; an earlier one clears the trace (another session has begun).
  void push(const Moment& moment);
  void add(TraceEvent event);  ///< such as a remark; `push` finds entries, exits, layers, gaps …
  void clear();

  [[nodiscard]] bool empty() const;
  [[nodiscard]] double firstTime_s() const;  ///< of the kept data; 0 when empty
  [[nodiscard]] double lastTime_s() const;
  [[nodiscard]] const Moment& last() const;  ///< value-initialised when empty
  /// Returns the last kept Moment at or before `time_s` (else the first one).
  [[nodiscard]] const Moment& at(double time_s) const;
  /// Returns the kept Moments in [from, to], oldest first, e.g. for the tip's path.
  [[nodiscard]] std::vector<Moment> between(double from_s, double to_s) const;
  /// The alarms at the last moment.
  [[nodiscard]] std::vector<ActiveAlarm> alarms() const;
  /// Gaps that follow each other within 0.2 s are one event, with all that is missing.
  [[nodiscard]] const std::deque<TraceEvent>& events() const;
  /// Where samples are missing, oldest first; a curve has no value there.
  [[nodiscard]] const std::deque<PlotGap>& gaps() const;
  /// Returns the channel's value at the last tick at or before `time_s`, in SI; empty when nothing is kept or
  /// the channel has no value there.
  [[nodiscard]] std::optional<float> value(TraceChannel channel, double time_s) const;
  /// Returns the peak |force| in the kept time, in N.
  [[nodiscard]] double peakForce_N() const;

  /// In SI; fast through a pyramid of minima and maxima (a few µs for any span).
  void columns(TraceChannel channel, double from_s, double to_s, std::span<PixelColumn> out) const;
  /// Returns the channel as a plot's source, in shown units (ChannelInfo); it refers to this trace.
  [[nodiscard]] ColumnSource source(TraceChannel channel) const;
  /// Returns the channel of the kept Moment of a time, in shown units: the figure beside a picture of that
  /// Moment. Nothing outside of the kept time, and where samples are missing. It refers to this trace.
  [[nodiscard]] PlotReader reader(TraceChannel channel) const;

 private:
  struct Store;
  std::unique_ptr<Store> store_;
};

}  // namespace needlelab
