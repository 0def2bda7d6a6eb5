#include "twoview_drivers/ardrone/navdata.h"

#include <math.h>
#include <string.h>

#include "../source/sized.h"
#include "bytes.h"
#include "navdata_layout.h"
#include "twoview_drivers/attitude.h"

/* The sum of all bytes, eight at a time: two sums of 16-bit lanes, which are added to the total
   before a lane can overflow (128 blocks x 2 x 255 < 65536). */
static uint32_t sum_bytes(const uint8_t *p, size_t size) {
  const uint64_t even = UINT64_C(0x00ff00ff00ff00ff);
  uint32_t sum = 0;
  while (size >= 8) {
    size_t blocks = size / 8;
    uint64_t lanes = 0;
    if (blocks > 128) blocks = 128;
    size -= blocks * 8;
    for (; blocks > 0; --blocks, p += 8) {
      const uint64_t v = ardrone_get64(p);
      lanes += (v & even) + (v >> 8 & even);
    }
    sum += (uint32_t)(lanes & 0xffff) + (uint32_t)(lanes >> 16 & 0xffff) +
           (uint32_t)(lanes >> 32 & 0xffff) + (uint32_t)(lanes >> 48);
  }
  for (; size > 0; --size) sum += *p++;
  return sum;
}

/* Returns TVS_OK if the headers and the checksum are those of a whole packet. */
static tvs_status check_packet(const uint8_t *bytes, size_t size) {
  size_t at = NAVDATA_HEADER_BYTES;
  uint32_t magic;
  if (size < NAVDATA_HEADER_BYTES + NAVDATA_CHECKSUM_BYTES) return TVS_ERR_DATA;
  magic = ardrone_get32(bytes);
  if (magic != NAVDATA_MAGIC && magic != NAVDATA_MAGIC_EXTRA) return TVS_ERR_DATA;
  while (size - at >= NAVDATA_OPTION_BYTES) {
    const uint32_t tag = ardrone_get16(bytes + at);
    const size_t option_bytes = ardrone_get16(bytes + at + 2);
    if (option_bytes < NAVDATA_OPTION_BYTES || option_bytes > size - at) return TVS_ERR_DATA;
    if (tag == ARDRONE_TAG_CHECKSUM) {
      if (option_bytes != NAVDATA_CHECKSUM_BYTES || at + option_bytes != size) return TVS_ERR_DATA;
      return sum_bytes(bytes, at) == ardrone_get32(bytes + at + 4) ? TVS_OK : TVS_ERR_CHECKSUM;
    }
    at += option_bytes;
  }
  return TVS_ERR_DATA; /* the datagram ends before the checksum */
}

static const uint8_t *read_run(const uint8_t *from, const navdata_run *run, uint8_t *to) {
  int k;
  to += run->offset;
  switch (run->width) {
    case 1: memcpy(to, from, run->count); break;
    case 2:
      for (k = 0; k < run->count; ++k) {
        const uint16_t value = ardrone_get16(from + 2 * k);
        memcpy(to + 2 * k, &value, 2);
      }
      break;
    case 4:
      for (k = 0; k < run->count; ++k) {
        const uint32_t value = ardrone_get32(from + 4 * k);
        memcpy(to + 4 * k, &value, 4);
      }
      break;
    default:
      for (k = 0; k < run->count; ++k) {
        const uint64_t value = ardrone_get64(from + 8 * k);
        memcpy(to + 8 * k, &value, 8);
      }
  }
  return from + run->width * run->count;
}

static ardrone_gps_form gps_form(size_t option_bytes) {
  return option_bytes == 12    ? ARDRONE_GPS_ZIMMU
         : option_bytes == 480 ? ARDRONE_GPS_247
                               : ARDRONE_GPS_248;
}

static void read_option(const uint8_t *option, ardrone_navdata *navdata) {
  const uint32_t tag = ardrone_get16(option);
  const size_t bytes = ardrone_get16(option + 2);
  const navdata_layout *layout = ardrone_navdata_layout(tag, bytes);
  const uint8_t *from = option + NAVDATA_OPTION_BYTES;
  int k;
  if (!layout || (navdata->present >> tag & 1)) {
    ++navdata->num_unknown;
    return;
  }
  if (bytes < layout->bytes) {
    ++navdata->num_short;
    return;
  }
  for (k = 0; k < layout->num_runs; ++k) {
    from = read_run(from, &layout->runs[k], (uint8_t *)navdata);
  }
  navdata->present |= UINT32_C(1) << tag;
  if (tag == ARDRONE_TAG_GPS) navdata->gps_form = gps_form(bytes);
}

