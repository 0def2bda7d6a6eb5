/* The portable kernels on matches: the definition. */
#define TVK_MATCH(name) tvk_##name##_c
#include "kernels/lanes_impl.h"
