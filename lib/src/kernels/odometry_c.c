/* The portable kernels of the odometry: the definition. */
#define TVK_ODOMETRY(name) tvk_##name##_c
#define TVK_ODOMETRY_TABLE tvk_odometry_c
#include "kernels/odometry_impl.h"
