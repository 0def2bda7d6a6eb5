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

/* No datagram of the drone is longer than this, in bytes. */
enum { ARDRONE_NAVDATA_MAX_BYTES = 4096 };

/* The macros ARDRONE_STATE_ are the bits of the state word, ardrone_navdata.state. */

/* 1: the drone is in the air; 0: it has landed. */
#define ARDRONE_STATE_FLYING (UINT32_C(1) << 0)
/* The drone's video is on. */
#define ARDRONE_STATE_VIDEO (UINT32_C(1) << 1)
/* The on-board vision is on. */
#define ARDRONE_STATE_VISION (UINT32_C(1) << 2)
/* 1: the drone controls its angular rates; 0: its angles. */
#define ARDRONE_STATE_RATE_CONTROL (UINT32_C(1) << 3)
/* The drone controls its altitude. */
#define ARDRONE_STATE_ALTITUDE_CONTROL (UINT32_C(1) << 4)
/* The start button was pressed. */
#define ARDRONE_STATE_START_BUTTON (UINT32_C(1) << 5)
/* A command was acknowledged. The bit is set without a command, too: clear it before a
   handshake. */
#define ARDRONE_STATE_ACKNOWLEDGE (UINT32_C(1) << 6)
/* The camera is ready. */
#define ARDRONE_STATE_CAMERA_READY (UINT32_C(1) << 7)
/* Parrot's "travelling" mode is on; Parrot does not document what it does. */
#define ARDRONE_STATE_TRAVELLING (UINT32_C(1) << 8)
/* A USB stick is plugged into the drone. */
#define ARDRONE_STATE_USB_READY (UINT32_C(1) << 9)
/* Navdata has the short ("demo") form. */
#define ARDRONE_STATE_DEMO (UINT32_C(1) << 10)
/* This is a bootstrap packet: navdata has no options yet. */
#define ARDRONE_STATE_BOOTSTRAP (UINT32_C(1) << 11)
/* A motor is stuck or does not answer. */
#define ARDRONE_STATE_MOTOR_PROBLEM (UINT32_C(1) << 12)
/* The drone received nothing for 2 s. */
#define ARDRONE_STATE_COM_LOST (UINT32_C(1) << 13)
/* A software fault: land as soon as possible. */
#define ARDRONE_STATE_SOFTWARE_FAULT (UINT32_C(1) << 14)
/* The battery is low: the drone will land by itself. */
#define ARDRONE_STATE_BATTERY_LOW (UINT32_C(1) << 15)
/* A command requested the emergency. */
#define ARDRONE_STATE_USER_EMERGENCY (UINT32_C(1) << 16)
/* A timer of the drone ran out; Parrot does not document which one. */
#define ARDRONE_STATE_TIMER_ELAPSED (UINT32_C(1) << 17)
/* The magnetometer needs a calibration. */
#define ARDRONE_STATE_MAGNETO_CALIBRATION (UINT32_C(1) << 18)
/* The drone cut its motors because an angle was too large. */
#define ARDRONE_STATE_ANGLES_OUT_OF_RANGE (UINT32_C(1) << 19)
/* There is too much wind. */
#define ARDRONE_STATE_WIND (UINT32_C(1) << 20)
/* The ultrasound receives no echo. */
#define ARDRONE_STATE_ULTRASOUND_DEAF (UINT32_C(1) << 21)
/* The drone cut its motors. */
#define ARDRONE_STATE_CUT_OUT (UINT32_C(1) << 22)
/* The sensor board's version is right. */
#define ARDRONE_STATE_PIC_VERSION_OK (UINT32_C(1) << 23)
/* The drone's thread that reads commands is running. */
#define ARDRONE_STATE_AT_THREAD (UINT32_C(1) << 24)
/* The drone's thread that sends navdata is running. */
#define ARDRONE_STATE_NAVDATA_THREAD (UINT32_C(1) << 25)
/* The drone's thread that sends video is running. */
#define ARDRONE_STATE_VIDEO_THREAD (UINT32_C(1) << 26)
/* The drone's thread that reads the sensors is running. */
#define ARDRONE_STATE_ACQUISITION_THREAD (UINT32_C(1) << 27)
/* The drone's control loop was over 5 ms late. */
#define ARDRONE_STATE_CONTROL_LATE (UINT32_C(1) << 28)
/* The drone's sensor board was over 5 ms late. */
#define ARDRONE_STATE_ADC_LATE (UINT32_C(1) << 29)
/* No command came for 50 ms. The bit is set at times on a good link, too. */
#define ARDRONE_STATE_COM_WATCHDOG (UINT32_C(1) << 30)
/* The motors are cut until they are re-armed. */
#define ARDRONE_STATE_EMERGENCY (UINT32_C(1) << 31)

