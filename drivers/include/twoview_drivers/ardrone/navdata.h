/* AR.Drone 2.0: navdata, what the drone says about itself (UDP 5554). Pure: bytes in, structs out; no
   socket, no heap. Field names carry the wire's units; ardrone_navdata_to_imu gives SI.

   A datagram is a header, options (tag, size, data) and a checksum. "Bootstrap" packets have no
   option; "demo" ones come at about 15 Hz, full ones at 200 Hz. Body axes are x forward, y right, z
   down; theta nose up, phi right side down, psi clockwise from above are positive.
   Layouts from Parrot's SDK, open drivers and captured bytes: docs/drivers.md. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_NAVDATA_H
#define TWOVIEW_DRIVERS_ARDRONE_NAVDATA_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* A longer datagram is none of the drone's. */
enum { ARDRONE_NAVDATA_MAX_BYTES = 4096 };

/* Bits of the state word: ardrone_navdata.state. */

#define ARDRONE_STATE_FLYING (UINT32_C(1) << 0) /* in the air; 0: landed */
#define ARDRONE_STATE_VIDEO (UINT32_C(1) << 1) /* video is on */
#define ARDRONE_STATE_VISION (UINT32_C(1) << 2) /* the on-board vision is on */
#define ARDRONE_STATE_RATE_CONTROL (UINT32_C(1) << 3) /* angular rates are controlled; 0: angles */
#define ARDRONE_STATE_ALTITUDE_CONTROL (UINT32_C(1) << 4) /* altitude is controlled */
#define ARDRONE_STATE_START_BUTTON (UINT32_C(1) << 5) /* as it was pressed */
#define ARDRONE_STATE_ACKNOWLEDGE (UINT32_C(1) << 6) /* also set in healthy packets: clear it first */
#define ARDRONE_STATE_CAMERA_READY (UINT32_C(1) << 7) /* the camera is ready */
#define ARDRONE_STATE_TRAVELLING (UINT32_C(1) << 8) /* travelling is on */
#define ARDRONE_STATE_USB_READY (UINT32_C(1) << 9) /* a USB stick is there */
#define ARDRONE_STATE_DEMO (UINT32_C(1) << 10) /* navdata are the short ones */
#define ARDRONE_STATE_BOOTSTRAP (UINT32_C(1) << 11) /* navdata have no options yet */
#define ARDRONE_STATE_MOTOR_PROBLEM (UINT32_C(1) << 12) /* a motor is stuck or does not answer */
#define ARDRONE_STATE_COM_LOST (UINT32_C(1) << 13) /* nothing was heard for 2 s */
#define ARDRONE_STATE_SOFTWARE_FAULT (UINT32_C(1) << 14) /* land as soon as can be */
#define ARDRONE_STATE_BATTERY_LOW (UINT32_C(1) << 15) /* it will land by itself */
#define ARDRONE_STATE_USER_EMERGENCY (UINT32_C(1) << 16) /* an emergency that was asked for */
#define ARDRONE_STATE_TIMER_ELAPSED (UINT32_C(1) << 17) /* a timer ran out */
#define ARDRONE_STATE_MAGNETO_CALIBRATION (UINT32_C(1) << 18) /* the magnetometer is to be calibrated */
#define ARDRONE_STATE_ANGLES_OUT_OF_RANGE (UINT32_C(1) << 19) /* too steep: the motors were cut */
#define ARDRONE_STATE_WIND (UINT32_C(1) << 20) /* too much wind */
#define ARDRONE_STATE_ULTRASOUND_DEAF (UINT32_C(1) << 21) /* no echo is heard */
#define ARDRONE_STATE_CUT_OUT (UINT32_C(1) << 22) /* the motors were cut */
#define ARDRONE_STATE_PIC_VERSION_OK (UINT32_C(1) << 23) /* the sensor board's version is right */
#define ARDRONE_STATE_AT_THREAD (UINT32_C(1) << 24) /* commands are read */
#define ARDRONE_STATE_NAVDATA_THREAD (UINT32_C(1) << 25) /* navdata are sent */
#define ARDRONE_STATE_VIDEO_THREAD (UINT32_C(1) << 26) /* video is sent */
#define ARDRONE_STATE_ACQUISITION_THREAD (UINT32_C(1) << 27) /* sensors are read */
#define ARDRONE_STATE_CONTROL_LATE (UINT32_C(1) << 28) /* the control loop was over 5 ms late */
#define ARDRONE_STATE_ADC_LATE (UINT32_C(1) << 29) /* the sensor board was over 5 ms late */
#define ARDRONE_STATE_COM_WATCHDOG (UINT32_C(1) << 30) /* also set in healthy packets */
#define ARDRONE_STATE_EMERGENCY (UINT32_C(1) << 31) /* the motors are cut until they are re-armed */

