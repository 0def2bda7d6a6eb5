/* twoview: a convenience outside the library, for programs that do have a heap. Not included by
   twoview.h: the library itself never allocates. */
#ifndef TWOVIEW_ALLOC_H
#define TWOVIEW_ALLOC_H

#include <stdlib.h>
#include <string.h>

#include "twoview/context.h"

/* A context in memory from the heap; release with tv_context_free. Statuses of tv_context_init, and
   TV_ERR_MEMORY when the heap has none. */
static inline tv_status tv_context_new(tv_context **context, const tv_limits *limits) {
  size_t size_bytes = 0;
  tv_status status;
  char *block, *memory;
  if (context == NULL) return TV_ERR_NULL;
  status = tv_context_size(limits, &size_bytes);
  if (status != TV_OK) return status;
  block = (char *)malloc(size_bytes + TV_CONTEXT_ALIGNMENT + sizeof(void *));
  if (block == NULL) return TV_ERR_MEMORY;
  memory = block + sizeof(void *);
  memory += TV_CONTEXT_ALIGNMENT - (uintptr_t)memory % TV_CONTEXT_ALIGNMENT;
  memcpy(memory - sizeof(void *), &block, sizeof(void *)); /* for tv_context_free */
  status = tv_context_init(context, limits, memory, size_bytes);
  if (status != TV_OK) free(block);
  return status;
}

/* Releases a context of tv_context_new; null is allowed. */
static inline void tv_context_free(tv_context *context) {
  void *block;
  if (context == NULL) return;
  memcpy(&block, (char *)context - sizeof(void *), sizeof(void *));
  free(block);
}

#endif
