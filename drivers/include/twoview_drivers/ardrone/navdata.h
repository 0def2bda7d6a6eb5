/* AR.Drone 2.0: navdata, the drone's report of its state (UDP 5554). It reads bytes into structs
   and uses no socket and no heap. Field names carry the wire's units; ardrone_navdata_to_imu gives
   SI.

   A datagram is a header, options (tag, size, data) and a checksum. "Bootstrap" packets have no
   option; "demo" ones come at about 15 Hz, full ones at 200 Hz. Body axes are x forward, y right, z
   down; positive are theta with the nose up, phi with the right side down, and psi clockwise
   from above.
   Layouts from Parrot's SDK, open drivers and captured bytes: docs/drivers.md. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_NAVDATA_H
#define TWOVIEW_DRIVERS_ARDRONE_NAVDATA_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* The drone sends no longer datagram. */
enum { ARDRONE_NAVDATA_MAX_BYTES = 4096 };

/* Bits of the state word: ardrone_navdata.state. */

/* In the air; 0: landed. */
#define ARDRONE_STATE_FLYING (UINT32_C(1) << 0)
/* Video is on. */
#define ARDRONE_STATE_VIDEO (UINT32_C(1) << 1)
/* The on-board vision is on. */
#define ARDRONE_STATE_VISION (UINT32_C(1) << 2)
/* Angular rates are controlled; 0: angles. */
#define ARDRONE_STATE_RATE_CONTROL (UINT32_C(1) << 3)
/* Altitude is controlled. */
#define ARDRONE_STATE_ALTITUDE_CONTROL (UINT32_C(1) << 4)
/* The start button was pressed. */
#define ARDRONE_STATE_START_BUTTON (UINT32_C(1) << 5)
/* A command was acknowledged. The bit is set without a command, too: clear it before a
   handshake. */
#define ARDRONE_STATE_ACKNOWLEDGE (UINT32_C(1) << 6)
/* The camera is ready. */
#define ARDRONE_STATE_CAMERA_READY (UINT32_C(1) << 7)
/* Travelling is on. */
#define ARDRONE_STATE_TRAVELLING (UINT32_C(1) << 8)
/* A USB stick is there. */
#define ARDRONE_STATE_USB_READY (UINT32_C(1) << 9)
/* Navdata has the short form. */
#define ARDRONE_STATE_DEMO (UINT32_C(1) << 10)
/* Navdata has no options yet. */
#define ARDRONE_STATE_BOOTSTRAP (UINT32_C(1) << 11)
/* A motor is stuck or does not answer. */
#define ARDRONE_STATE_MOTOR_PROBLEM (UINT32_C(1) << 12)
/* The drone received nothing for 2 s. */
#define ARDRONE_STATE_COM_LOST (UINT32_C(1) << 13)
/* A software fault: land as soon as possible. */
#define ARDRONE_STATE_SOFTWARE_FAULT (UINT32_C(1) << 14)
/* The battery is low: the drone will land by itself. */
#define ARDRONE_STATE_BATTERY_LOW (UINT32_C(1) << 15)
/* The emergency was requested by a command. */
#define ARDRONE_STATE_USER_EMERGENCY (UINT32_C(1) << 16)
/* A timer ran out. */
#define ARDRONE_STATE_TIMER_ELAPSED (UINT32_C(1) << 17)
/* The magnetometer is to be calibrated. */
#define ARDRONE_STATE_MAGNETO_CALIBRATION (UINT32_C(1) << 18)
/* An angle was too large: the motors were cut. */
#define ARDRONE_STATE_ANGLES_OUT_OF_RANGE (UINT32_C(1) << 19)
/* Too much wind. */
#define ARDRONE_STATE_WIND (UINT32_C(1) << 20)
/* The ultrasound receives no echo. */
#define ARDRONE_STATE_ULTRASOUND_DEAF (UINT32_C(1) << 21)
/* The motors were cut. */
#define ARDRONE_STATE_CUT_OUT (UINT32_C(1) << 22)
/* The sensor board's version is right. */
#define ARDRONE_STATE_PIC_VERSION_OK (UINT32_C(1) << 23)
/* Commands are read. */
#define ARDRONE_STATE_AT_THREAD (UINT32_C(1) << 24)
/* Navdata are sent. */
#define ARDRONE_STATE_NAVDATA_THREAD (UINT32_C(1) << 25)
/* Video is sent. */
#define ARDRONE_STATE_VIDEO_THREAD (UINT32_C(1) << 26)
/* Sensors are read. */
#define ARDRONE_STATE_ACQUISITION_THREAD (UINT32_C(1) << 27)
/* The control loop was over 5 ms late. */
#define ARDRONE_STATE_CONTROL_LATE (UINT32_C(1) << 28)
/* The sensor board was over 5 ms late. */
#define ARDRONE_STATE_ADC_LATE (UINT32_C(1) << 29)
/* No command came for 50 ms. The bit is set at times on a good link, too. */
#define ARDRONE_STATE_COM_WATCHDOG (UINT32_C(1) << 30)
/* The motors are cut until they are re-armed. */
#define ARDRONE_STATE_EMERGENCY (UINT32_C(1) << 31)

