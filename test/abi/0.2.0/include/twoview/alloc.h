/* twoview: a context in memory from the heap, for programs that have one. This header is compiled
   into the program and is not included by twoview.h, because the library itself never allocates. */
#ifndef TWOVIEW_ALLOC_H
#define TWOVIEW_ALLOC_H

#include <stdlib.h>
#include <string.h>

#include "twoview/context.h"

/* Makes a context in memory that malloc returns, and writes a pointer to it to *context. Release it
   with tv_context_free.
   Returns the statuses as tv_context_init does; TV_ERR_MEMORY where malloc fails. */
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
  /* tv_context_free finds the block in front of the context. */
  memcpy(memory - sizeof(void *), &block, sizeof(void *));
  status = tv_context_init(context, limits, memory, size_bytes);
  if (status != TV_OK) free(block);
  return status;
}

/* Frees a context that tv_context_new made; null is allowed. */
static inline void tv_context_free(tv_context *context) {
  void *block;
  if (context == NULL) return;
  memcpy(&block, (char *)context - sizeof(void *), sizeof(void *));
  free(block);
}

#endif
