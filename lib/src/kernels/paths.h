/* Semi-global matching: the codes of pixels, their costs, the paths and the choice of a step. All
   numbers are bytes: a cost is at most 16 (the bits of two codes), a path adds at most
   TVK_DENSE_LARGE to it, and the sum of three paths is at most 144. Loops run over blocks of
   TVK_DENSE_BLOCK, a number that the compiler knows, so that they become vector code. */

/* One bit more behind the bits of a census: whether a is above b by more than `most`. */
static block append(block bits, block a, block b, block most) {
  const block above = block_less(a, block_least(a, b));
  /* A comparison gives 255, and with one more 0, where the difference is tolerated. */
  const block is_more = block_add(block_equal(block_least(above, most), above), block_of(1));
  return block_add(block_add(bits, bits), is_more);
}

void TVK_DENSE(census_codes)(const uint8_t *const *rows, int32_t width, int32_t tolerance,
                             uint8_t *brighter, uint8_t *darker) {
  /* The 8 neighbours of a 3 x 3 window, and 8 at a distance of two. */
  static const int8_t pairs[8][2] = {{-1, -1}, {0, -1},  {1, -1}, {-1, 0},
                                     {-2, 0},  {-2, -2}, {0, -2}, {2, -2}};
  enum { REACH = TVK_DENSE_CENSUS_REACH };
  const block most = block_of((uint8_t)tolerance), none = block_of(0);
  for (int32_t x = 0; x < width; x += TVK_DENSE_BLOCK) {
    block more = none, less = none;
    for (int n = 0; n < 8; ++n) {
      const int dx = pairs[n][0], dy = pairs[n][1];
      const block a = block_load(rows[REACH + dy] + x + dx);
      const block b = block_load(rows[REACH - dy] + x - dx);
      more = append(more, a, b, most);
      less = append(less, b, a, most);
    }
    const block is_outside = block_equal(block_load(rows[REACH] + x), none);
    /* Pixels outside: all bits of `brighter`, and none of `darker`. */
    block_store(brighter + x, block_or(more, is_outside));
    block_store(darker + x, block_less(block_or(less, is_outside), is_outside));
  }
  for (int i = 0; i < REACH; ++i) {
    brighter[i] = brighter[width - 1 - i] = 0;
    darker[i] = darker[width - 1 - i] = 0;
  }
}

/* TVK_DENSE_LARGE less the difference of two pixels, at least TVK_DENSE_SMALL. */
static inline block edge_cost(block a, block b) {
  const block low = block_least(a, b), most = block_of(TVK_DENSE_LARGE - TVK_DENSE_SMALL);
  const block change = block_or(block_less(a, low), block_less(b, low));
  return block_less(block_of(TVK_DENSE_LARGE), block_least(change, most));
}

void TVK_DENSE(edge_costs)(const uint8_t *row, const uint8_t *above, int32_t width, uint8_t *large,
                           uint8_t *across) {
  for (int32_t x = 0; x < width; x += TVK_DENSE_BLOCK) {
    const block here = block_load(row + x);
    block_store(large + x, edge_cost(here, block_load(above + x)));
    block_store(across + x, edge_cost(here, block_load(row + x - 1)));
  }
}

/* One step of a path for a block: `before` of the pixel before, whose least is least_before. */
static inline block follow(block cost, const uint8_t *before, block least_before, block jump) {
  block way = block_least(block_load(before - 1), block_load(before + 1));
  way = block_add(way, block_of(TVK_DENSE_SMALL));
  way = block_least(block_least(block_load(before), way), jump);
  return block_add(block_less(way, least_before), cost);
}

/* Adds a step of a path to the sums of a column. Returns the least cost of the path. */
static TVK_NOINLINE uint8_t follow_line(const uint8_t *cost, const uint8_t *before,
                                        uint8_t least_before, uint8_t large, int32_t count,
                                        uint8_t *after, uint8_t *sum) {
  const block base = block_of(least_before), jump = block_of((uint8_t)(least_before + large));
  block least = block_of(TVK_DENSE_NEVER);
  for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
    const block way = follow(block_load(cost + k), before + k, base, jump);
    block_store(after + k, way);
    block_store(sum + k, block_add(block_load(sum + k), way));
    least = block_least(least, way);
  }
  return block_lowest(least);
}

