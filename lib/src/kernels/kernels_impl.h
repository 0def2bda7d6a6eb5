/* One kernel set: include with TVK_SET (a tv_kernels) and TVK_TABLE (the table's name) defined. */
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
#include "kernels/relpose_5pt.h"
#include "kernels/sampson.h"
#include "kernels/triangulate.h"
/* clang-format on */

extern const tvk_table TVK_TABLE;
const tvk_table TVK_TABLE = {
    TVK_SET,
#define TVK_ENTRY(name, result, parameters) name,
    TVK_LIST(TVK_ENTRY)
#undef TVK_ENTRY
};
