/* AR.Drone 2.0: navdata, what the drone says about itself (UDP 5554). Pure: bytes in, structs out; no
   socket, no heap. Field names carry the wire's units; ardrone_navdata_to_imu gives SI.

   A datagram is a header, options (tag, size, data) and a checksum. "Bootstrap" packets have no
   option; "demo" ones come at about 15 Hz, full ones at 200 Hz. Body axes are x forward, y right, z
   down; theta nose up, phi right side down, psi clockwise from above are positive. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_NAVDATA_H
#define TWOVIEW_DRIVERS_ARDRONE_NAVDATA_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

enum { ARDRONE_NAVDATA_MAX_BYTES = 4096 };

/* Bits of the state word. */
#define ARDRONE_STATE_FLYING (UINT32_C(1) << 0)
#define ARDRONE_STATE_VIDEO (UINT32_C(1) << 1)
#define ARDRONE_STATE_VISION (UINT32_C(1) << 2)
#define ARDRONE_STATE_RATE_CONTROL (UINT32_C(1) << 3)
#define ARDRONE_STATE_ALTITUDE_CONTROL (UINT32_C(1) << 4)
#define ARDRONE_STATE_START_BUTTON (UINT32_C(1) << 5)
#define ARDRONE_STATE_ACKNOWLEDGE (UINT32_C(1) << 6) /* also set in healthy packets: clear it first */
#define ARDRONE_STATE_CAMERA_READY (UINT32_C(1) << 7)
#define ARDRONE_STATE_TRAVELLING (UINT32_C(1) << 8)
#define ARDRONE_STATE_USB_READY (UINT32_C(1) << 9)
#define ARDRONE_STATE_DEMO (UINT32_C(1) << 10)
#define ARDRONE_STATE_BOOTSTRAP (UINT32_C(1) << 11)
#define ARDRONE_STATE_MOTOR_PROBLEM (UINT32_C(1) << 12)
#define ARDRONE_STATE_COM_LOST (UINT32_C(1) << 13)
#define ARDRONE_STATE_SOFTWARE_FAULT (UINT32_C(1) << 14)
#define ARDRONE_STATE_BATTERY_LOW (UINT32_C(1) << 15)
#define ARDRONE_STATE_USER_EMERGENCY (UINT32_C(1) << 16)
#define ARDRONE_STATE_TIMER_ELAPSED (UINT32_C(1) << 17)
#define ARDRONE_STATE_MAGNETO_CALIBRATION (UINT32_C(1) << 18)
#define ARDRONE_STATE_ANGLES_OUT_OF_RANGE (UINT32_C(1) << 19)
#define ARDRONE_STATE_WIND (UINT32_C(1) << 20)
#define ARDRONE_STATE_ULTRASOUND_DEAF (UINT32_C(1) << 21)
#define ARDRONE_STATE_CUT_OUT (UINT32_C(1) << 22)
#define ARDRONE_STATE_PIC_VERSION_OK (UINT32_C(1) << 23)
#define ARDRONE_STATE_AT_THREAD (UINT32_C(1) << 24)
#define ARDRONE_STATE_NAVDATA_THREAD (UINT32_C(1) << 25)
#define ARDRONE_STATE_VIDEO_THREAD (UINT32_C(1) << 26)
#define ARDRONE_STATE_ACQUISITION_THREAD (UINT32_C(1) << 27)
#define ARDRONE_STATE_CONTROL_LATE (UINT32_C(1) << 28)
#define ARDRONE_STATE_ADC_LATE (UINT32_C(1) << 29)
#define ARDRONE_STATE_COM_WATCHDOG (UINT32_C(1) << 30) /* also set in healthy packets */
#define ARDRONE_STATE_EMERGENCY (UINT32_C(1) << 31)