/* Tags of the options. An option is bit 1 << tag in ardrone_navdata.present and in the value of the
   key general:navdata_options. */
typedef enum ardrone_tag {
  /* Attitude, height, velocity and battery. */
  ARDRONE_TAG_DEMO = 0,
  /* The drone's time stamp. */
  ARDRONE_TAG_TIME = 1,
  /* The sensors' raw readings. */
  ARDRONE_TAG_RAW_MEASURES = 2,
  /* The sensors' readings in physical units. */
  ARDRONE_TAG_PHYS_MEASURES = 3,
  /* The gyroscopes' readings at rest. */
  ARDRONE_TAG_GYROS_OFFSETS = 4,
  /* Pitch and roll by the accelerometer alone. */
  ARDRONE_TAG_EULER_ANGLES = 5,
  /* The set points of the control loops. */
  ARDRONE_TAG_REFERENCES = 6,
  /* The trims of yaw rate, pitch and roll. */
  ARDRONE_TAG_TRIMS = 7,
  /* The movement that the controller requested. */
  ARDRONE_TAG_RC_REFERENCES = 8,
  /* The motors' commands and the parts they are made of. */
  ARDRONE_TAG_PWM = 9,
  /* The height and its estimators. */
  ARDRONE_TAG_ALTITUDE = 10,
  /* The translation of the picture between two frames. */
  ARDRONE_TAG_VISION_RAW = 11,
  /* The optical flow in five parts of the picture. */
  ARDRONE_TAG_VISION_FLOW = 12,
  /* The on-board vision's velocity. */
  ARDRONE_TAG_VISION = 13,
  /* The on-board vision's computing times. */
  ARDRONE_TAG_VISION_PERF = 14,
  /* The on-board vision's tracked points. */
  ARDRONE_TAG_TRACKERS = 15,
  /* The markers (printed tags, shells of other drones) that the on-board vision saw. */
  ARDRONE_TAG_VISION_DETECT = 16,
  /* The counter of a watchdog. */
  ARDRONE_TAG_WATCHDOG = 17,
  /* The raw bytes of the sensor board. */
  ARDRONE_TAG_ADC_DATA = 18,
  /* The state of the live video stream. */
  ARDRONE_TAG_VIDEO_STREAM = 19,
  /* The counters of Parrot's games. */
  ARDRONE_TAG_GAMES = 20,
  /* The barometer's readings. */
  ARDRONE_TAG_PRESSURE = 21,
  /* The magnetometer's readings and heading. */
  ARDRONE_TAG_MAGNETO = 22,
  /* The wind's estimate and its estimator's state. */
  ARDRONE_TAG_WIND = 23,
  /* The state of the height's estimator. */
  ARDRONE_TAG_KALMAN_PRESSURE = 24,
  /* The state of the recording stream and of the USB stick. */
  ARDRONE_TAG_HD_VIDEO = 25,
  /* The quality of the radio link. */
  ARDRONE_TAG_WIFI = 26,
  /* The GPS receiver, in one of three layouts of different size (ardrone_gps_form). */
  ARDRONE_TAG_GPS = 27,
  /* The number of the tags above. */
  ARDRONE_NUM_TAGS = 28,
  /* The last option of each packet: the sum of all bytes before it. */
  ARDRONE_TAG_CHECKSUM = 0xffff
} ardrone_tag;
/* 1 when the packet has the option of this tag. */
#define ARDRONE_HAS(navdata, TAG) (((navdata)->present >> (TAG)) & 1u)