/* Tags. Bit `tag` of ardrone_navdata.present and of the key general:navdata_options. */
typedef enum ardrone_tag {
  /* Attitude, height, velocity, battery. */
  ARDRONE_TAG_DEMO = 0,
  /* The time stamp. */
  ARDRONE_TAG_TIME = 1,
  /* Sensors as converted. */
  ARDRONE_TAG_RAW_MEASURES = 2,
  /* Sensors in physical units. */
  ARDRONE_TAG_PHYS_MEASURES = 3,
  /* The gyroscopes' zeros. */
  ARDRONE_TAG_GYROS_OFFSETS = 4,
  /* Angles of the accelerometer alone. */
  ARDRONE_TAG_EULER_ANGLES = 5,
  /* Set points. */
  ARDRONE_TAG_REFERENCES = 6,
  /* Trims. */
  ARDRONE_TAG_TRIMS = 7,
  /* What the controller requested. */
  ARDRONE_TAG_RC_REFERENCES = 8,
  /* Motors. */
  ARDRONE_TAG_PWM = 9,
  /* Height. */
  ARDRONE_TAG_ALTITUDE = 10,
  /* Translation in the picture. */
  ARDRONE_TAG_VISION_RAW = 11,
  /* Optical flow. */
  ARDRONE_TAG_VISION_FLOW = 12,
  /* The on-board vision's velocity. */
  ARDRONE_TAG_VISION = 13,
  /* The on-board vision's computing times. */
  ARDRONE_TAG_VISION_PERF = 14,
  /* The on-board vision's tracked points. */
  ARDRONE_TAG_TRACKERS = 15,
  /* Tags and shells seen. */
  ARDRONE_TAG_VISION_DETECT = 16,
  /* A counter. */
  ARDRONE_TAG_WATCHDOG = 17,
  /* The sensor board's bytes. */
  ARDRONE_TAG_ADC_DATA = 18,
  /* The live stream. */
  ARDRONE_TAG_VIDEO_STREAM = 19,
  /* Counters of games. */
  ARDRONE_TAG_GAMES = 20,
  /* Barometer. */
  ARDRONE_TAG_PRESSURE = 21,
  /* Magnetometer. */
  ARDRONE_TAG_MAGNETO = 22,
  /* Wind and its estimator. */
  ARDRONE_TAG_WIND = 23,
  /* The height's estimator. */
  ARDRONE_TAG_KALMAN_PRESSURE = 24,
  /* The recording stream. */
  ARDRONE_TAG_HD_VIDEO = 25,
  /* The radio link. */
  ARDRONE_TAG_WIFI = 26,
  /* One of three layouts, which differ in size: ardrone_gps_form. */
  ARDRONE_TAG_GPS = 27,
  /* How many there are. */
  ARDRONE_NUM_TAGS = 28,
  /* The last one: the sum of all bytes before it. */
  ARDRONE_TAG_CHECKSUM = 0xffff
} ardrone_tag;
/* 1 when the packet has the option of this tag. */
#define ARDRONE_HAS(navdata, TAG) (((navdata)->present >> (TAG)) & 1u)

