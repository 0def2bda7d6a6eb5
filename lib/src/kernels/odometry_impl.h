/* The body of a set's file of the odometry's kernels. Define TVK_ODOMETRY(name), which gives their
   names, and TVK_ODOMETRY_TABLE, then include this file. */
#include "kernels/odometry.h"

#define TVK_DECLARE(name, result, parameters) result TVK_ODOMETRY(name) parameters;
TVK_ODOMETRY_LIST(TVK_DECLARE)
#undef TVK_DECLARE

/* clang-format off */
#include "kernels/lanes.h"
#include "kernels/blocks.h"
#include "kernels/sightings.h"
/* clang-format on */

extern const tvk_odometry_table TVK_ODOMETRY_TABLE;
const tvk_odometry_table TVK_ODOMETRY_TABLE = {
#define TVK_ENTRY(name, result, parameters) TVK_ODOMETRY(name),
    TVK_ODOMETRY_LIST(TVK_ENTRY)
#undef TVK_ENTRY
};
