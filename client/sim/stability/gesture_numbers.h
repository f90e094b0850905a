/// All numbers of a gesture and its scene, for what changes them one by one, and how big that makes a
/// gesture.
#pragma once

#include <functional>

#include "client/sim/stability/passivity_gesture.h"

namespace needlelab {

/// Called with each number in turn, in an order that stays the same; what it changes is written back.
using NumberVisit = std::function<void(double&)>;

/// Places, tilts and times of the strokes.
void visitStrokes(PassivityGesture& gesture, const NumberVisit& number);
/// Numbers of the layers and their membranes.
void visitLayers(PassivityGesture& gesture, const NumberVisit& number);
/// Both, and the sections of the scene that must stay above zero.
void visitAll(PassivityGesture& gesture, const NumberVisit& number);

/// Distance between two strokes' ends in m, and the sum of the changes of their tilts' tangents.
double wayBetween(const PassivityStroke& a, const PassivityStroke& b);
double turnBetween(const PassivityStroke& a, const PassivityStroke& b);

/// How big a gesture is to a reader: less is simpler. Strokes, effects and layers weigh most, then times that
/// are not short, then the digits of its numbers.
double sizeOf(const PassivityGesture& gesture);

}  // namespace needlelab