/* Major part (upper 16 bits) of ctrl_state; 3 and 7 both mean flying. */
typedef enum ardrone_control_state {
  /* None yet. */
  ARDRONE_CONTROL_DEFAULT,
  /* Starting up. */
  ARDRONE_CONTROL_INIT,
  /* Motors off. */
  ARDRONE_CONTROL_LANDED,
  /* Under command. */
  ARDRONE_CONTROL_FLYING,
  /* Holds its place. */
  ARDRONE_CONTROL_HOVERING,
  /* A self-test. */
  ARDRONE_CONTROL_TEST,
  /* Until it hovers. */
  ARDRONE_CONTROL_TAKING_OFF,
  /* Flies to a place; counts as flying. */
  ARDRONE_CONTROL_GO_TO_FIX,
  /* Until the motors are off. */
  ARDRONE_CONTROL_LANDING,
  /* A flip. */
  ARDRONE_CONTROL_LOOPING
} ardrone_control_state;

/* The options. Fields are in the order of the wire, with the names of Parrot's headers made
   clearer. "Raw" and "unit not documented" mean that those headers do not say more. */

/* ARDRONE_TAG_DEMO. */
typedef struct ardrone_demo {
  /* The upper 16 bits of ctrl_state are an ardrone_control_state. battery_percent is in [0,
     100]. */
  uint32_t ctrl_state, battery_percent;
  /* Pitch (nose up), roll (right side down) and yaw (clockwise from above), 0.001 degrees. */
  float theta_mdeg, phi_mdeg, psi_mdeg;
  /* 0 on the ground. */
  int32_t altitude_mm;
  /* Along the body's axes. z is always 0 on this drone; ardrone_altitude has the vertical speed. */
  float velocity_mm_s[3];
  /* Of the on-board vision. */
  uint32_t num_frames;
  /* Of a tag in the camera's frame; its unit is not documented. */
  float detection_rotation[9], detection_translation[3];
  /* Which tag, which detector. */
  uint32_t detection_tag, detection_type;
  /* Of the camera in the body; unit not documented, often 0. */
  float camera_rotation[9], camera_translation[3];
} ardrone_demo;

/* ARDRONE_TAG_TIME. */
typedef struct ardrone_time {
  /* 11 bits of s, 21 of us: wraps at 2048 s. */
  uint32_t stamp;
} ardrone_time;

/* ARDRONE_TAG_RAW_MEASURES. */
typedef struct ardrone_raw_measures {
  /* Raw, as converted. */
  uint16_t accelerometer[3];
  /* Raw; gyro_110 has a range of 110 degrees a second. */
  int16_t gyro[3], gyro_110[2];
  /* Millivolts. */
  uint32_t battery_mv;
  /* The ultrasound's echoes, raw. */
  uint16_t echo_start, echo_end, echo_association, echo_distance, curve_time, curve_value,
      curve_ref, echo_flag, num_echoes;
  /* Raw. */
  uint32_t sum_echo;
  /* Ultrasound. */
  int32_t altitude_mm;
  /* Raw. */
  int16_t gradient;
} ardrone_raw_measures;

/* ARDRONE_TAG_PHYS_MEASURES. */
typedef struct ardrone_phys_measures {
  /* The sensor's temperature. */
  float accelerometer_celsius;
  /* Raw. */
  uint16_t gyro_temperature;
  /* Body; at rest z is -1000 mg. */
  float acceleration_mg[3], rate_deg_s[3];
  /* Voltages, raw. */
  uint32_t supply_3v3, vref_epson, vref_idg;
} ardrone_phys_measures;

/* ARDRONE_TAG_GYROS_OFFSETS. */
typedef struct ardrone_gyros_offsets {
  /* The gyroscopes' readings at rest, raw units. */
  float offset[3];
} ardrone_gyros_offsets;

/* ARDRONE_TAG_EULER_ANGLES. */
typedef struct ardrone_euler_angles {
  /* Of the accelerometer alone, 0.001 degrees. */
  float theta_mdeg, phi_mdeg;
} ardrone_euler_angles;

/* ARDRONE_TAG_REFERENCES: the control loops' set points. */
typedef struct ardrone_references {
  /* Angles and integrals, raw. */
  int32_t theta, phi, theta_i, phi_i, pitch, roll, yaw, psi;
  /* Velocities, corrections and gains; their units are not documented. */
  float vx, vy, theta_mod, phi_mod, k_vx, k_vy;
  /* Which gains. */
  uint32_t k_mode;
  /* What a command of the controller requests; the units are not documented. */
  float ui_time, ui_theta, ui_phi, ui_psi, ui_psi_accuracy;
  /* The sequence number of that command. */
  int32_t ui_sequence;
} ardrone_references;

