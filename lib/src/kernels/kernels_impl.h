/* One kernel set's own kernels: include with TVK_SET (a tv_kernels) and TVK_TABLE (the table's
   name) defined, and TVK_MATCH(name), its kernels on matches, where they are not the portable ones;
   then kernels/kernels_table.h. In between a set may put another's kernel in the place of its own,
   which then is not compiled: the same speed, and a kernel less. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "kernels/kernels.h"
#include "twoview/context.h"

#pragma GCC diagnostic ignored "-Wunused-function" /* those of them that another set lends */

/* clang-format off */
#include "kernels/fast.h"
#include "kernels/resample.h"
#include "kernels/words.h"
#include "kernels/patch.h"
#include "kernels/describe.h"
#include "kernels/nearest.h"
/* clang-format on */

/* Gives a kernel of this file a name for other sets' tables. */
#define TVK_LEND(name, set) extern __typeof__(name) tvk_##name##_##set __attribute__((alias(#name)))
