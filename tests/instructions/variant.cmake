# Makes the sources of an engine without one effect's code (or, run_time_masks, with the effects asked for at run time) from the
# engine's own: VARIANT, HAPTICS (the engine's folder), OUT. Stops when the engine's text is not what it knows: then this file
# has to follow.
file(READ "${HAPTICS}/effects/step_live.h" step)
file(READ "${HAPTICS}/effects/tracking_wall.h" wall)
file(READ "${HAPTICS}/models/tracking_wall.cpp" entry)

function(swap variable from to)
  string(FIND "${${variable}}" "${from}" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "tests/instructions/variant.cmake (${VARIANT}): the engine's source has no more '${from}'")
  endif()
  string(REPLACE "${from}" "${to}" text "${${variable}}")
  set(${variable} "${text}" PARENT_SCOPE)
endfunction()

# what an effect's header gave is declared only: to use it would not link
macro(drop effect header declaration)
  swap(step "#include \"common/haptics/effects/${header}\"\n" "namespace needlelab {\n${declaration}\n}\n")
  swap(step "live(Effect::${effect})" "false")
endmacro()

if(VARIANT STREQUAL "without_cutting")
  swap(wall "kCuts ? x - stretch.cut_m : x" "x")
elseif(VARIANT STREQUAL "without_attracted")
  swap(wall "kAttracts ? x + std::min(stretch.attracted_m, tick.insertion_m) : x" "x")
elseif(VARIANT STREQUAL "without_wall")
  swap(step "Axial::acts(Live)" "false")
elseif(VARIANT STREQUAL "without_clamping")
  drop(kClamping "clamping.h" "Vec3 applyClamping(...);")
elseif(VARIANT STREQUAL "without_orientation_limit")
  drop(kOrientationLimit "orientation_limit.h" "struct RawAxis { Vec3 axis_W; double squared; }; void applyOrientationLimit(...);")
elseif(VARIANT STREQUAL "without_shaft_friction")
  drop(kShaftFriction "shaft_friction.h" "double applyShaftFriction(...);")
elseif(VARIANT STREQUAL "without_puncture")
  drop(kPuncture "puncture.h" "double applyMembranes(...);")
elseif(VARIANT STREQUAL "run_time_masks")
  swap(step "constexpr auto live = [](Effect effect) { return (Live & bitOf(effect)) != 0; }"
            "const auto live = [&model](Effect effect) { return (model.live & bitOf(effect)) != 0; }")
  swap(step "if constexpr (live(" "if (live(")
  swap(step "if constexpr (!live(" "if (!live(")
else()
  message(FATAL_ERROR "no such variant: ${VARIANT}")
endif()

# one entry under a name of its own; the second one of the file goes
string(FIND "${entry}" "constinit const AxialEntry kPlainWallEntry" at)
string(FIND "${entry}" "}  // namespace needlelab" end REVERSE)
if(at EQUAL -1 OR end EQUAL -1)
  message(FATAL_ERROR "tests/instructions/variant.cmake: models/tracking_wall.cpp is not what it was")
endif()
string(SUBSTRING "${entry}" 0 ${at} entry)
string(APPEND entry "}  // namespace needlelab\n")
swap(entry "constinit const AxialEntry kTrackingWallEntry = {" "extern const AxialEntry kEntry_${VARIANT};\nconstinit const AxialEntry kEntry_${VARIANT} = {")

file(WRITE "${OUT}/common/haptics/effects/step_live.h" "${step}")
file(WRITE "${OUT}/common/haptics/effects/tracking_wall.h" "${wall}")
file(WRITE "${OUT}/entry_${VARIANT}.cpp" "${entry}")