/* ARDRONE_TAG_TRIMS. */
typedef struct ardrone_trims {
  /* Of the flat trim; their units are not documented. */
  float yaw_rate, theta, phi;
} ardrone_trims;

/* ARDRONE_TAG_RC_REFERENCES. */
typedef struct ardrone_rc_references {
  /* As the controller sent them, raw. */
  int32_t pitch, roll, yaw, climb, ag;
} ardrone_rc_references;

/* ARDRONE_TAG_PWM. */
typedef struct ardrone_pwm {
  /* [0, 255]: each motor; the same after saturation. */
  uint8_t motor[4], saturated[4];
  /* Parts of the throttle; their units are not documented. */
  float climb_feed_forward, climb_altitude, altitude_integral, vz_ref;
  /* Parts of the motors' sum, raw. */
  int32_t pitch, roll, yaw;
  /* Its unit is not documented. */
  float yaw_integral;
  /* Before saturation, raw. */
  int32_t pitch_planned, roll_planned, yaw_planned;
  /* Its unit is not documented. */
  float climb_planned;
  /* Of each motor, raw. */
  uint16_t current[4];
  /* Parts of the throttle; their units are not documented. */
  float altitude_proportional, altitude_derivative;
} ardrone_pwm;

/* ARDRONE_TAG_ALTITUDE. */
typedef struct ardrone_altitude {
  /* The fused height. */
  int32_t vision_mm;
  /* Up is positive. */
  float vz_mm_s;
  /* The set point; raw: ultrasound, not 0 on the ground. */
  int32_t reference_mm, raw_mm;
  /* The observer's state; units m and s. */
  float observed_accel_z, observed_altitude, observed_x[3];
  /* The observer's mode, raw. */
  uint32_t observed_state;
  /* Its units are m and s. */
  float estimated_v[2];
  /* The velocity estimator's mode, raw. */
  uint32_t estimated_state;
} ardrone_altitude;

/* ARDRONE_TAG_VISION_RAW. */
typedef struct ardrone_vision_raw {
  /* Of the picture between two frames; its unit is not documented. */
  float translation[3];
} ardrone_vision_raw;

/* ARDRONE_TAG_VISION_FLOW. */
typedef struct ardrone_vision_flow {
  /* Motion in five parts of the picture, pixels. */
  float dx[5], dy[5];
} ardrone_vision_flow;

/* ARDRONE_TAG_VISION. */
typedef struct ardrone_vision {
  /* The on-board vision's mode, raw. */
  uint32_t state;
  /* Raw. */
  int32_t misc;
  /* Their units are not documented. */
  float phi_trim, phi_reference, theta_trim, theta_reference;
  /* 1: this packet belongs to a new picture. */
  int32_t new_picture;
  /* At the capture of the on-board vision's picture. */
  float theta_rad, phi_rad, psi_rad;
  /* At the capture. */
  int32_t altitude_mm;
  /* Milliseconds of the same clock as time.stamp. */
  uint32_t capture_ms;
  /* Body; turns since the picture before, radians. */
  float velocity_mm_s[3], delta_phi, delta_theta, delta_psi;
  /* The place to hold: whether there is one; whether it was set anew. */
  uint32_t gold_defined, gold_reset;
  /* The position of the place to hold; its unit is not documented. */
  float gold_x, gold_y;
} ardrone_vision;

/* ARDRONE_TAG_VISION_PERF. */
typedef struct ardrone_vision_perf {
  /* Times; their unit is not documented. */
  float size, corners, compute, tracking, translation, update, custom[20];
} ardrone_vision_perf;

/* ARDRONE_TAG_TRACKERS. */
typedef struct ardrone_trackers {
  /* Of 5 x 6 trackers: 1 when locked; x y, pixels. */
  int32_t locked[30], points[60];
} ardrone_trackers;

/* ARDRONE_TAG_VISION_DETECT: up to four tags. */
typedef struct ardrone_vision_detect {
  /* How many; which; places in 0..1000 of the picture. */
  uint32_t count, type[4], x[4], y[4], width[4], height[4];
  /* From the camera. */
  uint32_t distance_cm[4];
  /* In the picture; 3x3 and 3 each; its unit is not documented. */
  float orientation_deg[4], rotation[36], translation[12];
  /* Which camera saw it. */
  uint32_t camera[4];
} ardrone_vision_detect;

