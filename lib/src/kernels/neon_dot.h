/* What kernels_neon_dot.c gives to the NEON set of CPUs that have the dot product of ARMv8.2. */
#ifndef TWOVIEW_KERNELS_NEON_DOT_H
#define TWOVIEW_KERNELS_NEON_DOT_H

#include <stdint.h>

void tvk_squared_distances_neon_dot(const int16_t *query, int32_t query_norm, const int16_t *rows,
                                    const int32_t *norms, int32_t num_rows, int32_t *out);

#endif
