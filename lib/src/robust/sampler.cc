#include "robust/sampler.h"

namespace tv {
namespace {

// Draws `count` different numbers below `bound` into sample[0 ..].
void draw_distinct(Random& random, int bound, int count, int32_t* sample) {
  for (int k = 0; k < count; ++k) {
    // The j-th of the numbers not drawn yet: step over the drawn ones in ascending order.
    int32_t value = static_cast<int32_t>(random_below(random, static_cast<uint32_t>(bound - k)));
    int place = 0;
    while (place < k && sample[place] <= value) {
      ++value;
      ++place;
    }
    for (int j = k; j > place; --j) sample[j] = sample[j - 1];
    sample[place] = value;
  }
}

}  // namespace

Sampler make_sampler(uint64_t seed, int num, int size, bool progressive) {
  Sampler sampler{random_seeded(seed),  num, size, progressive, size,
                  kProsacSamples * num, 1,   0,    false};
  for (int i = 0; i < size; ++i) {
    sampler.average *= static_cast<double>(size - i) / static_cast<double>(num - i);
  }
  return sampler;
}

void draw_sample(Sampler& sampler, int32_t* sample) {
  const bool uniform = !sampler.progressive || sampler.uniform_next;
  sampler.uniform_next = !sampler.uniform_next;
  if (uniform) return draw_distinct(sampler.random, sampler.num, sampler.size, sample);
  ++sampler.drawn;
  while (sampler.drawn > sampler.next_growth && sampler.pool < sampler.num) {
    const double n = sampler.pool;
    const double grown = sampler.average * (n + 1) / (n + 1 - sampler.size);
    // Rounded up, as in the paper, so that each pool gets at least one sample.
    const double samples = grown - sampler.average;
    const int64_t whole = static_cast<int64_t>(samples);
    sampler.next_growth += whole + (static_cast<double>(whole) < samples ? 1 : 0);
    sampler.average = grown;
    ++sampler.pool;
  }
  if (sampler.pool >= sampler.num) {
    return draw_distinct(sampler.random, sampler.num, sampler.size, sample);
  }
  // The sample has the newest match of the pool, and the others are drawn from the older ones.
  draw_distinct(sampler.random, sampler.pool - 1, sampler.size - 1, sample);
  sample[sampler.size - 1] = sampler.pool - 1;
}

}  // namespace tv