/* Major part (upper 16 bits) of ctrl_state; 3 and 7 both mean flying. */
typedef enum ardrone_control_state {
  /* The drone has no control state yet. */
  ARDRONE_CONTROL_DEFAULT,
  /* The drone starts up. */
  ARDRONE_CONTROL_INIT,
  /* The drone has landed, and its motors are off. */
  ARDRONE_CONTROL_LANDED,
  /* The drone flies under command. */
  ARDRONE_CONTROL_FLYING,
  /* The drone hovers: it holds its place. */
  ARDRONE_CONTROL_HOVERING,
  /* The drone runs a self-test. */
  ARDRONE_CONTROL_TEST,
  /* The drone takes off; this state lasts until it hovers. */
  ARDRONE_CONTROL_TAKING_OFF,
  /* The drone flies to a place; this state counts as flying. */
  ARDRONE_CONTROL_GO_TO_FIX,
  /* The drone lands; this state lasts until the motors are off. */
  ARDRONE_CONTROL_LANDING,
  /* The drone makes a flip. */
  ARDRONE_CONTROL_LOOPING
} ardrone_control_state;

/* The options. Fields are in the order of the wire, with the names of Parrot's headers made
   clearer. "Raw" and "unit not documented" mean that those headers do not say more. */

/* The option ARDRONE_TAG_DEMO: attitude, height, velocity and battery. */
typedef struct ardrone_demo {
  /* The upper 16 bits of ctrl_state are an ardrone_control_state. battery_percent is in [0,
     100]. */
  uint32_t ctrl_state, battery_percent;
  /* Pitch (nose up), roll (right side down) and yaw (clockwise from above), 0.001 degrees. */
  float theta_mdeg, phi_mdeg, psi_mdeg;
  /* The height, millimetres; 0 on the ground. */
  int32_t altitude_mm;
  /* Velocity along the body's axes. z is always 0 on this drone; ardrone_altitude has the vertical
     speed. */
  float velocity_mm_s[3];
  /* The on-board vision's count of frames. */
  uint32_t num_frames;
  /* Rotation (3x3) and translation of a detected marker in the camera's frame; the translation's
     unit is not documented. */
  float detection_rotation[9], detection_translation[3];
  /* Which marker was detected, and which detector found it. */
  uint32_t detection_tag, detection_type;
  /* Rotation (3x3) and translation of the camera in the body's frame, often 0; the translation's
     unit is not documented. */
  float camera_rotation[9], camera_translation[3];
} ardrone_demo;

/* The option ARDRONE_TAG_TIME: the drone's time stamp. */
typedef struct ardrone_time {
  /* The upper 11 bits are seconds, the lower 21 are microseconds: the stamp wraps at 2048 s. */
  uint32_t stamp;
} ardrone_time;

/* The option ARDRONE_TAG_RAW_MEASURES: the sensors' raw readings. */
typedef struct ardrone_raw_measures {
  /* The accelerometer's readings, raw. */
  uint16_t accelerometer[3];
  /* The gyroscopes' readings, raw; gyro_110 has a range of 110 degrees a second. */
  int16_t gyro[3], gyro_110[2];
  /* The battery's voltage, millivolts. */
  uint32_t battery_mv;
  /* The ultrasound's echoes, raw. */
  uint16_t echo_start, echo_end, echo_association, echo_distance, curve_time, curve_value,
      curve_ref, echo_flag, num_echoes;
  /* The sum of the ultrasound's echoes, raw. */
  uint32_t sum_echo;
  /* The height by ultrasound, millimetres. */
  int32_t altitude_mm;
  /* A raw number; its meaning is not documented. */
  int16_t gradient;
} ardrone_raw_measures;

/* The option ARDRONE_TAG_PHYS_MEASURES: the sensors' readings in physical units. */
typedef struct ardrone_phys_measures {
  /* The accelerometer's temperature. */
  float accelerometer_celsius;
  /* The gyroscopes' temperature, raw. */
  uint16_t gyro_temperature;
  /* Acceleration and angular rate along the body's axes; at rest acceleration_mg[2] is -1000. */
  float acceleration_mg[3], rate_deg_s[3];
  /* The 3.3 V supply and two reference voltages, raw. */
  uint32_t supply_3v3, vref_epson, vref_idg;
} ardrone_phys_measures;

