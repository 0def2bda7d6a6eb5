/* The body of a set's file of the kernels on pixels, patches and descriptors. Define
   TVK_TABLE(part), the name of a part's table; then include this file and after it
   kernels/kernels_table.h. Between the two a set may #define one of its kernels as another set's
   that is as fast; its own is then not compiled. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "kernels/kernels.h"

#pragma GCC diagnostic ignored "-Wunused-function" /* kernels replaced by another set's */

/* clang-format off */
#include "kernels/fast.h"
#include "kernels/words.h"
#include "kernels/resample.h"
#include "kernels/hessian.h"
#include "kernels/patch.h"
#include "kernels/describe.h"
#include "kernels/nearest.h"
#include "kernels/align_window.h"
/* clang-format on */

/* Exports a kernel of this file under a name by which the tables of other sets can use it. */
#define TVK_LEND(name, set) extern __typeof__(name) tvk_##name##_##set __attribute__((alias(#name)))
