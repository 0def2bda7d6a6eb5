/* The portable kernels on matches: the definition. */
#define TVK_GEOMETRY(name) tvk_##name##_c
#define TVK_GEOMETRY_TABLE tvk_geometry_c
#include "kernels/lanes_impl.h"
