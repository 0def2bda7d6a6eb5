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

/* A path at a column: what follow needs of the column before, block by block. */
typedef struct path {
  block base, jump;         /* the least cost of the column before, and with a large change added */
  block behind, own, least; /* its blocks at k - TVK_DENSE_BLOCK and k; the least cost from here */
} path;

static inline path path_from(const uint8_t *line, block least_before, uint8_t large) {
  const block never = block_of(TVK_DENSE_NEVER);
  return (path){least_before, block_add(least_before, block_of(large)), never, block_load(line),
                never};
}

/* The costs of a path at a block of steps, those of the column before in `line`. Blocks are taken
   in their order, and the next may be written to the same place. */
static inline block follow(path *p, block cost, const uint8_t *line, int32_t k, int32_t count) {
  const int32_t next = k + TVK_DENSE_BLOCK;
  const block ahead = next < count ? block_load(line + next) : block_of(TVK_DENSE_NEVER);
  block way = block_least(block_one_up(p->own, p->behind), block_one_down(p->own, ahead));
  way = block_add(way, block_of(TVK_DENSE_SMALL));
  way = block_least(block_least(p->own, way), p->jump);
  way = block_add(way, block_less(cost, p->base));
  p->behind = p->own;
  p->own = ahead;
  p->least = block_least(p->least, way);
  return way;
}

/* The path from the left waits for its own pixel before; the costs and the path from above fill
   its pauses. */
void TVK_DENSE(sum_ahead)(const tvk_dense_row *row) {
  const int32_t count = row->num_steps;
  uint8_t *const line = row->scratch;
  block least = block_of(0);
  memset(line, 0, (size_t)count);
  for (int32_t x = 0; x < row->width; ++x) {
    uint8_t *const cost = row->costs + (ptrdiff_t)x * count;
    uint8_t *const sum = row->sums + (ptrdiff_t)x * count;
    uint8_t *const above = row->above + (ptrdiff_t)x * count;
    const block brighter = block_of(row->brighter0[x]), darker = block_of(row->darker0[x]);
    const block is_outside = block_equal(block_of(row->grey0[x]), block_of(0));
    path left = path_from(line, least, x > 0 ? row->across[x] : TVK_DENSE_LARGE);
    path down = path_from(above, block_of(row->least[x]), row->large[x]);
    for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
      block bits = block_add(block_bits(block_xor(brighter, block_load(row->brighter1 + x + k))),
                             block_bits(block_xor(darker, block_load(row->darker1 + x + k))));
      bits = block_without(bits, is_outside);
      block_store(cost + k, bits);
      const block way = follow(&down, bits, above, k, count);
      block_store(above + k, way);
      const block other = follow(&left, bits, line, k, count);
      block_store(line + k, other);
      block_store(sum + k, block_add(way, other));
    }
    least = block_lowest(left.least);
    row->least[x] = block_value(block_lowest(down.least));
  }
}

/* The first entry of the least sum, `low`. */
static inline int32_t first_of(const uint8_t *sum, int32_t count, block low) {
  int32_t at = 0;
  for (int32_t k = count - TVK_DENSE_BLOCK; k >= 0; k -= TVK_DENSE_BLOCK) {
    const int first = block_first(block_equal(block_load(sum + k), low));
    at = first < 0 ? at : k + first;
  }
  return at;
}

/* 255 where entry k + i is at most `reach` away from entry `at`, 0 elsewhere. */
static inline block block_near(int32_t at, int32_t k, int32_t reach) {
  enum { BLOCK = TVK_DENSE_BLOCK };
  static const uint8_t three[2 * BLOCK + 3] = {[BLOCK] = 255, 255, 255};
  static const uint8_t five[2 * BLOCK + 5] = {[BLOCK] = 255, 255, 255, 255, 255};
  const uint8_t *const table = reach == 1 ? three : five;
  int32_t begin = BLOCK + k + reach - at;
  begin = begin < 0 ? 0 : begin;
  return block_load(table + (begin < BLOCK + 2 * reach + 1 ? begin : 0));
}

void TVK_DENSE(choose_steps)(const tvk_dense_row *row, int16_t *steps, uint8_t *least,
                             uint8_t *margin, uint8_t *least1) {
  const int32_t count = row->num_steps, width = row->width;
  /* others: the least sums of the columns x .. x + count - 1 of image 1. */
  uint8_t *const line = row->scratch, *const others = line + count, *const none = others + count;
  block least_before = block_of(0);
  memset(line, 0, (size_t)count);
  memset(others, 255, (size_t)count);
  memset(none, 255, (size_t)count);
  for (int32_t x = width - 1; x >= 0; --x) {
    const uint8_t *const cost = row->costs + (ptrdiff_t)x * count;
    uint8_t *const sum = row->sums + (ptrdiff_t)x * count;
    path left = path_from(line, least_before, x < width - 1 ? row->across[x + 1] : TVK_DENSE_LARGE);
    block low = block_of(255), next = low, behind = low;
    for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
      const block way = follow(&left, block_load(cost + k), line, k, count);
      const block all = block_add(block_load(sum + k), way);
      block_store(line + k, way);
      block_store(sum + k, all);
      low = block_least(low, all);
    }
    least_before = block_lowest(left.least);
    low = block_lowest(low);
    if (x < width - 1) least1[x + count] = others[count - 1];
    const int is_known = row->grey0[x] != 0;
    const uint8_t *const counted = is_known ? sum : none;
    const int32_t at = first_of(sum, count, low);
    for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
      const block own = block_load(others + k);
      block_store(others + k, block_least(block_one_up(own, behind), block_load(counted + k)));
      behind = own;
      next = block_least(next, block_or(block_load(sum + k), block_near(at, k, 1)));
    }
    const uint8_t lowest = block_value(low), second = block_value(block_lowest(next));
    steps[x] = (int16_t)(is_known ? at : 0);
    least[x] = is_known ? lowest : 0;
    margin[x] = is_known ? (uint8_t)(second - lowest) : 0;
  }
  memcpy(least1, others, (size_t)count);
}