/* The option ARDRONE_TAG_GYROS_OFFSETS: the gyroscopes' readings at rest. */
typedef struct ardrone_gyros_offsets {
  /* The gyroscopes' readings at rest, raw units. */
  float offset[3];
} ardrone_gyros_offsets;

/* The option ARDRONE_TAG_EULER_ANGLES: pitch and roll by the accelerometer alone. */
typedef struct ardrone_euler_angles {
  /* Pitch and roll by the accelerometer alone, 0.001 degrees. */
  float theta_mdeg, phi_mdeg;
} ardrone_euler_angles;

/* The option ARDRONE_TAG_REFERENCES: the control loops' set points. */
typedef struct ardrone_references {
  /* Set points of angles and of their integrals, raw. */
  int32_t theta, phi, theta_i, phi_i, pitch, roll, yaw, psi;
  /* Set points of velocities, corrections of angles, and gains; their units are not documented. */
  float vx, vy, theta_mod, phi_mod, k_vx, k_vy;
  /* Which gains are in use, raw. */
  uint32_t k_mode;
  /* What a command of the controller requests; the units are not documented. */
  float ui_time, ui_theta, ui_phi, ui_psi, ui_psi_accuracy;
  /* The sequence number of the controller's command. */
  int32_t ui_sequence;
} ardrone_references;

/* The option ARDRONE_TAG_TRIMS: the trims of yaw rate, pitch and roll. */
typedef struct ardrone_trims {
  /* The yaw rate, pitch and roll of the flat trim; their units are not documented. */
  float yaw_rate, theta, phi;
} ardrone_trims;

/* The option ARDRONE_TAG_RC_REFERENCES: the movement that the controller requested. */
typedef struct ardrone_rc_references {
  /* The movement that the controller sent, raw. */
  int32_t pitch, roll, yaw, climb, ag;
} ardrone_rc_references;

/* The option ARDRONE_TAG_PWM: the motors' commands and their parts. */
typedef struct ardrone_pwm {
  /* The command of each motor in [0, 255], and the same after saturation. */
  uint8_t motor[4], saturated[4];
  /* Parts of the throttle; their units are not documented. */
  float climb_feed_forward, climb_altitude, altitude_integral, vz_ref;
  /* The parts of pitch, roll and yaw in the motors' commands, raw. */
  int32_t pitch, roll, yaw;
  /* The integral part of yaw; its unit is not documented. */
  float yaw_integral;
  /* The parts of pitch, roll and yaw before saturation, raw. */
  int32_t pitch_planned, roll_planned, yaw_planned;
  /* The planned climb; its unit is not documented. */
  float climb_planned;
  /* The current of each motor, raw. */
  uint16_t current[4];
  /* Parts of the throttle; their units are not documented. */
  float altitude_proportional, altitude_derivative;
} ardrone_pwm;

/* The option ARDRONE_TAG_ALTITUDE: the height and its estimators. */
typedef struct ardrone_altitude {
  /* The fused height, millimetres. */
  int32_t vision_mm;
  /* The vertical speed, mm/s; up is positive. */
  float vz_mm_s;
  /* The set point of the height, and the height by ultrasound, which is not 0 on the ground. */
  int32_t reference_mm, raw_mm;
  /* The height observer's acceleration, height and state, in units of m and s. */
  float observed_accel_z, observed_altitude, observed_x[3];
  /* The height observer's mode, raw. */
  uint32_t observed_state;
  /* The estimated velocity, in units of m and s. */
  float estimated_v[2];
  /* The velocity estimator's mode, raw. */
  uint32_t estimated_state;
} ardrone_altitude;

/* The option ARDRONE_TAG_VISION_RAW: the translation of the picture between two frames. */
typedef struct ardrone_vision_raw {
  /* The translation of the picture between two frames; its unit is not documented. */
  float translation[3];
} ardrone_vision_raw;

/* The option ARDRONE_TAG_VISION_FLOW: the optical flow in five parts of the picture. */
typedef struct ardrone_vision_flow {
  /* Motion in five parts of the picture, pixels. */
  float dx[5], dy[5];
} ardrone_vision_flow;

