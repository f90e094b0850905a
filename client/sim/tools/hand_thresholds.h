/// What a hand notices of a force.
#pragma once

namespace needlelab {

/// A hand notices force steps over time from about this size, in N: 20.8 mN with a pen held in the hand (Lee
/// and Hannaford 2003, 11 people, 71 % right). An exploring fingertip notices 30 mN (Dosher, Lee and
/// Hannaford 2001, 7 people), and effects with an edge at lower forces than smooth ones (Dosher and Hannaford
/// 2005). A needle is held like a pen. All this is at low force; a hand that holds several newtons notices
/// less. So smaller steps are not noticed, and larger ones may be.
inline constexpr double kNoticeableStep_N = 0.0208;

}  // namespace needlelab