/* Tags. Bit `tag` of ardrone_navdata.present and of the key general:navdata_options. */
typedef enum ardrone_tag {
  ARDRONE_TAG_DEMO = 0, /* attitude, height, velocity, battery */
  ARDRONE_TAG_TIME = 1, /* the stamp */
  ARDRONE_TAG_RAW_MEASURES = 2, /* sensors as converted */
  ARDRONE_TAG_PHYS_MEASURES = 3, /* sensors in physical units */
  ARDRONE_TAG_GYROS_OFFSETS = 4, /* the gyroscopes' zeros */
  ARDRONE_TAG_EULER_ANGLES = 5, /* angles of the accelerometer alone */
  ARDRONE_TAG_REFERENCES = 6, /* set points */
  ARDRONE_TAG_TRIMS = 7, /* trims */
  ARDRONE_TAG_RC_REFERENCES = 8, /* what the controller asked for */
  ARDRONE_TAG_PWM = 9, /* motors */
  ARDRONE_TAG_ALTITUDE = 10, /* height */
  ARDRONE_TAG_VISION_RAW = 11, /* translation in the picture */
  ARDRONE_TAG_VISION_FLOW = 12, /* optical flow */
  ARDRONE_TAG_VISION = 13, /* the on-board vision's velocity */
  ARDRONE_TAG_VISION_PERF = 14, /* its times */
  ARDRONE_TAG_TRACKERS = 15, /* its points */
  ARDRONE_TAG_VISION_DETECT = 16, /* tags and shells seen */
  ARDRONE_TAG_WATCHDOG = 17, /* a counter */
  ARDRONE_TAG_ADC_DATA = 18, /* the sensor board's bytes */
  ARDRONE_TAG_VIDEO_STREAM = 19, /* the live stream */
  ARDRONE_TAG_GAMES = 20, /* what was counted in games */
  ARDRONE_TAG_PRESSURE = 21, /* barometer */
  ARDRONE_TAG_MAGNETO = 22, /* magnetometer */
  ARDRONE_TAG_WIND = 23, /* wind and its estimator */
  ARDRONE_TAG_KALMAN_PRESSURE = 24, /* the height's estimator */
  ARDRONE_TAG_HD_VIDEO = 25, /* the recording stream */
  ARDRONE_TAG_WIFI = 26, /* the radio link */
  ARDRONE_TAG_GPS = 27, /* three layouts, told apart by size: ardrone_gps_form */
  ARDRONE_NUM_TAGS = 28, /* how many there are */
  ARDRONE_TAG_CHECKSUM = 0xffff /* the last one: the sum of all bytes before it */
} ardrone_tag;
/* 1 when the packet has the option of this tag. */
#define ARDRONE_HAS(navdata, TAG) (((navdata)->present >> (TAG)) & 1u)

/* Major part (upper 16 bits) of ctrl_state; 3 and 7 both mean flying. */
typedef enum ardrone_control_state {
  ARDRONE_CONTROL_DEFAULT,    /* none yet */
  ARDRONE_CONTROL_INIT,       /* starting up */
  ARDRONE_CONTROL_LANDED,     /* motors off */
  ARDRONE_CONTROL_FLYING,     /* under command */
  ARDRONE_CONTROL_HOVERING,   /* holds its place */
  ARDRONE_CONTROL_TEST,       /* a self-test */
  ARDRONE_CONTROL_TAKING_OFF, /* until it hovers */
  ARDRONE_CONTROL_GO_TO_FIX,  /* flies to a place; counts as flying */
  ARDRONE_CONTROL_LANDING,    /* until the motors are off */
  ARDRONE_CONTROL_LOOPING     /* a flip */
} ardrone_control_state;

/* Options, fields in the order of the wire, with the names that Parrot's headers give them, clearer. Where a
   comment says "raw" or "unit not documented", those headers say no more either. */

