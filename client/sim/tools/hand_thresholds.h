/// What a hand notices of a force.
#pragma once

namespace needlelab {

/// A step of force in time is noticed from about here on, in N: 20.8 mN with a pen held in the hand (Lee and
/// Hannaford 2003, 11 people, 71 % right). A fingertip that explores notices 30 mN (Dosher, Lee and Hannaford
/// 2001, 7 people), and effects with an edge at less force than smooth ones (Dosher and Hannaford 2005). A
/// needle is held like a pen. All of this beside little other force: a hand that holds some newtons notices
/// less. So a step below this is noticed by nobody, and one above it may be.
inline constexpr double kNoticeableStep_N = 0.0208;

}  // namespace needlelab