void TVK_DENSE(sum_down)(const tvk_dense_row *row) {
  const int32_t count = row->num_steps, pitch = count + 2 * TVK_DENSE_PAD;
  for (int32_t x = 0; x < row->width; ++x) {
    uint8_t *const cost = row->costs + (ptrdiff_t)x * count;
    uint8_t *const sum = row->sums + (ptrdiff_t)x * count;
    const uint8_t *const before = row->before + (ptrdiff_t)x * pitch + TVK_DENSE_PAD;
    uint8_t *const after = row->after + (ptrdiff_t)x * pitch + TVK_DENSE_PAD;
    const block brighter = block_of(row->brighter0[x]), darker = block_of(row->darker0[x]);
    memset(sum, 0, (size_t)count);
    memset(cost, 0, (size_t)count);
    for (int32_t k = 0; k < count && row->grey0[x] != 0; k += TVK_DENSE_BLOCK) {
      block_store(cost + k,
                  block_add(block_bits(block_xor(brighter, block_load(row->brighter1 + x + k))),
                            block_bits(block_xor(darker, block_load(row->darker1 + x + k)))));
    }
    row->least[x] = follow_line(cost, before, row->least[x], row->large[x], count, after, sum);
  }
}

void TVK_DENSE(sum_across)(const tvk_dense_row *row) {
  const int32_t count = row->num_steps, pitch = count + 2 * TVK_DENSE_PAD, width = row->width;
  uint8_t *line[4];
  uint8_t least_left = 0, least_right = 0;
  for (int n = 0; n < 4; ++n) {
    line[n] = row->ends + (ptrdiff_t)n * pitch + TVK_DENSE_PAD;
    memset(line[n] - TVK_DENSE_PAD, TVK_DENSE_NEVER, (size_t)pitch);
  }
  memset(line[1], 0, (size_t)count);
  memset(line[3], 0, (size_t)count);
  /* Both at once: each waits for its own pixel before, so one fills the other's pauses. */
  for (int32_t x = 0; x < width; ++x) {
    const int32_t u = width - 1 - x;
    const uint8_t left = x > 0 ? row->across[x] : TVK_DENSE_LARGE;
    const uint8_t right = x > 0 ? row->across[u + 1] : TVK_DENSE_LARGE;
    least_left = follow_line(row->costs + (ptrdiff_t)x * count, line[1 - (x & 1)], least_left, left,
                             count, line[x & 1], row->sums + (ptrdiff_t)x * count);
    least_right = follow_line(row->costs + (ptrdiff_t)u * count, line[3 - (x & 1)], least_right,
                              right, count, line[2 + (x & 1)], row->sums + (ptrdiff_t)u * count);
  }
}

static TVK_NOINLINE uint8_t lowest_of(const uint8_t *sum, int32_t count) {
  block low = block_of(255);
  for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) low = block_least(low, block_load(sum + k));
  return block_lowest(low);
}

/* The first entry of the least sum; and by how much the least sum is larger of those that are more
   than `reach` entries away. */
static TVK_NOINLINE int32_t choose(const uint8_t *sum, int32_t count, int32_t reach,
                                   uint8_t *lowest, uint8_t *margin) {
  static const uint8_t number[TVK_DENSE_BLOCK] = {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10,
                                                  11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21,
                                                  22, 23, 24, 25, 26, 27, 28, 29, 30, 31};
  const block numbers = block_load(number), span = block_of((uint8_t)(2 * reach));
  *lowest = lowest_of(sum, count);
  const block low = block_of(*lowest);
  block next = block_of(255);
  int32_t at = 0, first;
  while ((first = block_first(block_equal(block_load(sum + at), low))) < 0) at += TVK_DENSE_BLOCK;
  at += first;
  for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
    /* Of the block, the entries from `begin` on, 2 reach + 1 of them, are the winner's. */
    const int32_t begin = at - reach - k;
    const uint8_t own = (uint8_t)(begin < -2 * reach || begin >= TVK_DENSE_BLOCK ? 128 : begin);
    const block behind = block_less(numbers, block_of(own));
    const block without = block_equal(block_least(behind, span), behind);
    next = block_least(next, block_or(block_load(sum + k), without));
  }
  *margin = (uint8_t)(block_lowest(next) - *lowest);
  return at;
}

void TVK_DENSE(choose_steps)(const tvk_dense_row *row, int16_t *steps, uint8_t *least,
                             uint8_t *margin, uint8_t *least1) {
  enum { STRETCHES = 8 };
  const int32_t count = row->num_steps, width = row->width;
  memset(least1, 255, (size_t)(width + count - 1));
  /* Columns in an order in which neighbours are far apart: what one stores in least1 the next would
     load at another alignment, and wait for. */
  const int32_t stretch = (width + STRETCHES - 1) / STRETCHES;
  for (int32_t n = 0; n < stretch * STRETCHES; ++n) {
    const int32_t x = n % STRETCHES * stretch + n / STRETCHES;
    if (x >= width) continue;
    if (row->grey0[x] == 0) { /* Nothing is known of its sums: they must not count in least1. */
      steps[x] = 0;
      least[x] = margin[x] = 0;
      continue;
    }
    const uint8_t *const sum = row->sums + (ptrdiff_t)x * count;
    uint8_t *const other = least1 + x;
    for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
      block_store(other + k, block_least(block_load(other + k), block_load(sum + k)));
    }
    steps[x] = (int16_t)choose(sum, count, 1, least + x, margin + x);
  }
}