/* ARDRONE_TAG_DEMO. */
typedef struct ardrone_demo {
  uint32_t ctrl_state, battery_percent; /* upper 16 bits: an ardrone_control_state; [0, 100] */
  float theta_mdeg, phi_mdeg, psi_mdeg; /* nose up, right side down, clockwise from above; 0.001 degrees */
  int32_t altitude_mm;          /* 0 on the ground */
  float velocity_mm_s[3];       /* body; z is always 0 on this drone: altitude.vz_mm_s instead */
  uint32_t num_frames;          /* of the on-board vision */
  float detection_rotation[9], detection_translation[3]; /* of a tag in the camera's frame; unit not documented */
  uint32_t detection_tag, detection_type; /* which tag, which detector */
  float camera_rotation[9], camera_translation[3]; /* of the camera in the body; unit not documented, often 0 */
} ardrone_demo;

/* ARDRONE_TAG_TIME. */
typedef struct ardrone_time {
  uint32_t stamp; /* 11 bits of s, 21 of us: wraps at 2048 s */
} ardrone_time;

/* ARDRONE_TAG_RAW_MEASURES. */
typedef struct ardrone_raw_measures {
  uint16_t accelerometer[3];  /* raw, as converted */
  int16_t gyro[3], gyro_110[2]; /* raw; the second ones of the range of 110 degrees a second */
  uint32_t battery_mv;        /* millivolts */
  uint16_t echo_start, echo_end, echo_association, echo_distance, curve_time, curve_value, curve_ref,
      echo_flag, num_echoes;  /* the ultrasound's echoes, raw */
  uint32_t sum_echo;          /* raw */
  int32_t altitude_mm;        /* ultrasound */
  int16_t gradient;           /* raw */
} ardrone_raw_measures;

/* ARDRONE_TAG_PHYS_MEASURES. */
typedef struct ardrone_phys_measures {
  float accelerometer_celsius; /* the sensor's temperature */
  uint16_t gyro_temperature;   /* raw */
  float acceleration_mg[3], rate_deg_s[3]; /* body; at rest z is -1000 mg */
  uint32_t supply_3v3, vref_epson, vref_idg; /* voltages, raw */
} ardrone_phys_measures;

/* ARDRONE_TAG_GYROS_OFFSETS. */
typedef struct ardrone_gyros_offsets {
  float offset[3]; /* what the gyroscopes say at rest, raw units */
} ardrone_gyros_offsets;

/* ARDRONE_TAG_EULER_ANGLES. */
typedef struct ardrone_euler_angles {
  float theta_mdeg, phi_mdeg; /* of the accelerometer alone, 0.001 degrees */
} ardrone_euler_angles;

/* ARDRONE_TAG_REFERENCES: the control loops' set points. */
typedef struct ardrone_references {
  int32_t theta, phi, theta_i, phi_i, pitch, roll, yaw, psi; /* angles and integrals, raw */
  float vx, vy, theta_mod, phi_mod, k_vx, k_vy; /* velocities, corrections and gains; units not documented */
  uint32_t k_mode; /* which gains */
  float ui_time, ui_theta, ui_phi, ui_psi, ui_psi_accuracy; /* the controller's wish; units not documented */
  int32_t ui_sequence; /* the number of the command that it came by */
} ardrone_references;

/* ARDRONE_TAG_TRIMS. */
typedef struct ardrone_trims {
  float yaw_rate, theta, phi; /* of the flat trim; units not documented */
} ardrone_trims;

/* ARDRONE_TAG_RC_REFERENCES. */
typedef struct ardrone_rc_references {
  int32_t pitch, roll, yaw, climb, ag; /* as the controller sent them, raw */
} ardrone_rc_references;

/* ARDRONE_TAG_PWM. */
typedef struct ardrone_pwm {
  uint8_t motor[4], saturated[4]; /* [0, 255]: each motor; the same after saturation */
  float climb_feed_forward, climb_altitude, altitude_integral, vz_ref; /* parts of the throttle; units not documented */
  int32_t pitch, roll, yaw; /* parts of the motors' sum, raw */
  float yaw_integral; /* unit not documented */
  int32_t pitch_planned, roll_planned, yaw_planned; /* before saturation, raw */
  float climb_planned; /* unit not documented */
  uint16_t current[4]; /* of each motor, raw */
  float altitude_proportional, altitude_derivative; /* parts of the throttle; units not documented */
} ardrone_pwm;

/* ARDRONE_TAG_ALTITUDE. */
typedef struct ardrone_altitude {
  int32_t vision_mm; /* the fused height */
  float vz_mm_s; /* up is positive */
  int32_t reference_mm, raw_mm; /* the set point; raw: ultrasound, not 0 on the ground */
  float observed_accel_z, observed_altitude, observed_x[3]; /* the observer's state; units m and s */
  uint32_t observed_state; /* its mode */
  float estimated_v[2]; /* units m and s */
  uint32_t estimated_state; /* its mode */
} ardrone_altitude;