/* Tags. Bit `tag` of ardrone_navdata.present and of the key general:navdata_options. */
typedef enum ardrone_tag {
  ARDRONE_TAG_DEMO = 0, ARDRONE_TAG_TIME = 1, ARDRONE_TAG_RAW_MEASURES = 2,
  ARDRONE_TAG_PHYS_MEASURES = 3, ARDRONE_TAG_GYROS_OFFSETS = 4, ARDRONE_TAG_EULER_ANGLES = 5,
  ARDRONE_TAG_REFERENCES = 6, ARDRONE_TAG_TRIMS = 7, ARDRONE_TAG_RC_REFERENCES = 8,
  ARDRONE_TAG_PWM = 9, ARDRONE_TAG_ALTITUDE = 10, ARDRONE_TAG_VISION_RAW = 11,
  ARDRONE_TAG_VISION_FLOW = 12, ARDRONE_TAG_VISION = 13, ARDRONE_TAG_VISION_PERF = 14,
  ARDRONE_TAG_TRACKERS = 15, ARDRONE_TAG_VISION_DETECT = 16, ARDRONE_TAG_WATCHDOG = 17,
  ARDRONE_TAG_ADC_DATA = 18, ARDRONE_TAG_VIDEO_STREAM = 19, ARDRONE_TAG_GAMES = 20,
  ARDRONE_TAG_PRESSURE = 21, ARDRONE_TAG_MAGNETO = 22, ARDRONE_TAG_WIND = 23,
  ARDRONE_TAG_KALMAN_PRESSURE = 24, ARDRONE_TAG_HD_VIDEO = 25, ARDRONE_TAG_WIFI = 26,
  ARDRONE_TAG_GPS = 27,     /* three layouts, told apart by size: see below */
  ARDRONE_NUM_TAGS = 28,
  ARDRONE_TAG_CHECKSUM = 0xffff
} ardrone_tag;
#define ARDRONE_HAS(navdata, TAG) (((navdata)->present >> (TAG)) & 1u)

/* Major part (upper 16 bits) of ctrl_state; 3 and 7 both mean flying. */
typedef enum ardrone_control_state {
  ARDRONE_CONTROL_DEFAULT, ARDRONE_CONTROL_INIT, ARDRONE_CONTROL_LANDED, ARDRONE_CONTROL_FLYING,
  ARDRONE_CONTROL_HOVERING, ARDRONE_CONTROL_TEST, ARDRONE_CONTROL_TAKING_OFF,
  ARDRONE_CONTROL_GO_TO_FIX, ARDRONE_CONTROL_LANDING, ARDRONE_CONTROL_LOOPING
} ardrone_control_state;

