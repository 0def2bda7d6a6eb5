#include "twoview_drivers/attitude.h"

#include <math.h>
#include <string.h>

void tvs_quaternion_from_euler(double yaw, double pitch, double roll, double q[4]) {
  const double cz = cos(yaw / 2), sz = sin(yaw / 2);
  const double cy = cos(pitch / 2), sy = sin(pitch / 2);
  const double cx = cos(roll / 2), sx = sin(roll / 2);
  q[0] = cz * cy * cx + sz * sy * sx;
  q[1] = cz * cy * sx - sz * sy * cx;
  q[2] = cz * sy * cx + sz * cy * sx;
  q[3] = sz * cy * cx - cz * sy * sx;
}

double tvs_angle_between(const double a[4], const double b[4]) {
  double dot = 0;
  int k;
  for (k = 0; k < 4; ++k) dot += a[k] * b[k];
  dot = fabs(dot);
  return dot < 1 ? 2 * acos(dot) : 0;
}

void tvs_slerp(const double a[4], const double b[4], double s, double q[4]) {
  double dot = 0, sign = 1, weight_a = 1 - s, weight_b = s, norm_sq = 0, norm;
  int k;
  for (k = 0; k < 4; ++k) dot += a[k] * b[k];
  if (dot < 0) { /* q and -q are the same attitude; of b and -b the one nearer to a is used */
    dot = -dot;
    sign = -1;
  }
  /* Where dot is within 1e-9 of 1, sin is too small to divide by; the linear weights are then exact
     to rounding. */
  if (dot < 1 - 1e-9) {
    const double angle = acos(dot);
    weight_a = sin((1 - s) * angle) / sin(angle);
    weight_b = sin(s * angle) / sin(angle);
  }
  for (k = 0; k < 4; ++k) {
    q[k] = weight_a * a[k] + weight_b * sign * b[k];
    norm_sq += q[k] * q[k];
  }
  norm = sqrt(norm_sq);
  for (k = 0; k < 4; ++k) q[k] /= norm;
}

void tvs_attitudes_init(tvs_attitudes *attitudes) {
  if (attitudes) attitudes->first = attitudes->count = 0;
}

/* The index into the ring of the k-th entry, the oldest being 0. */
static int32_t slot(const tvs_attitudes *attitudes, int32_t k) {
  return (attitudes->first + k) % TVS_ATTITUDES_CAPACITY;
}

static int is_usable(const tvs_attitude *attitude) {
  const double *q = attitude->world_from_body;
  const double norm_sq = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  return attitude->clock_id != 0 && fabs(norm_sq - 1) <= 2e-6 && attitude->sigma_rad > 0 &&
         attitude->sigma_rad < 1e3;
}

tvs_status tvs_attitudes_add(tvs_attitudes *attitudes, int64_t device_ns,
                             const tvs_attitude *attitude) {
  int32_t at;
  if (!attitudes || !attitude) return TVS_ERR_NULL;
  if (!is_usable(attitude)) return TVS_ERR_ARGUMENT;
  if (attitudes->count > 0) {
    const int32_t newest = slot(attitudes, attitudes->count - 1);
    if (attitudes->entries[newest].attitude.clock_id != attitude->clock_id) {
      tvs_attitudes_init(attitudes);
    } else if (device_ns <= attitudes->entries[newest].device_ns) {
      return TVS_NONE;
    }
  }
  if (attitudes->count == TVS_ATTITUDES_CAPACITY) {
    attitudes->first = slot(attitudes, 1);
    --attitudes->count;
  }
  at = slot(attitudes, attitudes->count++);
  attitudes->entries[at].device_ns = device_ns;
  attitudes->entries[at].attitude = *attitude;
  return TVS_OK;
}

tvs_status tvs_attitudes_at(const tvs_attitudes *attitudes, uint32_t clock_id, int64_t device_ns,
                            int64_t max_gap_ns, tvs_attitude *attitude) {
  int32_t low = 0, high, before, after;
  int64_t gap_ns;
  if (!attitudes || !attitude) return TVS_ERR_NULL;
  high = attitudes->count - 1;
  if (high < 0 || attitudes->entries[slot(attitudes, 0)].attitude.clock_id != clock_id ||
      device_ns < attitudes->entries[slot(attitudes, 0)].device_ns ||
      device_ns > attitudes->entries[slot(attitudes, high)].device_ns) {
    return TVS_NONE;
  }
  while (high - low > 1) { /* device_ns lies between the times of items low and high */
    const int32_t middle = low + (high - low) / 2;
    if (attitudes->entries[slot(attitudes, middle)].device_ns <= device_ns) {
      low = middle;
    } else {
      high = middle;
    }
  }
  before = slot(attitudes, low);
  after = slot(attitudes, high);
  if (device_ns == attitudes->entries[before].device_ns) after = before;
  if (device_ns == attitudes->entries[after].device_ns) before = after;
  gap_ns = attitudes->entries[after].device_ns - attitudes->entries[before].device_ns;
  if (gap_ns > max_gap_ns) return TVS_NONE;
  *attitude = attitudes->entries[before].attitude;
  if (gap_ns > 0) {
    const tvs_attitude *a = &attitudes->entries[before].attitude;
    const tvs_attitude *b = &attitudes->entries[after].attitude;
    const double s = (double)(device_ns - attitudes->entries[before].device_ns) / (double)gap_ns;
    tvs_slerp(a->world_from_body, b->world_from_body, s, attitude->world_from_body);
    if (b->sigma_rad > attitude->sigma_rad) attitude->sigma_rad = b->sigma_rad;
  }
  return TVS_OK;
}