/* ARDRONE_TAG_WATCHDOG. */
typedef struct ardrone_watchdog {
  /* Counts. */
  int32_t value;
} ardrone_watchdog;

/* ARDRONE_TAG_ADC_DATA. */
typedef struct ardrone_adc_data {
  /* Of the sensor board. */
  uint32_t version;
  /* Its packet. */
  uint8_t data[32];
} ardrone_adc_data;

/* ARDRONE_TAG_VIDEO_STREAM. */
typedef struct ardrone_video_stream {
  /* Of the picture. */
  uint8_t quantiser;
  /* Bytes of the picture; its number; the last command's number; the mean time between two
     commands. */
  uint32_t frame_size, frame_number, at_sequence, at_mean_gap_ms;
  /* The variance of the time between two commands; its unit is not documented. */
  float at_gap_variance;
  /* Of the link, raw; their units are not documented. */
  uint32_t at_quality, bitrate, desired_bitrate;
  /* Raw. */
  int32_t data[5];
  /* How much waits to be sent, raw. */
  uint32_t tcp_queue, fifo_queue;
} ardrone_video_stream;

/* ARDRONE_TAG_GAMES. */
typedef struct ardrone_games {
  /* How many. */
  uint32_t double_taps, finish_lines;
} ardrone_games;

/* ARDRONE_TAG_PRESSURE. */
typedef struct ardrone_pressure {
  /* The barometer's raw pressure. */
  int32_t up;
  /* The barometer's raw temperature. */
  int16_t ut;
  /* 0.1 degrees Celsius; Pa. */
  int32_t temperature_dc, pressure_pa;
} ardrone_pressure;

/* ARDRONE_TAG_MAGNETO. */
typedef struct ardrone_magneto {
  /* As converted. */
  int16_t raw[3];
  /* Along the body's axes, in milligauss: the field, the rectified field, the offset. */
  float field_mg[3], rectified[3], offset[3];
  /* By the magnetometer, the gyroscope, both. */
  float heading_deg, heading_gyro_deg, heading_fusion_deg;
  /* 1: yes. */
  uint8_t calibrated;
  /* The magnetometer's mode, raw. */
  uint32_t state;
  /* Of the calibration's sphere; their units are not documented. */
  float radius, error_mean, error_variance;
} ardrone_magneto;

/* ARDRONE_TAG_WIND. */
typedef struct ardrone_wind {
  /* Speed of the wind, m/s; its direction and the angles that hold against it, radians; the
     estimator's internal state. */
  float speed_m_s, angle, theta_rad, phi_rad, state[6], debug[3];
} ardrone_wind;

/* ARDRONE_TAG_KALMAN_PRESSURE: the height's estimator. */
typedef struct ardrone_kalman_pressure {
  /* The estimator's state and variances; their units are not documented. */
  float offset_pa, z, vz, bias_pwm, bias_pressure, offset_ultrasound, prediction_ultrasound,
      variance_altitude, variance_pwm, variance_speed;
  /* 1: near the ground. */
  uint32_t ground_effect;
  /* Its unit is not documented. */
  float innovation_sum;
  /* How many echoes were rejected. */
  uint32_t rejects_ultrasound;
  /* Their units are not documented. */
  float multisinus, climb_altitude;
  /* Raw; of a flight that identifies the drone's dynamics. */
  uint32_t multisinus_flag, multisinus_start;
} ardrone_kalman_pressure;

/* ARDRONE_TAG_HD_VIDEO: the recording stream. */
typedef struct ardrone_hd_video {
  /* State; packets and bytes that wait; size and free space of the USB stick; number of the last
     picture; seconds of recording that fit in the free space. */
  uint32_t state, fifo_packets, fifo_size, usb_size_kb, usb_free_kb, frame_number, remaining_s;
} ardrone_hd_video;

/* ARDRONE_TAG_WIFI. */
typedef struct ardrone_wifi {
  /* The drone's own measure of the link's quality, raw. */
  uint32_t link_quality;
} ardrone_wifi;