/* Options, fields in the order of the wire. */
typedef struct ardrone_demo {
  uint32_t ctrl_state, battery_percent;
  float theta_mdeg, phi_mdeg, psi_mdeg;
  int32_t altitude_mm;          /* 0 on the ground */
  float velocity_mm_s[3];       /* body; z is always 0 on this drone: altitude.vz_mm_s instead */
  uint32_t num_frames;
  float detection_rotation[9], detection_translation[3];
  uint32_t detection_tag, detection_type;
  float camera_rotation[9], camera_translation[3];
} ardrone_demo;
typedef struct ardrone_time { uint32_t stamp; } ardrone_time; /* 11 bits of s, 21 of us: wraps at 2048 s */
typedef struct ardrone_raw_measures {
  uint16_t accelerometer[3];
  int16_t gyro[3], gyro_110[2];
  uint32_t battery_mv;
  uint16_t echo_start, echo_end, echo_association, echo_distance, curve_time, curve_value, curve_ref,
      echo_flag, num_echoes;
  uint32_t sum_echo;
  int32_t altitude_mm;
  int16_t gradient;
} ardrone_raw_measures;
typedef struct ardrone_phys_measures {
  float accelerometer_celsius;
  uint16_t gyro_temperature;
  float acceleration_mg[3], rate_deg_s[3]; /* body; at rest z is -1000 mg */
  uint32_t supply_3v3, vref_epson, vref_idg;
} ardrone_phys_measures;
typedef struct ardrone_gyros_offsets { float offset[3]; } ardrone_gyros_offsets;
typedef struct ardrone_euler_angles { float theta_mdeg, phi_mdeg; } ardrone_euler_angles; /* accelerometer alone */
typedef struct ardrone_references {
  int32_t theta, phi, theta_i, phi_i, pitch, roll, yaw, psi;
  float vx, vy, theta_mod, phi_mod, k_vx, k_vy;
  uint32_t k_mode;
  float ui_time, ui_theta, ui_phi, ui_psi, ui_psi_accuracy;
  int32_t ui_sequence;
} ardrone_references;
typedef struct ardrone_trims { float yaw_rate, theta, phi; } ardrone_trims;
typedef struct ardrone_rc_references { int32_t pitch, roll, yaw, climb, ag; } ardrone_rc_references;
typedef struct ardrone_pwm {
  uint8_t motor[4], saturated[4];
  float climb_feed_forward, climb_altitude, altitude_integral, vz_ref;
  int32_t pitch, roll, yaw;
  float yaw_integral;
  int32_t pitch_planned, roll_planned, yaw_planned;
  float climb_planned;
  uint16_t current[4];
  float altitude_proportional, altitude_derivative;
} ardrone_pwm;
typedef struct ardrone_altitude {
  int32_t vision_mm;
  float vz_mm_s; /* up is positive */
  int32_t reference_mm, raw_mm; /* raw: ultrasound, not 0 on the ground */
  float observed_accel_z, observed_altitude, observed_x[3];
  uint32_t observed_state;
  float estimated_v[2];
  uint32_t estimated_state;
} ardrone_altitude;
typedef struct ardrone_vision_raw { float translation[3]; } ardrone_vision_raw;
typedef struct ardrone_vision_flow { float dx[5], dy[5]; } ardrone_vision_flow;
typedef struct ardrone_vision {
  uint32_t state;
  int32_t misc;
  float phi_trim, phi_reference, theta_trim, theta_reference;
  int32_t new_picture;
  float theta_rad, phi_rad, psi_rad; /* at the capture of the on-board vision's picture */
  int32_t altitude_mm;
  uint32_t capture_ms; /* milliseconds of the same clock as time.stamp */
  float velocity_mm_s[3], delta_phi, delta_theta, delta_psi;
  uint32_t gold_defined, gold_reset;
  float gold_x, gold_y;
} ardrone_vision;
typedef struct ardrone_vision_perf {
  float size, corners, compute, tracking, translation, update, custom[20];
} ardrone_vision_perf;
typedef struct ardrone_trackers { int32_t locked[30], points[60]; } ardrone_trackers; /* points: x y */
typedef struct ardrone_vision_detect {
  uint32_t count, type[4], x[4], y[4], width[4], height[4]; /* of 0..1000 of the picture */
  uint32_t distance_cm[4];
  float orientation_deg[4], rotation[36], translation[12];
  uint32_t camera[4];
} ardrone_vision_detect;
typedef struct ardrone_watchdog { int32_t value; } ardrone_watchdog;
typedef struct ardrone_adc_data { uint32_t version; uint8_t data[32]; } ardrone_adc_data;
typedef struct ardrone_video_stream {
  uint8_t quantiser;
  uint32_t frame_size, frame_number, at_sequence, at_mean_gap_ms;
  float at_gap_variance;
  uint32_t at_quality, bitrate, desired_bitrate;
  int32_t data[5];
  uint32_t tcp_queue, fifo_queue;
} ardrone_video_stream;
typedef struct ardrone_games { uint32_t double_taps, finish_lines; } ardrone_games;
typedef struct ardrone_pressure {
  int32_t up;
  int16_t ut;
  int32_t temperature_dc, pressure_pa; /* 0.1 degrees Celsius */
} ardrone_pressure;
typedef struct ardrone_magneto {
  int16_t raw[3];
  float field_mg[3], rectified[3], offset[3]; /* milligauss, body */
  float heading_deg, heading_gyro_deg, heading_fusion_deg;
  uint8_t calibrated;
  uint32_t state;
  float radius, error_mean, error_variance;
} ardrone_magneto;
typedef struct ardrone_wind {
  float speed_m_s, angle, theta_rad, phi_rad, state[6], debug[3];
} ardrone_wind;
typedef struct ardrone_kalman_pressure {
  float offset_pa, z, vz, bias_pwm, bias_pressure, offset_ultrasound, prediction_ultrasound,
      variance_altitude, variance_pwm, variance_speed;
  uint32_t ground_effect;
  float innovation_sum;
  uint32_t rejects_ultrasound;
  float multisinus, climb_altitude;
  uint32_t multisinus_flag, multisinus_start;
} ardrone_kalman_pressure;
typedef struct ardrone_hd_video {
  uint32_t state, fifo_packets, fifo_size, usb_size_kb, usb_free_kb, frame_number, remaining_s;
} ardrone_hd_video;
typedef struct ardrone_wifi { uint32_t link_quality; } ardrone_wifi;
typedef struct ardrone_gps { /* firmware 2.4.8; of 2.4.7's only the first four are known */
  double latitude_deg, longitude_deg, elevation_m, hdop;
  uint32_t data_available, zero_validated, waypoint_validated;
  double latitude0, longitude0, latitude_fused, longitude_fused;
  uint32_t state;
  float x_trajectory, x_reference, y_trajectory, y_reference, theta_p, phi_p, theta_i, phi_i,
      theta_d, phi_d;
  double vdop, pdop;
  float speed;
  uint32_t last_frame_stamp;
  float degree, degree_magnetic, ehpe, ehve, c_n0;
  uint32_t num_satellites;
  uint8_t channels[24]; /* 12 times satellite, signal */
  uint32_t plugged, ephemeris;
  float vx_trajectory, vy_trajectory;
  uint32_t firmware;
} ardrone_gps;
typedef struct ardrone_zimmu { int32_t vz_lsb; float vz; } ardrone_zimmu;