/* ARDRONE_TAG_VISION_RAW. */
typedef struct ardrone_vision_raw {
  float translation[3]; /* of the picture between two frames; unit not documented */
} ardrone_vision_raw;

/* ARDRONE_TAG_VISION_FLOW. */
typedef struct ardrone_vision_flow {
  float dx[5], dy[5]; /* pixels, in five parts of the picture */
} ardrone_vision_flow;

/* ARDRONE_TAG_VISION. */
typedef struct ardrone_vision {
  uint32_t state; /* its mode */
  int32_t misc;   /* raw */
  float phi_trim, phi_reference, theta_trim, theta_reference; /* units not documented */
  int32_t new_picture; /* 1: this packet is of a new one */
  float theta_rad, phi_rad, psi_rad; /* at the capture of the on-board vision's picture */
  int32_t altitude_mm; /* at the capture */
  uint32_t capture_ms; /* milliseconds of the same clock as time.stamp */
  float velocity_mm_s[3], delta_phi, delta_theta, delta_psi; /* body; turns since the picture before, radians */
  uint32_t gold_defined, gold_reset; /* a place to hold: there is one; it was set anew */
  float gold_x, gold_y; /* where it is; unit not documented */
} ardrone_vision;

/* ARDRONE_TAG_VISION_PERF. */
typedef struct ardrone_vision_perf {
  float size, corners, compute, tracking, translation, update, custom[20]; /* times; unit not documented */
} ardrone_vision_perf;

/* ARDRONE_TAG_TRACKERS. */
typedef struct ardrone_trackers {
  int32_t locked[30], points[60]; /* of 5 x 6 trackers: 1 when locked; x y, pixels */
} ardrone_trackers;

/* ARDRONE_TAG_VISION_DETECT: up to four tags. */
typedef struct ardrone_vision_detect {
  uint32_t count, type[4], x[4], y[4], width[4], height[4]; /* how many; which; places in 0..1000 of the picture */
  uint32_t distance_cm[4]; /* from the camera */
  float orientation_deg[4], rotation[36], translation[12]; /* in the picture; 3x3 and 3 each, unit not documented */
  uint32_t camera[4]; /* which camera saw it */
} ardrone_vision_detect;

/* ARDRONE_TAG_WATCHDOG. */
typedef struct ardrone_watchdog {
  int32_t value; /* counts */
} ardrone_watchdog;

/* ARDRONE_TAG_ADC_DATA. */
typedef struct ardrone_adc_data {
  uint32_t version; /* of the sensor board */
  uint8_t data[32]; /* its packet */
} ardrone_adc_data;

/* ARDRONE_TAG_VIDEO_STREAM. */
typedef struct ardrone_video_stream {
  uint8_t quantiser; /* of the picture */
  uint32_t frame_size, frame_number, at_sequence, at_mean_gap_ms; /* bytes; its number; of the commands: the last
                                                                     number, the mean time between two */
  float at_gap_variance; /* of that time; unit not documented */
  uint32_t at_quality, bitrate, desired_bitrate; /* of the link, raw; units not documented */
  int32_t data[5]; /* raw */
  uint32_t tcp_queue, fifo_queue; /* what waits to be sent, raw */
} ardrone_video_stream;

/* ARDRONE_TAG_GAMES. */
typedef struct ardrone_games {
  uint32_t double_taps, finish_lines; /* how many */
} ardrone_games;

/* ARDRONE_TAG_PRESSURE. */
typedef struct ardrone_pressure {
  int32_t up; /* the barometer's raw pressure */
  int16_t ut; /* and temperature */
  int32_t temperature_dc, pressure_pa; /* 0.1 degrees Celsius; Pa */
} ardrone_pressure;

/* ARDRONE_TAG_MAGNETO. */
typedef struct ardrone_magneto {
  int16_t raw[3]; /* as converted */
  float field_mg[3], rectified[3], offset[3]; /* milligauss, body */
  float heading_deg, heading_gyro_deg, heading_fusion_deg; /* by the magnetometer, the gyroscope, both */
  uint8_t calibrated; /* 1: yes */
  uint32_t state; /* its mode */
  float radius, error_mean, error_variance; /* of the calibration's sphere; units not documented */
} ardrone_magneto;