/* ARDRONE_TAG_GPS of firmware 2.4.8; of 2.4.7's only the first four are known. */
typedef struct ardrone_gps {
  /* Position in WGS 84; horizontal dilution of precision, a factor. */
  double latitude_deg, longitude_deg, elevation_m, hdop;
  /* 1: yes. */
  uint32_t data_available, zero_validated, waypoint_validated;
  /* The position at the start, and that fused with the IMU, degrees. */
  double latitude0, longitude0, latitude_fused, longitude_fused;
  /* Of the receiver. */
  uint32_t state;
  /* The flight to a waypoint and its control loop; their units are not documented. */
  float x_trajectory, x_reference, y_trajectory, y_reference, theta_p, phi_p, theta_i, phi_i,
      theta_d, phi_d;
  /* Dilution of precision, a factor each. */
  double vdop, pdop;
  /* Speed over ground; its values suggest m/s. */
  float speed;
  /* Of the receiver's last answer. */
  uint32_t last_frame_stamp;
  /* Course, degrees; errors, m and m/s; signal to noise, dB Hz: these units are what the
     values suggest. */
  float degree, degree_magnetic, ehpe, ehve, c_n0;
  /* In use. */
  uint32_t num_satellites;
  /* 12 times satellite, signal. */
  uint8_t channels[24];
  /* 1: the receiver is there; has its ephemeris. */
  uint32_t plugged, ephemeris;
  /* Their units are not documented. */
  float vx_trajectory, vy_trajectory;
  /* Of the receiver. */
  uint32_t firmware;
} ardrone_gps;

/* ARDRONE_TAG_GPS of firmware of 2012, which holds no GPS position. */
typedef struct ardrone_zimmu {
  /* Raw. */
  int32_t vz_lsb;
  /* Vertical speed; its unit is not documented. */
  float vz;
} ardrone_zimmu;

/* Which layout tag 27 had. */
typedef enum ardrone_gps_form {
  /* There was no such option. */
  ARDRONE_GPS_NONE = 0,
  /* 12 bytes, firmware of 2012: `zimmu`. */
  ARDRONE_GPS_ZIMMU = 1,
  /* 480 bytes: `gps`, its first four fields, which may be garbage. */
  ARDRONE_GPS_247 = 2,
  /* 216 bytes: `gps`. */
  ARDRONE_GPS_248 = 3
} ardrone_gps_form;

/* One packet. An option whose bit in `present` is 0 is filled with zeros. */
typedef struct ardrone_navdata {
  /* magic is 0x55667788; state has ARDRONE_STATE_ bits; sequence is the packet's number;
     vision_defined is 1 when the on-board vision runs; checksum is as it was sent. */
  uint32_t magic, state, sequence, vision_defined, checksum;
  /* Bit 1 << tag for each ardrone_tag whose option came whole. */
  uint32_t present;
  /* How many options were skipped since their tag or size is unknown or they came twice. */
  uint32_t num_unknown;
  /* How many options were skipped since they are shorter than known. */
  uint32_t num_short;
  /* Which of gps and zimmu ARDRONE_TAG_GPS filled. */
  ardrone_gps_form gps_form;
  /* ARDRONE_TAG_DEMO. */
  ardrone_demo demo;
  /* ARDRONE_TAG_TIME. */
  ardrone_time time;
  /* ARDRONE_TAG_RAW_MEASURES. */
  ardrone_raw_measures raw_measures;
  /* ARDRONE_TAG_PHYS_MEASURES. */
  ardrone_phys_measures phys_measures;
  /* ARDRONE_TAG_GYROS_OFFSETS. */
  ardrone_gyros_offsets gyros_offsets;
  /* ARDRONE_TAG_EULER_ANGLES. */
  ardrone_euler_angles euler_angles;
  /* ARDRONE_TAG_REFERENCES. */
  ardrone_references references;
  /* ARDRONE_TAG_TRIMS. */
  ardrone_trims trims;
  /* ARDRONE_TAG_RC_REFERENCES. */
  ardrone_rc_references rc_references;
  /* ARDRONE_TAG_PWM. */
  ardrone_pwm pwm;
  /* ARDRONE_TAG_ALTITUDE. */
  ardrone_altitude altitude;
  /* ARDRONE_TAG_VISION_RAW. */
  ardrone_vision_raw vision_raw;
  /* ARDRONE_TAG_VISION_FLOW. */
  ardrone_vision_flow vision_flow;
  /* ARDRONE_TAG_VISION. */
  ardrone_vision vision;
  /* ARDRONE_TAG_VISION_PERF. */
  ardrone_vision_perf vision_perf;
  /* ARDRONE_TAG_TRACKERS. */
  ardrone_trackers trackers;
  /* ARDRONE_TAG_VISION_DETECT. */
  ardrone_vision_detect vision_detect;
  /* ARDRONE_TAG_WATCHDOG. */
  ardrone_watchdog watchdog;
  /* ARDRONE_TAG_ADC_DATA. */
  ardrone_adc_data adc_data;
  /* ARDRONE_TAG_VIDEO_STREAM. */
  ardrone_video_stream video_stream;
  /* ARDRONE_TAG_GAMES. */
  ardrone_games games;
  /* ARDRONE_TAG_PRESSURE. */
  ardrone_pressure pressure;
  /* ARDRONE_TAG_MAGNETO. */
  ardrone_magneto magneto;
  /* ARDRONE_TAG_WIND. */
  ardrone_wind wind;
  /* ARDRONE_TAG_KALMAN_PRESSURE. */
  ardrone_kalman_pressure kalman_pressure;
  /* ARDRONE_TAG_HD_VIDEO. */
  ardrone_hd_video hd_video;
  /* ARDRONE_TAG_WIFI. */
  ardrone_wifi wifi;
  /* ARDRONE_TAG_GPS, the other two forms. */
  ardrone_gps gps;
  /* ARDRONE_TAG_GPS, ARDRONE_GPS_ZIMMU. */
  ardrone_zimmu zimmu;
} ardrone_navdata;

