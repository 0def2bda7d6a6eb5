/* The kernels that gain by the dot product of ARMv8.2. The table is beside the NEON set's
   (kernels_neon.c), whose other kernels it shares. */
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