tvs_status ardrone_navdata_decode(const uint8_t *bytes, size_t size, ardrone_navdata *navdata) {
  size_t at = NAVDATA_HEADER_BYTES;
  tvs_status status;
  if (!bytes || !navdata) return TVS_ERR_NULL;
  status = check_packet(bytes, size);
  if (status != TVS_OK) return status;
  memset(navdata, 0, sizeof *navdata);
  navdata->magic = ardrone_get32(bytes);
  navdata->state = ardrone_get32(bytes + 4);
  navdata->sequence = ardrone_get32(bytes + 8);
  navdata->vision_defined = ardrone_get32(bytes + 12);
  navdata->checksum = ardrone_get32(bytes + size - 4);
  for (; at < size - NAVDATA_CHECKSUM_BYTES; at += ardrone_get16(bytes + at + 2)) {
    read_option(bytes + at, navdata);
  }
  return TVS_OK;
}

enum { FAR_BEHIND = 1000, LATE_IN_A_ROW = 8 };

static ardrone_order accept(ardrone_sequence *sequence, const ardrone_navdata *navdata,
                            ardrone_order order) {
  sequence->last = navdata->sequence;
  sequence->has_last = 1;
  sequence->was_bootstrap = (navdata->state & ARDRONE_STATE_BOOTSTRAP) != 0;
  sequence->num_late = 0;
  return order;
}

ardrone_order ardrone_sequence_check(ardrone_sequence *sequence, const ardrone_navdata *navdata) {
  const uint32_t ahead = navdata->sequence - sequence->last;
  const uint32_t behind = 0u - ahead;
  const int bootstrap = (navdata->state & ARDRONE_STATE_BOOTSTRAP) != 0;
  if (!sequence->has_last) return accept(sequence, navdata, ARDRONE_ORDER_RESTART);
  if (ahead != 0 && ahead < UINT32_C(0x80000000)) {
    return accept(sequence, navdata, ahead == 1 ? ARDRONE_ORDER_NEXT : ARDRONE_ORDER_GAP);
  }
  if (behind >= FAR_BEHIND || (bootstrap && !sequence->was_bootstrap)) {
    return accept(sequence, navdata, ARDRONE_ORDER_RESTART);
  }
  /* A packet that was overtaken comes alone. A drone whose count started again sends many packets
     in order, so several late ones in order are a restart. */
  if (sequence->num_late > 0 && navdata->sequence != sequence->late_last + 1) {
    sequence->num_late = 0;
  }
  sequence->late_last = navdata->sequence;
  if (++sequence->num_late >= LATE_IN_A_ROW)
    return accept(sequence, navdata, ARDRONE_ORDER_RESTART);
  return ARDRONE_ORDER_LATE;
}

int64_t ardrone_time_ns(ardrone_time time) {
  return (int64_t)(time.stamp >> 21) * 1000000000 + (int64_t)(time.stamp & 0x1fffff) * 1000;
}

#define DEGREE 0.017453292519943295
static const double GRAVITY = 9.80665;

static int is_within(double value, double most) { return value >= -most && value <= most; }

static int are_within(const float v[3], double most) {
  return is_within(v[0], most) && is_within(v[1], most) && is_within(v[2], most);
}

static void scale(const float from[3], double factor, double to[3]) {
  int k;
  for (k = 0; k < 3; ++k) to[k] = from[k] * factor;
}

static void take_attitude(const ardrone_demo *demo, double psi0_rad, tvs_imu *sample) {
  if (!is_within(demo->theta_mdeg, 90e3) || !is_within(demo->phi_mdeg, 180e3) ||
      !is_within(demo->psi_mdeg, 360e3)) {
    return;
  }
  tvs_quaternion_from_euler(demo->psi_mdeg * 1e-3 * DEGREE - psi0_rad,
                            demo->theta_mdeg * 1e-3 * DEGREE, demo->phi_mdeg * 1e-3 * DEGREE,
                            sample->attitude.world_from_body);
  sample->attitude.sigma_rad = 0.5 * DEGREE;
  sample->valid |= TVS_IMU_ATTITUDE;
}