/* Decodes one datagram. The whole datagram is checked first, so that an error leaves *navdata as it
   was. Of an option that is longer than known (newer firmware), the known part is decoded. It reads
   no byte outside [bytes, bytes + size). A full packet takes about 1 us. Returns TVS_ERR_NULL;
   TVS_ERR_DATA: the magic number is wrong, the datagram is truncated, an option has size 0 to 3 or
   reaches beyond the end, or the last option is no checksum; TVS_ERR_CHECKSUM. */
TV_API tvs_status ardrone_navdata_decode(const uint8_t *bytes, size_t size,
                                         ardrone_navdata *navdata);

/* Decides which packets to use, since UDP loses, doubles and reorders packets, and drones start
   again. Start with zeros. Private except for has_last. */
typedef struct ardrone_sequence {
  uint32_t last;
  int has_last, was_bootstrap;
  uint32_t late_last;
  int num_late;
} ardrone_sequence;

/* What ardrone_sequence_check returns. */
typedef enum ardrone_order {
  /* The packet follows the last one. Use it. */
  ARDRONE_ORDER_NEXT,
  /* The packet is newer, and packets before it are missing. Use it. */
  ARDRONE_ORDER_GAP,
  /* The drone's count started again: it rebooted, or its link was made again. Use it. */
  ARDRONE_ORDER_RESTART,
  /* The packet came twice or was overtaken. Do not use it. */
  ARDRONE_ORDER_LATE
} ardrone_order;

/* Compares the packet's sequence number with the last one, modulo 2^32. A larger number is a newer
   packet. It is a restart when the number is smaller by at least 1000, when a bootstrap packet with
   a smaller number follows one that was no bootstrap packet, or when 8 packets in a row have
   smaller numbers and are in order among themselves. After a silence of the stream set has_last to
   0; the next packet is then accepted whatever its number is. */
TV_API ardrone_order ardrone_sequence_check(ardrone_sequence *sequence,
                                            const ardrone_navdata *navdata);

/* The period of the drone's stamp, ns. */
#define ARDRONE_TIME_PERIOD_NS INT64_C(2048000000000)

/* Converts the drone's stamp to nanoseconds in [0, ARDRONE_TIME_PERIOD_NS). */
TV_API int64_t ardrone_time_ns(ardrone_time time);

/* Writes the packet to *sample in SI units and in the frames of source.h, without its time.
   psi0_rad is the yaw at the start, which becomes 0. A field whose numbers cannot be a measurement
   (a garbled option, NaN) gets no valid bit; velocity and altitude have theirs in flight only. The
   vertical velocity is that of ARDRONE_TAG_ALTITUDE, turned into the body frame. The sigmas are
   round figures for this class of sensor; they were not measured on a drone. Returns TVS_ERR_NULL,
   TVS_ERR_STRUCT_SIZE; TVS_NONE when the packet holds nothing that can be used. */
TV_API tvs_status ardrone_navdata_to_imu(const ardrone_navdata *navdata, double psi0_rad,
                                         tvs_imu *sample);

TV_END_DECLS

#endif
