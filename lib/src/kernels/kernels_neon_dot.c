/* The kernels that are faster with the dot product of ARMv8.2. Their table, in kernels_neon.c,
   takes all other kernels from the NEON set. */
#define TVK_NEON_DOT
#include <string.h>

/* clang-format off */
#include "kernels/neon_dot.h"
#include "kernels/nearest.h"
/* clang-format on */

void tvk_mutual_nearest_neon_dot(const uint8_t *rows, int32_t num_rows, const uint8_t *columns,
                                 int32_t num_columns, void *scratch, tvk_nearest *of_columns,
                                 tvk_nearest *of_rows) {
  mutual_nearest(rows, num_rows, columns, num_columns, scratch, of_columns, of_rows);
}
