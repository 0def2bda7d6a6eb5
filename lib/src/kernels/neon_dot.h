/* Declares the kernels of kernels_neon_dot.c, which replace the NEON set's on CPUs with the dot
   product of ARMv8.2. */
#ifndef TWOVIEW_KERNELS_NEON_DOT_H
#define TWOVIEW_KERNELS_NEON_DOT_H

#include "kernels/kernels.h"

void tvk_mutual_nearest_neon_dot(const uint8_t *rows, int32_t num_rows, const uint8_t *columns,
                                 int32_t num_columns, void *scratch, tvk_nearest *of_columns,
                                 tvk_nearest *of_rows);

#endif
