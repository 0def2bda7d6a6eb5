/* The body of a set's file of the dense cloud's kernels. Define TVK_DENSE(name), which gives their
   names, and TVK_DENSE_TABLE, then include this file. */
#include "kernels/dense.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#define TVK_DECLARE(name, result, parameters) result TVK_DENSE(name) parameters;
TVK_DENSE_LIST(TVK_DECLARE)
#undef TVK_DECLARE

/* clang-format off */
#include "kernels/block.h"
#include "kernels/paths.h"
#include "kernels/patches.h"
#include "kernels/planes.h"
/* clang-format on */

extern const tvk_dense_table TVK_DENSE_TABLE;
const tvk_dense_table TVK_DENSE_TABLE = {
#define TVK_ENTRY(name, result, parameters) TVK_DENSE(name),
    TVK_DENSE_LIST(TVK_ENTRY)
#undef TVK_ENTRY
};
