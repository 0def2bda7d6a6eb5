/* One kernel set: include with TVK_SET (a tv_kernels) and TVK_TABLE (the table's name) defined, and
   TVK_MATCH(name), its kernels on matches, where they are not the portable ones. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "kernels/kernels.h"
#include "twoview/context.h"

/* clang-format off */
#include "kernels/fast.h"
#include "kernels/resample.h"
#include "kernels/words.h"
#include "kernels/patch.h"
#include "kernels/describe.h"
#include "kernels/nearest.h"
/* clang-format on */

#if !defined(TVK_MATCH)
#define TVK_MATCH(name) tvk_##name##_c
#endif
#define TVK_DECLARE(name, result, parameters) result TVK_MATCH(name) parameters;
TVK_MATCH_LIST(TVK_DECLARE)
#undef TVK_DECLARE

extern const tvk_table TVK_TABLE;
const tvk_table TVK_TABLE = {
    TVK_SET,
#define TVK_ENTRY(name, result, parameters) name,
    TVK_PIXEL_LIST(TVK_ENTRY)
#undef TVK_ENTRY
#define TVK_ENTRY(name, result, parameters) TVK_MATCH(name),
    TVK_MATCH_LIST(TVK_ENTRY)
#undef TVK_ENTRY
};
