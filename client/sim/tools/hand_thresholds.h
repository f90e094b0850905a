/// What a hand notices of a force.
#pragma once

namespace needlelab {

/// A step of force in time is noticed from about here on, in N. Measured for small effects: 20.8 mN with a
/// pen held in the hand (Lee and Hannaford 2003, 11 people, 71 % right), 30 mN with a fingertip that explores
/// (Dosher, Lee and Hannaford 2001, 7 people); effects with an edge are noticed at less force than smooth
/// ones (Dosher and Hannaford 2005). A needle is held like a pen. All of them beside little other force: a
/// hand that holds some newtons notices less, so a step below this is not noticed by anybody, and one above
/// it may be.
inline constexpr double kNoticeableStep_N = 0.02;

}  // namespace needlelab
