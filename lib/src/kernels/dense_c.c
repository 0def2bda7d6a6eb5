/* The portable kernels of the dense cloud: the definition. */
#define TVK_DENSE(name) tvk_##name##_c
#define TVK_DENSE_TABLE tvk_dense_c
#include "kernels/dense_impl.h"
