/* The portable kernels on doubles: the definition. */
#define TVK_MATCH(name) tvk_##name##_c
#include "kernels/lanes_impl.h"
