/// The last minutes of a gesture, for plots and for scrolling back while it continues.
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
#include "common/scoring/alarms/alarms.h"
#include "common/scoring/anatomy/bone_contacts.h"

namespace needlelab {

/// A quantity to plot over time, besides the effects' terms (`channelOf`).
enum class TraceChannel : std::uint8_t {
  kForce,  ///< |force| after the gate
  kDepth,  ///< δ; not a number with the cap on
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
  std::string text;           ///< of a remark, or a hazard's name
  std::uint64_t missing = 0;  ///< samples lost in a kGap
  double missing_s = 0;       ///< duration of those samples
};
/// A stretch of time in tissue on one path, within 0.25 mm.
struct WayStretch {
  double from_s = 0, to_s = 0;
  bool goes_on = false;  ///< the insertion of the stretch before it
  NeedleLine line;
};
/// An event in words: a remark's text, the size of a gap ("20 samples missing (20 ms)"), otherwise the kind's
/// name.
std::string wordsOf(const TraceEvent& event);
/// A short text ("in", "out", "rupture", …) and one glyph.
std::string_view nameOf(TraceEvent::Kind kind);
std::string_view signOf(TraceEvent::Kind kind);

/// All channels of every moment as 32-bit floats for `span_s` seconds (the oldest are overwritten), whole
/// Moments at up to 100 Hz (for the 3-D view of a past time), and events. Memory: about 120 B per tick plus
/// 40 KiB/s: 50 MiB for 5 minutes at 1 kHz, allocated as needed. Thread: one at a time.
class GestureTrace {
 public:
  /// `bones`: where the tip touches bone; none by default. `ticks_per_sample`: above 1 for a thinned
  /// recording; a larger step between samples is a gap. `alarms`: the scene's.
  explicit GestureTrace(double span_s = 300, BoneContacts bones = {}, double ticks_per_sample = 1,
                        GestureAlarms alarms = {});
  GestureTrace(GestureTrace&&) noexcept;
  GestureTrace& operator=(GestureTrace&&) noexcept;
  ~GestureTrace();

  /// Times must ascend; an earlier time clears the trace (another session started).
  void push(const Moment& moment);
  void add(TraceEvent event);  ///< e.g. a remark; `push` finds entries, exits, layers, gaps …
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
  /// Gaps within 0.2 s of each other form one event with all that is missing.
  [[nodiscard]] const std::deque<TraceEvent>& events() const;
  /// What the engine stepped on in tissue, oldest first.
  [[nodiscard]] const std::deque<WayStretch>& ways() const;
  /// Where samples are missing, oldest first; a curve has no value there.
  [[nodiscard]] const std::deque<PlotGap>& gaps() const;
  /// Returns the channel's value at the last tick at or before `time_s`, in SI; empty if no tick is kept or
  /// the channel has no value there.
  [[nodiscard]] std::optional<float> value(TraceChannel channel, double time_s) const;
  /// Returns the peak |force| over the kept time, in N.
  [[nodiscard]] double peakForce_N() const;

  /// In SI; fast, from a pyramid of minima and maxima (a few µs for any span).
  void columns(TraceChannel channel, double from_s, double to_s, std::span<PixelColumn> out) const;
  /// Returns the channel as a plot's source, in shown units (ChannelInfo). Refers to this trace.
  [[nodiscard]] ColumnSource source(TraceChannel channel) const;
  /// Returns a reader of the channel at the kept Moments, in shown units: for the number beside a picture of
  /// that Moment. Gives no value outside the kept time and where samples are missing. Refers to this trace.
  [[nodiscard]] PlotReader reader(TraceChannel channel) const;

 private:
  struct Store;
  std::unique_ptr<Store> store_;
};

}  // namespace needlelab
