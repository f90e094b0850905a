/// What surrounds every screen: where one can go, how the line to the lab stands, notices.
#pragma once

#include "client/instructor/model/desk.h"
#include "client/view/surface.h"

namespace needlelab {

/// The bar at the top. Screens that have nothing to show yet can be chosen, too: they say what to do.
void showNavigation(Desk& desk, bool& show_help);
/// Beneath it while the connection is lost or refused: why, what to do, when it is tried again.
void showLinkBanner(Desk& desk);
/// Over everything at the lower edge.
void showNotices(Desk& desk);
/// In the middle of an empty screen: what is missing and how to get it. `action`: a button's label, or null;
/// true when it was pressed.
bool showEmpty(std::string_view headline, std::string_view advice, const char* action = nullptr);
/// What is being loaded or worked out, with a bar; nothing when nothing is.
void showWork(const Desk& desk);

}  // namespace needlelab