/* The option ARDRONE_TAG_VISION: the on-board vision's velocity. */
typedef struct ardrone_vision {
  /* The on-board vision's mode, raw. */
  uint32_t state;
  /* A raw number; its meaning is not documented. */
  int32_t misc;
  /* Trims and references of roll and pitch; their units are not documented. */
  float phi_trim, phi_reference, theta_trim, theta_reference;
  /* 1: this packet belongs to a new picture. */
  int32_t new_picture;
  /* Pitch, roll and yaw when the on-board vision's picture was captured, radians. */
  float theta_rad, phi_rad, psi_rad;
  /* The height when the on-board vision's picture was captured, millimetres. */
  int32_t altitude_mm;
  /* When the picture was captured: milliseconds of the clock of ARDRONE_TAG_TIME. */
  uint32_t capture_ms;
  /* Velocity along the body's axes; changes of roll, pitch and yaw since the picture before,
     radians. */
  float velocity_mm_s[3], delta_phi, delta_theta, delta_psi;
  /* The place to hold: whether there is one; whether it was set anew. */
  uint32_t gold_defined, gold_reset;
  /* The position of the place to hold; its unit is not documented. */
  float gold_x, gold_y;
} ardrone_vision;

/* The option ARDRONE_TAG_VISION_PERF: the on-board vision's computing times. */
typedef struct ardrone_vision_perf {
  /* The computing times of the on-board vision's steps; their unit is not documented. */
  float size, corners, compute, tracking, translation, update, custom[20];
} ardrone_vision_perf;

/* The option ARDRONE_TAG_TRACKERS: the points that the on-board vision tracks. */
typedef struct ardrone_trackers {
  /* For each of 5 x 6 trackers: locked is 1 when it is locked on a point; points has x and y,
     pixels. */
  int32_t locked[30], points[60];
} ardrone_trackers;

/* The option ARDRONE_TAG_VISION_DETECT: up to four markers that the on-board vision saw. */
typedef struct ardrone_vision_detect {
  /* The number of markers; for each, its type, and its place and size in thousandths of the
     picture's width and height. */
  uint32_t count, type[4], x[4], y[4], width[4], height[4];
  /* The distance of each marker from the camera, centimetres. */
  uint32_t distance_cm[4];
  /* For each marker: its orientation in the picture, its rotation (3x3) and its translation (3),
     whose unit is not documented. */
  float orientation_deg[4], rotation[36], translation[12];
  /* Which camera saw each marker. */
  uint32_t camera[4];
} ardrone_vision_detect;

/* The option ARDRONE_TAG_WATCHDOG: the counter of a watchdog. */
typedef struct ardrone_watchdog {
  /* The watchdog's counter. */
  int32_t value;
} ardrone_watchdog;

/* The option ARDRONE_TAG_ADC_DATA: the raw bytes of the sensor board. */
typedef struct ardrone_adc_data {
  /* The version of the sensor board. */
  uint32_t version;
  /* The sensor board's packet, raw: its layout is not documented. */
  uint8_t data[32];
} ardrone_adc_data;

/* The option ARDRONE_TAG_VIDEO_STREAM: the state of the live stream. */
typedef struct ardrone_video_stream {
  /* The quantiser of the picture. */
  uint8_t quantiser;
  /* Bytes of the picture; its number; the last command's number; the mean time between two
     commands. */
  uint32_t frame_size, frame_number, at_sequence, at_mean_gap_ms;
  /* The variance of the time between two commands; its unit is not documented. */
  float at_gap_variance;
  /* The link's quality and bit rates, raw; their units are not documented. */
  uint32_t at_quality, bitrate, desired_bitrate;
  /* Raw numbers; their meaning is not documented. */
  int32_t data[5];
  /* How much data waits to be sent in the TCP queue and in the FIFO, raw. */
  uint32_t tcp_queue, fifo_queue;
} ardrone_video_stream;

/* The option ARDRONE_TAG_GAMES: the counters of Parrot's games. */
typedef struct ardrone_games {
  /* The numbers of double taps and of finish lines. */
  uint32_t double_taps, finish_lines;
} ardrone_games;