/* ARDRONE_TAG_WIND. */
typedef struct ardrone_wind {
  float speed_m_s, angle, theta_rad, phi_rad, state[6], debug[3]; /* the wind, its direction in radians; the angles
                                                                     that hold against it; the estimator's own */
} ardrone_wind;

/* ARDRONE_TAG_KALMAN_PRESSURE: the height's estimator. */
typedef struct ardrone_kalman_pressure {
  float offset_pa, z, vz, bias_pwm, bias_pressure, offset_ultrasound, prediction_ultrasound,
      variance_altitude, variance_pwm, variance_speed; /* its state and variances; units not documented */
  uint32_t ground_effect; /* 1: near the ground */
  float innovation_sum; /* unit not documented */
  uint32_t rejects_ultrasound; /* how many echoes were not believed */
  float multisinus, climb_altitude; /* units not documented */
  uint32_t multisinus_flag, multisinus_start; /* of an identification flight */
} ardrone_kalman_pressure;

/* ARDRONE_TAG_HD_VIDEO: the recording stream. */
typedef struct ardrone_hd_video {
  uint32_t state, fifo_packets, fifo_size, usb_size_kb, usb_free_kb, frame_number, remaining_s; /* what waits,
      packets and bytes; the stick's size and room; the last picture; how long the room will do */
} ardrone_hd_video;

/* ARDRONE_TAG_WIFI. */
typedef struct ardrone_wifi {
  uint32_t link_quality; /* the drone's own measure, raw */
} ardrone_wifi;

/* ARDRONE_TAG_GPS of firmware 2.4.8; of 2.4.7's only the first four are known. */
typedef struct ardrone_gps {
  double latitude_deg, longitude_deg, elevation_m, hdop; /* WGS 84; dilution of precision, a factor */
  uint32_t data_available, zero_validated, waypoint_validated; /* 1: yes */
  double latitude0, longitude0, latitude_fused, longitude_fused; /* degrees: of the start, and with the IMU */
  uint32_t state; /* of the receiver */
  float x_trajectory, x_reference, y_trajectory, y_reference, theta_p, phi_p, theta_i, phi_i,
      theta_d, phi_d; /* of the flight to a waypoint and its control loop; units not documented */
  double vdop, pdop; /* dilution of precision, a factor each */
  float speed; /* over ground; unit m/s by the look of it */
  uint32_t last_frame_stamp; /* of the receiver's last answer */
  float degree, degree_magnetic, ehpe, ehve, c_n0; /* course, degrees; errors, m and m/s; signal to noise, dB Hz: units
                                                      by the look of them */
  uint32_t num_satellites; /* in use */
  uint8_t channels[24]; /* 12 times satellite, signal */
  uint32_t plugged, ephemeris; /* 1: the receiver is there; has its ephemeris */
  float vx_trajectory, vy_trajectory; /* units not documented */
  uint32_t firmware; /* of the receiver */
} ardrone_gps;

/* ARDRONE_TAG_GPS of firmware of 2012, which was no GPS. */
typedef struct ardrone_zimmu {
  int32_t vz_lsb; /* raw */
  float vz; /* vertical speed, unit not documented */
} ardrone_zimmu;

/* Which layout tag 27 had. */
typedef enum ardrone_gps_form {
  ARDRONE_GPS_NONE = 0,  /* there was no such option */
  ARDRONE_GPS_ZIMMU = 1, /* 12 bytes, firmware of 2012: `zimmu` */
  ARDRONE_GPS_247 = 2,   /* 480 bytes: `gps`, its first four fields, which may be garbage */
  ARDRONE_GPS_248 = 3    /* 216 bytes: `gps` */
} ardrone_gps_form;

