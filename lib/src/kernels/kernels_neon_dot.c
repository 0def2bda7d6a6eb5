/* The kernels that are faster with the dot product of ARMv8.2. Their table, in kernels_neon.c,
   takes all other kernels from the NEON set. */
#define TVK_NEON_DOT
#include <string.h>

/* clang-format off */
#include "kernels/neon_dot.h"
#include "kernels/nearest.h"
/* clang-format on */

tvk_nearest_shape tvk_nearest_groups_neon_dot(const tvk_descriptors *rows,
                                              const tvk_descriptors *columns, void *scratch,
                                              tvk_nearest_lists *of_columns, tvk_nearest *of_rows) {
  return nearest_groups(rows, columns, scratch, of_columns, of_rows);
}