/* The option ARDRONE_TAG_PRESSURE: the barometer's readings. */
typedef struct ardrone_pressure {
  /* The barometer's raw pressure. */
  int32_t up;
  /* The barometer's raw temperature. */
  int16_t ut;
  /* The temperature in 0.1 degrees Celsius, and the pressure in Pa. */
  int32_t temperature_dc, pressure_pa;
} ardrone_pressure;

/* The option ARDRONE_TAG_MAGNETO: the magnetometer's readings and heading. */
typedef struct ardrone_magneto {
  /* The magnetometer's readings, raw. */
  int16_t raw[3];
  /* Along the body's axes, in milligauss: the field, the rectified field, the offset. */
  float field_mg[3], rectified[3], offset[3];
  /* The heading by the magnetometer, by the gyroscope, and by both. */
  float heading_deg, heading_gyro_deg, heading_fusion_deg;
  /* 1: the magnetometer is calibrated. */
  uint8_t calibrated;
  /* The magnetometer's mode, raw. */
  uint32_t state;
  /* Radius of the calibration's sphere, and mean and variance of its error; their units are not
     documented. */
  float radius, error_mean, error_variance;
} ardrone_magneto;

/* The option ARDRONE_TAG_WIND: the wind's estimate and its estimator's state. */
typedef struct ardrone_wind {
  /* Speed of the wind, m/s; its direction, and the pitch and roll with which the drone leans
     against it, radians; the estimator's internal state. */
  float speed_m_s, angle, theta_rad, phi_rad, state[6], debug[3];
} ardrone_wind;

/* The option ARDRONE_TAG_KALMAN_PRESSURE: the height's estimator. */
typedef struct ardrone_kalman_pressure {
  /* The estimator's state and variances; their units are not documented. */
  float offset_pa, z, vz, bias_pwm, bias_pressure, offset_ultrasound, prediction_ultrasound,
      variance_altitude, variance_pwm, variance_speed;
  /* 1: the drone is near the ground. */
  uint32_t ground_effect;
  /* The sum of the estimator's innovations; its unit is not documented. */
  float innovation_sum;
  /* How many ultrasound echoes were rejected. */
  uint32_t rejects_ultrasound;
  /* The signal of a flight that identifies the drone's dynamics, and a part of the throttle; their
     units are not documented. */
  float multisinus, climb_altitude;
  /* Flags of a flight that identifies the drone's dynamics, raw. */
  uint32_t multisinus_flag, multisinus_start;
} ardrone_kalman_pressure;

/* The option ARDRONE_TAG_HD_VIDEO: the recording stream. */
typedef struct ardrone_hd_video {
  /* State; packets and bytes that wait; size and free space of the USB stick; number of the last
     picture; seconds of recording that fit in the free space. */
  uint32_t state, fifo_packets, fifo_size, usb_size_kb, usb_free_kb, frame_number, remaining_s;
} ardrone_hd_video;

/* The option ARDRONE_TAG_WIFI: the quality of the radio link. */
typedef struct ardrone_wifi {
  /* The drone's own measure of the link's quality, raw. */
  uint32_t link_quality;
} ardrone_wifi;

/* The option ARDRONE_TAG_GPS of firmware 2.4.8; of 2.4.7's only the first four fields are known. */
typedef struct ardrone_gps {
  /* Position in WGS 84; horizontal dilution of precision, a factor. */
  double latitude_deg, longitude_deg, elevation_m, hdop;
  /* Each is 1 for yes: data are available; the start position and the waypoint are validated. */
  uint32_t data_available, zero_validated, waypoint_validated;
  /* The position at the start, and that fused with the IMU, degrees. */
  double latitude0, longitude0, latitude_fused, longitude_fused;
  /* The receiver's state, raw. */
  uint32_t state;
  /* The flight to a waypoint and its control loop; their units are not documented. */
  float x_trajectory, x_reference, y_trajectory, y_reference, theta_p, phi_p, theta_i, phi_i,
      theta_d, phi_d;
  /* Vertical and positional dilution of precision, a factor each. */
  double vdop, pdop;
  /* Speed over ground; its values suggest that the unit is m/s. */
  float speed;
  /* The stamp of the receiver's last answer, raw. */
  uint32_t last_frame_stamp;
  /* Course, degrees; errors, m and m/s; signal to noise, dB Hz: these units are what the
     values suggest. */
  float degree, degree_magnetic, ehpe, ehve, c_n0;
  /* The number of satellites in use. */
  uint32_t num_satellites;
  /* For each of 12 channels: satellite and signal. */
  uint8_t channels[24];
  /* Each is 1 for yes: the receiver is plugged in; it has its ephemeris. */
  uint32_t plugged, ephemeris;
  /* The velocity of the flight to a waypoint; its unit is not documented. */
  float vx_trajectory, vy_trajectory;
  /* The receiver's firmware, raw. */
  uint32_t firmware;
} ardrone_gps;

