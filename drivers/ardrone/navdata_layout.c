#include "navdata_layout.h"

#include "twoview_drivers/ardrone/navdata.h"

#define AT(field) (uint16_t) offsetof(ardrone_navdata, field)
#define LAYOUT(runs, bytes) \
  { runs, (int)(sizeof runs / sizeof runs[0]), bytes }

static const navdata_run demo[] = {{AT(demo), 4, 36}};
static const navdata_run time[] = {{AT(time), 4, 1}};
static const navdata_run raw_measures[] = {{AT(raw_measures), 2, 8},
                                           {AT(raw_measures.battery_mv), 4, 1},
                                           {AT(raw_measures.echo_start), 2, 9},
                                           {AT(raw_measures.sum_echo), 4, 2},
                                           {AT(raw_measures.gradient), 2, 1}};
static const navdata_run phys_measures[] = {{AT(phys_measures), 4, 1},
                                            {AT(phys_measures.gyro_temperature), 2, 1},
                                            {AT(phys_measures.acceleration_mg), 4, 9}};
static const navdata_run gyros_offsets[] = {{AT(gyros_offsets), 4, 3}};
static const navdata_run euler_angles[] = {{AT(euler_angles), 4, 2}};
static const navdata_run references[] = {{AT(references), 4, 21}};
static const navdata_run trims[] = {{AT(trims), 4, 3}};
static const navdata_run rc_references[] = {{AT(rc_references), 4, 5}};
static const navdata_run pwm[] = {{AT(pwm), 1, 8},
                                  {AT(pwm.climb_feed_forward), 4, 12},
                                  {AT(pwm.current), 2, 4},
                                  {AT(pwm.altitude_proportional), 4, 2}};
static const navdata_run altitude[] = {{AT(altitude), 4, 13}};
static const navdata_run vision_raw[] = {{AT(vision_raw), 4, 3}};
static const navdata_run vision_flow[] = {{AT(vision_flow), 4, 10}};
static const navdata_run vision[] = {{AT(vision), 4, 22}};
static const navdata_run vision_perf[] = {{AT(vision_perf), 4, 26}};
static const navdata_run trackers[] = {{AT(trackers), 4, 90}};
static const navdata_run vision_detect[] = {{AT(vision_detect), 4, 81}};
static const navdata_run watchdog[] = {{AT(watchdog), 4, 1}};
static const navdata_run adc_data[] = {{AT(adc_data), 4, 1}, {AT(adc_data.data), 1, 32}};
static const navdata_run video_stream[] = {{AT(video_stream), 1, 1},
                                           {AT(video_stream.frame_size), 4, 15}};
static const navdata_run games[] = {{AT(games), 4, 2}};
static const navdata_run pressure[] = {
    {AT(pressure), 4, 1}, {AT(pressure.ut), 2, 1}, {AT(pressure.temperature_dc), 4, 2}};
static const navdata_run magneto[] = {{AT(magneto), 2, 3},
                                      {AT(magneto.field_mg), 4, 12},
                                      {AT(magneto.calibrated), 1, 1},
                                      {AT(magneto.state), 4, 4}};
static const navdata_run wind[] = {{AT(wind), 4, 13}};
static const navdata_run kalman_pressure[] = {{AT(kalman_pressure), 4, 17}};
static const navdata_run hd_video[] = {{AT(hd_video), 4, 7}};
static const navdata_run wifi[] = {{AT(wifi), 4, 1}};
static const navdata_run zimmu[] = {{AT(zimmu), 4, 2}};
static const navdata_run gps_247[] = {{AT(gps), 8, 4}};
static const navdata_run gps_248[] = {{AT(gps), 8, 4},           {AT(gps.data_available), 4, 3},
                                      {AT(gps.latitude0), 8, 4}, {AT(gps.state), 4, 11},
                                      {AT(gps.vdop), 8, 2},      {AT(gps.speed), 4, 8},
                                      {AT(gps.channels), 1, 24}, {AT(gps.plugged), 4, 5}};

static const navdata_layout layouts[ARDRONE_TAG_GPS] = {LAYOUT(demo, 148),
                                                        LAYOUT(time, 8),
                                                        LAYOUT(raw_measures, 52),
                                                        LAYOUT(phys_measures, 46),
                                                        LAYOUT(gyros_offsets, 16),
                                                        LAYOUT(euler_angles, 12),
                                                        LAYOUT(references, 88),
                                                        LAYOUT(trims, 16),
                                                        LAYOUT(rc_references, 24),
                                                        LAYOUT(pwm, 76),
                                                        LAYOUT(altitude, 56),
                                                        LAYOUT(vision_raw, 16),
                                                        LAYOUT(vision_flow, 44),
                                                        LAYOUT(vision, 92),
                                                        LAYOUT(vision_perf, 108),
                                                        LAYOUT(trackers, 364),
                                                        LAYOUT(vision_detect, 328),
                                                        LAYOUT(watchdog, 8),
                                                        LAYOUT(adc_data, 40),
                                                        LAYOUT(video_stream, 65),
                                                        LAYOUT(games, 12),
                                                        LAYOUT(pressure, 18),
                                                        LAYOUT(magneto, 75),
                                                        LAYOUT(wind, 56),
                                                        LAYOUT(kalman_pressure, 72),
                                                        LAYOUT(hd_video, 32),
                                                        LAYOUT(wifi, 8)};
static const navdata_layout layout_zimmu = LAYOUT(zimmu, 12);
static const navdata_layout layout_gps_247 = LAYOUT(gps_247, 480);
static const navdata_layout layout_gps_248 = LAYOUT(gps_248, 216);

const navdata_layout *ardrone_navdata_layout(uint32_t tag, size_t bytes) {
  if (tag < ARDRONE_TAG_GPS) return &layouts[tag];
  if (tag != ARDRONE_TAG_GPS) return NULL;
  switch (bytes) {
    case 12: return &layout_zimmu;
    case 480: return &layout_gps_247;
    case 216: return &layout_gps_248;
    default: return NULL;
  }
}
