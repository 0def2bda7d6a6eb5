/* twoview: visual odometry, from a flight to a map. This header includes those of its pieces, which
   are useful alone. A library that was built with TWOVIEW_ODOMETRY=OFF has none of these functions:
   a program that calls one does not link. */
#ifndef TWOVIEW_ODOMETRY_H
#define TWOVIEW_ODOMETRY_H

#include "twoview/absolute_pose.h"
#include "twoview/window.h"

#endif