/* The option ARDRONE_TAG_GPS of firmware of 2012, which holds no GPS position. */
typedef struct ardrone_zimmu {
  /* The vertical speed, raw. */
  int32_t vz_lsb;
  /* Vertical speed; its unit is not documented. */
  float vz;
} ardrone_zimmu;

/* The layout of the option ARDRONE_TAG_GPS in a packet. */
typedef enum ardrone_gps_form {
  /* The packet has no option ARDRONE_TAG_GPS. */
  ARDRONE_GPS_NONE = 0,
  /* The layout has 12 bytes (firmware of 2012) and fills `zimmu`. */
  ARDRONE_GPS_ZIMMU = 1,
  /* The layout has 480 bytes and fills the first four fields of `gps`, which may be garbage. */
  ARDRONE_GPS_247 = 2,
  /* The layout has 216 bytes and fills `gps`. */
  ARDRONE_GPS_248 = 3
} ardrone_gps_form;

/* One packet. An option whose bit in `present` is 0 is filled with zeros. */
typedef struct ardrone_navdata {
  /* magic is 0x55667788, or 0x55667789, which is also accepted; state has ARDRONE_STATE_ bits;
     sequence is the packet's number; vision_defined is 1 when the on-board vision runs; checksum is
     as it was sent. */
  uint32_t magic, state, sequence, vision_defined, checksum;
  /* Bit 1 << tag for each ardrone_tag whose option came whole. */
  uint32_t present;
  /* How many options were skipped since their tag or size is unknown or they came twice. */
  uint32_t num_unknown;
  /* How many options were skipped since they are shorter than known. */
  uint32_t num_short;
  /* Whether the option ARDRONE_TAG_GPS filled gps or zimmu. */
  ardrone_gps_form gps_form;
  /* The option ARDRONE_TAG_DEMO of the packet; zeros when the packet does not have it. */
  ardrone_demo demo;
  /* The option ARDRONE_TAG_TIME of the packet; zeros when the packet does not have it. */
  ardrone_time time;
  /* The option ARDRONE_TAG_RAW_MEASURES of the packet; zeros when the packet does not have it. */
  ardrone_raw_measures raw_measures;
  /* The option ARDRONE_TAG_PHYS_MEASURES of the packet; zeros when the packet does not have it. */
  ardrone_phys_measures phys_measures;
  /* The option ARDRONE_TAG_GYROS_OFFSETS of the packet; zeros when the packet does not have it. */
  ardrone_gyros_offsets gyros_offsets;
  /* The option ARDRONE_TAG_EULER_ANGLES of the packet; zeros when the packet does not have it. */
  ardrone_euler_angles euler_angles;
  /* The option ARDRONE_TAG_REFERENCES of the packet; zeros when the packet does not have it. */
  ardrone_references references;
  /* The option ARDRONE_TAG_TRIMS of the packet; zeros when the packet does not have it. */
  ardrone_trims trims;
  /* The option ARDRONE_TAG_RC_REFERENCES of the packet; zeros when the packet does not have it. */
  ardrone_rc_references rc_references;
  /* The option ARDRONE_TAG_PWM of the packet; zeros when the packet does not have it. */
  ardrone_pwm pwm;
  /* The option ARDRONE_TAG_ALTITUDE of the packet; zeros when the packet does not have it. */
  ardrone_altitude altitude;
  /* The option ARDRONE_TAG_VISION_RAW of the packet; zeros when the packet does not have it. */
  ardrone_vision_raw vision_raw;
  /* The option ARDRONE_TAG_VISION_FLOW of the packet; zeros when the packet does not have it. */
  ardrone_vision_flow vision_flow;
  /* The option ARDRONE_TAG_VISION of the packet; zeros when the packet does not have it. */
  ardrone_vision vision;
  /* The option ARDRONE_TAG_VISION_PERF of the packet; zeros when the packet does not have it. */
  ardrone_vision_perf vision_perf;
  /* The option ARDRONE_TAG_TRACKERS of the packet; zeros when the packet does not have it. */
  ardrone_trackers trackers;
  /* The option ARDRONE_TAG_VISION_DETECT of the packet; zeros when the packet does not have it. */
  ardrone_vision_detect vision_detect;
  /* The option ARDRONE_TAG_WATCHDOG of the packet; zeros when the packet does not have it. */
  ardrone_watchdog watchdog;
  /* The option ARDRONE_TAG_ADC_DATA of the packet; zeros when the packet does not have it. */
  ardrone_adc_data adc_data;
  /* The option ARDRONE_TAG_VIDEO_STREAM of the packet; zeros when the packet does not have it. */
  ardrone_video_stream video_stream;
  /* The option ARDRONE_TAG_GAMES of the packet; zeros when the packet does not have it. */
  ardrone_games games;
  /* The option ARDRONE_TAG_PRESSURE of the packet; zeros when the packet does not have it. */
  ardrone_pressure pressure;
  /* The option ARDRONE_TAG_MAGNETO of the packet; zeros when the packet does not have it. */
  ardrone_magneto magneto;
  /* The option ARDRONE_TAG_WIND of the packet; zeros when the packet does not have it. */
  ardrone_wind wind;
  /* The option ARDRONE_TAG_KALMAN_PRESSURE of the packet; zeros when the packet does not have
     it. */
  ardrone_kalman_pressure kalman_pressure;
  /* The option ARDRONE_TAG_HD_VIDEO of the packet; zeros when the packet does not have it. */
  ardrone_hd_video hd_video;
  /* The option ARDRONE_TAG_WIFI of the packet; zeros when the packet does not have it. */
  ardrone_wifi wifi;
  /* The option ARDRONE_TAG_GPS in the forms ARDRONE_GPS_247 and ARDRONE_GPS_248, or zeros. */
  ardrone_gps gps;
  /* The option ARDRONE_TAG_GPS in the form ARDRONE_GPS_ZIMMU, or zeros. */
  ardrone_zimmu zimmu;
} ardrone_navdata;

