/* twoview: FAST-SIFT matching and two-view geometry. This header includes those of all
   stages; include twoview/alloc.h, for a context on the heap, by itself. */
#ifndef TWOVIEW_TWOVIEW_H
#define TWOVIEW_TWOVIEW_H

#include "twoview/bundle.h"
#include "twoview/camera.h"
#include "twoview/context.h"
#include "twoview/dense.h"
#include "twoview/depth_map.h"
#include "twoview/feature.h"
#include "twoview/image.h"
#include "twoview/match.h"
#include "twoview/odometry.h"
#include "twoview/path.h"
#include "twoview/reconstruct.h"
#include "twoview/room.h"
#include "twoview/status.h"
#include "twoview/triangulate.h"
#include "twoview/two_view.h"
#include "twoview/version.h"

#endif
