/* Links against an installed libtwoview and checks that header and library have the same
   version. */
#include <stdio.h>
#include <string.h>

#include "twoview/alloc.h"
#include "twoview/twoview.h"

int main(void) {
  tv_limits limits;
  tv_context *context = NULL;
  tv_status status;
  tv_limits_init(&limits);
  status = tv_context_new(&context, &limits);
  printf("twoview %s, %s kernels: %s\n", tv_version_string(),
         tv_kernels_string(tv_context_kernels(context)), tv_status_string(status));
  tv_context_free(context);
  return status != TV_OK || strcmp(tv_version_string(), TV_VERSION_STRING) != 0;
}