/* One packet. An option that is not in `present` is zeros. */
typedef struct ardrone_navdata {
  uint32_t magic, state, sequence, vision_defined, checksum; /* 0x55667788; ARDRONE_STATE_ bits; the packet's number; 1:
                                                                 the on-board vision runs; as it was sent */
  uint32_t present;     /* bit per ardrone_tag that was there, whole */
  uint32_t num_unknown; /* options of a tag or a size that nobody knows, or there twice: passed over */
  uint32_t num_short;   /* options shorter than this firmware's: passed over */
  ardrone_gps_form gps_form; /* which of gps and zimmu ARDRONE_TAG_GPS filled */
  ardrone_demo demo; /* ARDRONE_TAG_DEMO */
  ardrone_time time; /* ARDRONE_TAG_TIME */
  ardrone_raw_measures raw_measures; /* ARDRONE_TAG_RAW_MEASURES */
  ardrone_phys_measures phys_measures; /* ARDRONE_TAG_PHYS_MEASURES */
  ardrone_gyros_offsets gyros_offsets; /* ARDRONE_TAG_GYROS_OFFSETS */
  ardrone_euler_angles euler_angles; /* ARDRONE_TAG_EULER_ANGLES */
  ardrone_references references; /* ARDRONE_TAG_REFERENCES */
  ardrone_trims trims; /* ARDRONE_TAG_TRIMS */
  ardrone_rc_references rc_references; /* ARDRONE_TAG_RC_REFERENCES */
  ardrone_pwm pwm; /* ARDRONE_TAG_PWM */
  ardrone_altitude altitude; /* ARDRONE_TAG_ALTITUDE */
  ardrone_vision_raw vision_raw; /* ARDRONE_TAG_VISION_RAW */
  ardrone_vision_flow vision_flow; /* ARDRONE_TAG_VISION_FLOW */
  ardrone_vision vision; /* ARDRONE_TAG_VISION */
  ardrone_vision_perf vision_perf; /* ARDRONE_TAG_VISION_PERF */
  ardrone_trackers trackers; /* ARDRONE_TAG_TRACKERS */
  ardrone_vision_detect vision_detect; /* ARDRONE_TAG_VISION_DETECT */
  ardrone_watchdog watchdog; /* ARDRONE_TAG_WATCHDOG */
  ardrone_adc_data adc_data; /* ARDRONE_TAG_ADC_DATA */
  ardrone_video_stream video_stream; /* ARDRONE_TAG_VIDEO_STREAM */
  ardrone_games games; /* ARDRONE_TAG_GAMES */
  ardrone_pressure pressure; /* ARDRONE_TAG_PRESSURE */
  ardrone_magneto magneto; /* ARDRONE_TAG_MAGNETO */
  ardrone_wind wind; /* ARDRONE_TAG_WIND */
  ardrone_kalman_pressure kalman_pressure; /* ARDRONE_TAG_KALMAN_PRESSURE */
  ardrone_hd_video hd_video; /* ARDRONE_TAG_HD_VIDEO */
  ardrone_wifi wifi; /* ARDRONE_TAG_WIFI */
  ardrone_gps gps; /* ARDRONE_TAG_GPS, the other two forms */
  ardrone_zimmu zimmu; /* ARDRONE_TAG_GPS, ARDRONE_GPS_ZIMMU */
} ardrone_navdata;

/* Decodes one datagram. All of it is checked before any of it is used: on an error *navdata is as it
   was. Options longer than known (newer firmware) give what is known of them.
   Returns TVS_ERR_NULL; TVS_ERR_DATA: no navdata (magic), truncated, an option of size 0 to 3 or
   beyond the end, no checksum option at the end; TVS_ERR_CHECKSUM.
   Reads no byte outside [bytes, bytes + size). About 1 us for a full packet. */
TV_API tvs_status ardrone_navdata_decode(const uint8_t *bytes, size_t size,
                                         ardrone_navdata *navdata);

/* Which packets are news. UDP loses, doubles and reorders; drones start again. Start with zeros. Private but
   for `has_last`. */
typedef struct ardrone_sequence {
  uint32_t last;
  int has_last, was_bootstrap;
  uint32_t late_last;
  int num_late;
} ardrone_sequence;

/* What ardrone_sequence_check says of a packet. */
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

/* After this long the drone's stamp starts again. */
#define ARDRONE_TIME_PERIOD_NS INT64_C(2048000000000)
/* The drone's stamp as nanoseconds in [0, ARDRONE_TIME_PERIOD_NS). */
TV_API int64_t ardrone_time_ns(ardrone_time time);

/* *sample: the packet in SI units and the frames of source.h, without its time. psi0_rad is the yaw at the start,
   which becomes 0. Fields whose numbers are no possible measurement (a garbled option, NaN) are not
   valid; velocity and altitude only in flight. Vertical velocity is that of ALTITUDE, turned into
   the body frame. Sigmas are round figures for this class of sensor, not measured on a drone.
   Returns TVS_ERR_NULL, TVS_ERR_STRUCT_SIZE; TVS_NONE when nothing in the packet serves. */
TV_API tvs_status ardrone_navdata_to_imu(const ardrone_navdata *navdata, double psi0_rad,
                                         tvs_imu *sample);

TV_END_DECLS

#endif