/* Which layout tag 27 had. */
typedef enum ardrone_gps_form {
  ARDRONE_GPS_NONE = 0,
  ARDRONE_GPS_ZIMMU = 1, /* 12 bytes, firmware of 2012: `zimmu` */
  ARDRONE_GPS_247 = 2,   /* 480 bytes: `gps`, its first four fields, which may be garbage */
  ARDRONE_GPS_248 = 3    /* 216 bytes: `gps` */
} ardrone_gps_form;

/* One packet. An option that is not in `present` is zeros. */
typedef struct ardrone_navdata {
  uint32_t magic, state, sequence, vision_defined, checksum;
  uint32_t present;     /* bit per ardrone_tag that was there, whole */
  uint32_t num_unknown; /* options of a tag or a size that nobody knows, or there twice: passed over */
  uint32_t num_short;   /* options shorter than this firmware's: passed over */
  ardrone_gps_form gps_form;
  ardrone_demo demo;
  ardrone_time time;
  ardrone_raw_measures raw_measures;
  ardrone_phys_measures phys_measures;
  ardrone_gyros_offsets gyros_offsets;
  ardrone_euler_angles euler_angles;
  ardrone_references references;
  ardrone_trims trims;
  ardrone_rc_references rc_references;
  ardrone_pwm pwm;
  ardrone_altitude altitude;
  ardrone_vision_raw vision_raw;
  ardrone_vision_flow vision_flow;
  ardrone_vision vision;
  ardrone_vision_perf vision_perf;
  ardrone_trackers trackers;
  ardrone_vision_detect vision_detect;
  ardrone_watchdog watchdog;
  ardrone_adc_data adc_data;
  ardrone_video_stream video_stream;
  ardrone_games games;
  ardrone_pressure pressure;
  ardrone_magneto magneto;
  ardrone_wind wind;
  ardrone_kalman_pressure kalman_pressure;
  ardrone_hd_video hd_video;
  ardrone_wifi wifi;
  ardrone_gps gps;
  ardrone_zimmu zimmu;
} ardrone_navdata;

/* Decodes one datagram. All of it is checked before any of it is used: on an error *navdata is as it
   was. Options longer than known (newer firmware) give what is known of them.
   Returns TVS_ERR_NULL; TVS_ERR_DATA: no navdata (magic), truncated, an option of size 0 to 3 or
   beyond the end, no checksum option at the end; TVS_ERR_CHECKSUM.
   Reads no byte outside [bytes, bytes + size). About 1 us for a full packet. */
TV_API tvs_status ardrone_navdata_decode(const uint8_t *bytes, size_t size,
                                         ardrone_navdata *navdata);

/* Which packets are news. UDP loses, doubles and reorders; drones start again. Start with zeros. */
typedef struct ardrone_sequence {
  uint32_t last;
  int has_last, was_bootstrap;
  uint32_t late_last;
  int num_late;
} ardrone_sequence;

typedef enum ardrone_order {
  ARDRONE_ORDER_NEXT,   /* in order */
  ARDRONE_ORDER_GAP,    /* in order, some before it are missing */
  ARDRONE_ORDER_RESTART, /* the drone counts anew: a reboot, or its link was re-made */
  ARDRONE_ORDER_LATE    /* doubled or overtaken: do not use */
} ardrone_order;

/* By the numbers: newer is news (through the wrap of 32 bits); 1000 and more behind, or bootstrap
   behind a packet that was none, or 8 packets behind in a row that are in order among themselves, is a restart.
   After a silence of the stream set has_last to 0: whatever comes next is taken. */
TV_API ardrone_order ardrone_sequence_check(ardrone_sequence *sequence,
                                            const ardrone_navdata *navdata);

/* Seconds of ardrone_time as nanoseconds in [0, 2048 s). */
#define ARDRONE_TIME_PERIOD_NS INT64_C(2048000000000)
TV_API int64_t ardrone_time_ns(ardrone_time time);

/* The packet in SI units and the frames of source.h, without its time. psi0_rad is the yaw at the start,
   which becomes 0. Fields whose numbers are no possible measurement (a garbled option, NaN) are not
   valid; velocity and altitude only in flight. Vertical velocity is that of ALTITUDE, turned into
   the body frame. Sigmas are round figures for this class of sensor, not measured on a drone.
   Returns TVS_ERR_NULL, TVS_ERR_STRUCT_SIZE; TVS_NONE when nothing in the packet serves. */
TV_API tvs_status ardrone_navdata_to_imu(const ardrone_navdata *navdata, double psi0_rad,
                                         tvs_imu *sample);

TV_END_DECLS

#endif