static void take_motion(const ardrone_navdata *navdata, tvs_imu *sample) {
  const ardrone_demo *demo = &navdata->demo;
  const float *v = demo->velocity_mm_s;
  if ((navdata->state & ARDRONE_STATE_FLYING) == 0)
    return; /* on the ground the drone reports velocity and altitude without measuring them */
  if (demo->altitude_mm > 0 && demo->altitude_mm < 200000 &&
      (navdata->state & ARDRONE_STATE_ULTRASOUND_DEAF) == 0) {
    sample->altitude_m = demo->altitude_mm * 1e-3;
    sample->altitude_sigma = 0.02 + 0.01 * sample->altitude_m;
    sample->valid |= TVS_IMU_ALTITUDE;
  }
  if (!is_within(v[0], 20e3) || !is_within(v[1], 20e3)) return;
  sample->velocity_m_s[0] = v[0] * 1e-3;
  sample->velocity_m_s[1] = v[1] * 1e-3;
  sample->velocity_sigma = 0.1;
  sample->valid |= TVS_IMU_VELOCITY_XY;
  if (ARDRONE_HAS(navdata, ARDRONE_TAG_ALTITUDE) && is_within(navdata->altitude.vz_mm_s, 20e3) &&
      (sample->valid & TVS_IMU_ATTITUDE)) {
    /* The velocity downwards in the world is the third row of the rotation times the body
       velocity; this is solved for the body's z. */
    const double theta = demo->theta_mdeg * 1e-3 * DEGREE, phi = demo->phi_mdeg * 1e-3 * DEGREE;
    const double down = cos(theta) * cos(phi);
    if (down > 0.5) {
      sample->velocity_m_s[2] =
          (-navdata->altitude.vz_mm_s * 1e-3 + sin(theta) * sample->velocity_m_s[0] -
           cos(theta) * sin(phi) * sample->velocity_m_s[1]) /
          down;
      sample->valid |= TVS_IMU_VELOCITY_Z;
    }
  }
}

tvs_status ardrone_navdata_to_imu(const ardrone_navdata *navdata, double psi0_rad, tvs_imu *given) {
  tvs_imu own, *sample = &own;
  if (!navdata || !given) return TVS_ERR_NULL;
  if (!tvs_is_sized(given, TVS_SIZE_THROUGH(tvs_imu, pressure_sigma))) return TVS_ERR_STRUCT_SIZE;
  memset(sample, 0, sizeof *sample);
  if (ARDRONE_HAS(navdata, ARDRONE_TAG_DEMO)) {
    take_attitude(&navdata->demo, psi0_rad, sample);
    take_motion(navdata, sample);
  }
  if (ARDRONE_HAS(navdata, ARDRONE_TAG_PHYS_MEASURES)) {
    const ardrone_phys_measures *phys = &navdata->phys_measures;
    if (are_within(phys->acceleration_mg, 16e3)) {
      scale(phys->acceleration_mg, 1e-3 * GRAVITY, sample->acceleration_m_s2);
      sample->acceleration_sigma = 0.3;
      sample->valid |= TVS_IMU_ACCELERATION;
    }
    if (are_within(phys->rate_deg_s, 2500)) {
      scale(phys->rate_deg_s, DEGREE, sample->rate_rad_s);
      sample->rate_sigma = 0.5 * DEGREE;
      sample->valid |= TVS_IMU_RATE;
    }
  }
  if (ARDRONE_HAS(navdata, ARDRONE_TAG_PRESSURE) && navdata->pressure.pressure_pa > 20000 &&
      navdata->pressure.pressure_pa < 120000) {
    sample->pressure_pa = navdata->pressure.pressure_pa;
    sample->pressure_sigma = 5;
    sample->valid |= TVS_IMU_PRESSURE;
  }
  tvs_write_sized(sample, sizeof *sample, given, given->struct_size);
  return sample->valid ? TVS_OK : TVS_NONE;
}