/* Decodes one datagram. The whole datagram is checked first, so that an error leaves *navdata as it
   was. Of an option that is longer than known (newer firmware), the known part is decoded;
   ARDRONE_TAG_GPS is decoded in its three sizes only. It reads no byte outside [bytes, bytes +
   size). A full packet takes about 1 us. Returns TVS_ERR_NULL; TVS_ERR_DATA: the magic number is
   wrong, the datagram is truncated, an option has size 0 to 3 or reaches beyond the end, or the
   last option is no checksum; TVS_ERR_CHECKSUM. */
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

/* The place of a packet in the stream, as ardrone_sequence_check finds it. */
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
   packet. It is a restart when the number is smaller by at least 1000, when a bootstrap packet
   whose number is not larger follows one that was no bootstrap packet, or when 8 packets in a row
   have numbers that are not larger and are in order among themselves; otherwise a number that is
   not larger is ARDRONE_ORDER_LATE. The first packet is a restart. After a silence of the stream
   set has_last to 0; the next packet is then accepted whatever its number is. */
TV_API ardrone_order ardrone_sequence_check(ardrone_sequence *sequence,
                                            const ardrone_navdata *navdata);

/* The drone's time stamp begins again at 0 after this time, ns. */
#define ARDRONE_TIME_PERIOD_NS INT64_C(2048000000000)

/* Converts the drone's time stamp to nanoseconds in [0, ARDRONE_TIME_PERIOD_NS). */
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
