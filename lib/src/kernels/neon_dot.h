/* Declares the kernels of kernels_neon_dot.c, which replace the NEON set's on CPUs with the dot
   product of ARMv8.2. */
#ifndef TWOVIEW_KERNELS_NEON_DOT_H
#define TWOVIEW_KERNELS_NEON_DOT_H

#include "kernels/kernels.h"

tvk_nearest_shape tvk_nearest_groups_neon_dot(const tvk_descriptors *rows,
                                              const tvk_descriptors *columns, void *scratch,
                                              tvk_nearest_lists *of_columns, tvk_nearest *of_rows);

#endif
