#include "twoview_drivers/ardrone/config.h"

#include <string.h>

static int is_space(char c) { return c == ' ' || c == '\t'; }

static ardrone_span trim(const char *text, size_t size) {
  ardrone_span span;
  while (size > 0 && is_space(*text)) {
    ++text;
    --size;
  }
  while (size > 0 && is_space(text[size - 1])) --size;
  span.text = text;
  span.size = size;
  return span;
}

/* The next line, ended by CR, LF or both; TVS_END at the end of the text or its zero byte. */
static tvs_status next_line(const char *text, size_t size, size_t *offset, ardrone_span *line) {
  size_t from = *offset, to;
  while (from < size && (text[from] == '\n' || text[from] == '\r')) ++from;
  if (from >= size || text[from] == '\0') return TVS_END;
  for (to = from; to < size && text[to] != '\n' && text[to] != '\r' && text[to] != '\0';) ++to;
  line->text = text + from;
  line->size = to - from;
  *offset = to;
  return TVS_OK;
}

static int split(ardrone_span line, char at, ardrone_span *left, ardrone_span *right) {
  const char *found = memchr(line.text, at, line.size);
  if (!found) return 0;
  *left = trim(line.text, (size_t)(found - line.text));
  *right = trim(found + 1, line.size - (size_t)(found - line.text) - 1);
  return 1;
}

tvs_status ardrone_config_next(const char *text, size_t size, size_t *offset, ardrone_span *key,
                               ardrone_span *value) {
  ardrone_span line;
  if (!text || !offset || !key || !value) return TVS_ERR_NULL;
  while (next_line(text, size, offset, &line) == TVS_OK) {
    ardrone_span left, right;
    if (split(line, '=', &left, &right) && left.size > 0 && memchr(left.text, ':', left.size)) {
      *key = left;
      *value = right;
      return TVS_OK;
    }
  }
  return TVS_END;
}

tvs_status ardrone_config_find(const char *text, size_t size, const char *key, char *value,
                               size_t cap_value) {
  ardrone_span found, what;
  size_t offset = 0;
  if (!text || !key || !value) return TVS_ERR_NULL;
  while (ardrone_config_next(text, size, &offset, &found, &what) == TVS_OK) {
    if (found.size != strlen(key) || memcmp(found.text, key, found.size) != 0) continue;
    if (what.size >= cap_value) return TVS_ERR_CAPACITY;
    memcpy(value, what.text, what.size);
    value[what.size] = '\0';
    return TVS_OK;
  }
  return TVS_NONE;
}

static int is_text(ardrone_span span, const char *text) {
  return span.size == strlen(text) && memcmp(span.text, text, span.size) == 0;
}

tvs_status ardrone_ids_next(const char *text, size_t size, size_t *offset, ardrone_id_kind *kind,
                            ardrone_span *id, ardrone_span *description) {
  ardrone_span line;
  if (!text || !offset || !kind || !id || !description) return TVS_ERR_NULL;
  while (next_line(text, size, offset, &line) == TVS_OK) {
    line = trim(line.text, line.size);
    if (is_text(line, "[applis]")) {
      *kind = ARDRONE_ID_APPLICATION;
    } else if (is_text(line, "[profiles]")) {
      *kind = ARDRONE_ID_PROFILE;
    } else if (is_text(line, "[sessions]")) {
      *kind = ARDRONE_ID_SESSION;
    } else if (split(line, ',', id, description) && id->size == ARDRONE_ID_BYTES - 1) {
      return TVS_OK;
    }
  }
  return TVS_END;
}

/* ---- the known keys and their ranges ---- */

typedef enum key_kind {
  KEY_BOOL,
  KEY_INT,
  KEY_REAL,
  KEY_GPS,
  KEY_TEXT,
  KEY_ID,
  KEY_READ_ONLY
} key_kind;

typedef struct key_rule {
  const char *key;
  key_kind kind;
  double low, high;
  int needs_ids;
} key_rule;

static const key_rule rules[] = {
    {"general:navdata_demo", KEY_BOOL, 0, 0, 0},
    {"general:navdata_options", KEY_INT, 0, 4294967295.0, 0},
    {"general:com_watchdog", KEY_INT, 1, 60, 0},
    {"general:video_enable", KEY_BOOL, 0, 0, 0},
    {"general:vision_enable", KEY_BOOL, 0, 0, 0},
    {"general:ardrone_name", KEY_TEXT, 0, 0, 0},
    {"general:num_version_soft", KEY_READ_ONLY, 0, 0, 0},
    {"general:num_version_mb", KEY_READ_ONLY, 0, 0, 0},
    {"general:drone_serial", KEY_READ_ONLY, 0, 0, 0},
    {"general:soft_build_date", KEY_READ_ONLY, 0, 0, 0},
    {"general:flying_time", KEY_READ_ONLY, 0, 0, 0},
    {"general:vbat_min", KEY_READ_ONLY, 0, 0, 0},
    {"control:accs_offset", KEY_READ_ONLY, 0, 0, 0},
    {"control:accs_gains", KEY_READ_ONLY, 0, 0, 0},
    {"control:gyros_offset", KEY_READ_ONLY, 0, 0, 0},
    {"control:gyros_gains", KEY_READ_ONLY, 0, 0, 0},
    {"control:magneto_offset", KEY_READ_ONLY, 0, 0, 0},
    {"control:magneto_radius", KEY_READ_ONLY, 0, 0, 0},
    {"control:altitude_max", KEY_INT, 500, 100000, 0},
    {"control:altitude_min", KEY_INT, 50, 100000, 0},
    {"control:euler_angle_max", KEY_REAL, 0, 0.52, 0},
    {"control:control_vz_max", KEY_REAL, 200, 2000, 0},
    {"control:control_yaw", KEY_REAL, 0.7, 6.11, 0},
    {"control:indoor_euler_angle_max", KEY_REAL, 0, 0.52, 0},
    {"control:indoor_control_vz_max", KEY_REAL, 200, 2000, 0},
    {"control:indoor_control_yaw", KEY_REAL, 0.7, 6.11, 0},
    {"control:outdoor_euler_angle_max", KEY_REAL, 0, 0.52, 0},
    {"control:outdoor_control_vz_max", KEY_REAL, 200, 2000, 0},
    {"control:outdoor_control_yaw", KEY_REAL, 0.7, 6.11, 0},
    {"control:outdoor", KEY_BOOL, 0, 0, 0},
    {"control:flight_without_shell", KEY_BOOL, 0, 0, 0},
    {"control:control_iphone_tilt", KEY_REAL, 0, 1.5, 0},
    {"control:flight_anim", KEY_TEXT, 0, 0, 0},
    {"control:flying_mode", KEY_INT, 0, 2, 0},
    {"control:hovering_range", KEY_INT, 0, 10000, 0},
    {"video:video_codec", KEY_INT, 0, 255, 1},
    {"video:codec_fps", KEY_INT, 15, 30, 1},
    {"video:bitrate", KEY_INT, 1, 20000, 1},
    {"video:bitrate_storage", KEY_INT, 1, 20000, 1},
    {"video:max_bitrate", KEY_INT, 1, 20000, 1},
    {"video:bitrate_ctrl_mode", KEY_INT, 0, 2, 1},
    {"video:video_channel", KEY_INT, 0, 3, 0},
    {"video:video_on_usb", KEY_BOOL, 0, 0, 0},
    {"video:video_slices", KEY_INT, 0, 255, 1},
    {"video:video_live_socket", KEY_INT, 0, 65535, 1},
    {"leds:leds_anim", KEY_TEXT, 0, 0, 0},
    {"detect:detect_type", KEY_INT, 0, 13, 0},
    {"detect:enemy_colors", KEY_INT, 1, 3, 0},
    {"detect:enemy_without_shell", KEY_INT, 0, 1, 0},
    {"pic:ultrasound_freq", KEY_INT, 7, 8, 0},
    {"userbox:userbox_cmd", KEY_TEXT, 0, 0, 0},
    {"gps:latitude", KEY_GPS, -90, 90, 0},
    {"gps:longitude", KEY_GPS, -180, 180, 0},
    {"gps:altitude", KEY_GPS, -1000, 100000, 0},
    {"custom:session_id", KEY_ID, 0, 0, 0},
    {"custom:profile_id", KEY_ID, 0, 0, 0},
    {"custom:application_id", KEY_ID, 0, 0, 0},
};

static const key_rule *find_rule(const char *key) {
  size_t k;
  for (k = 0; k < sizeof rules / sizeof rules[0]; ++k) {
    if (strcmp(rules[k].key, key) == 0) return &rules[k];
  }
  return NULL;
}

/* A decimal number and nothing else. strtod is not used, since it depends on the locale. */
static int parse_number(const char *text, int allow_fraction, double *value) {
  double sum = 0, place = 1;
  int negative = 0, num_digits = 0, fraction = 0;
  if (*text == '-') {
    negative = 1;
    ++text;
  }
  for (; *text; ++text) {
    if (*text == '.' && allow_fraction && !fraction) {
      fraction = 1;
    } else if (*text >= '0' && *text <= '9' && ++num_digits <= 30) {
      sum = 10 * sum + (*text - '0');
      if (fraction) place *= 10;
    } else {
      return 0;
    }
  }
  *value = (negative ? -sum : sum) / place;
  return num_digits > 0;
}

/* An id; or "-" and an id, which deletes that id; or "-all", which deletes all ids. */
static int is_id_value(const char *value) {
  if (strcmp(value, "-all") == 0) return 1;
  if (*value == '-') ++value;
  return strlen(value) == 8 && strspn(value, "0123456789abcdefABCDEF") == 8;
}

static int obeys(const key_rule *rule, const char *value) {
  double number;
  switch (rule->kind) {
    case KEY_BOOL: return strcmp(value, "TRUE") == 0 || strcmp(value, "FALSE") == 0;
    case KEY_INT:
    case KEY_REAL:
      return parse_number(value, rule->kind == KEY_REAL, &number) && number >= rule->low &&
             number <= rule->high;
    case KEY_GPS: /* 500 is the drone's number for "not valid" */
      return parse_number(value, 1, &number) &&
             ((number >= rule->low && number <= rule->high) || number == 500);
    case KEY_TEXT: return 1;
    case KEY_ID: return is_id_value(value);
    case KEY_READ_ONLY: break;
  }
  return 0;
}

tvs_status ardrone_config_check(const char *key, const char *value) {
  const key_rule *rule;
  ardrone_at scratch;
  tvs_status status;
  if (!key || !value) return TVS_ERR_NULL;
  scratch.size = 0;
  scratch.sequence = 0;
  status = ardrone_at_config(&scratch, key, value);
  if (status != TVS_OK) return status;
  rule = find_rule(key);
  if (!rule) return TVS_NONE;
  return obeys(rule, value) ? TVS_OK : TVS_ERR_ARGUMENT;
}

int ardrone_config_needs_ids(const char *key) {
  const key_rule *rule = key ? find_rule(key) : NULL;
  return rule && rule->needs_ids;
}

/* ---- texts of values and ids ---- */

tvs_status ardrone_format_number(double value, int digits, char *text, size_t cap_text) {
  char reversed[40];
  size_t size = 0, k;
  double scaled = value < 0 ? -value : value;
  uint64_t left;
  int d;
  if (!text) return TVS_ERR_NULL;
  if (!(scaled < 1e9) || digits < 0 || digits > 9) return TVS_ERR_ARGUMENT;
  for (d = 0; d < digits; ++d) scaled *= 10;
  left = (uint64_t)(scaled + 0.5);
  for (d = 0; d < digits; ++d, left /= 10) reversed[size++] = (char)('0' + left % 10);
  if (digits > 0) reversed[size++] = '.';
  do {
    reversed[size++] = (char)('0' + left % 10);
    left /= 10;
  } while (left > 0);
  if (value < 0) reversed[size++] = '-';
  if (size >= cap_text) return TVS_ERR_CAPACITY;
  for (k = 0; k < size; ++k) text[k] = reversed[size - 1 - k];
  text[size] = '\0';
  return TVS_OK;
}

tvs_status ardrone_format_led(int animation, float hertz, int seconds, char *text,
                              size_t cap_text) {
  const double parts[3] = {animation, (double)ardrone_float_bits(hertz), seconds};
  char built[ARDRONE_VALUE_BYTES];
  size_t size = 0;
  int k;
  if (!text) return TVS_ERR_NULL;
  if (animation < 0 || animation >= ARDRONE_NUM_LED_ANIMATIONS || !(hertz > 0 && hertz <= 100) ||
      seconds < 0 || seconds > 3600) {
    return TVS_ERR_ARGUMENT;
  }
  for (k = 0; k < 3; ++k) {
    uint64_t left = (uint64_t)parts[k]; /* the bits of a positive float are a positive number */
    char digits[20];
    size_t num = 0;
    do digits[num++] = (char)('0' + left % 10);
    while ((left /= 10) > 0);
    if (k > 0) built[size++] = ',';
    while (num > 0) built[size++] = digits[--num];
  }
  if (size >= cap_text) return TVS_ERR_CAPACITY;
  memcpy(text, built, size);
  text[size] = '\0';
  return TVS_OK;
}

void ardrone_make_id(const char *name, char id[ARDRONE_ID_BYTES]) {
  uint32_t crc = 0xffffffffu;
  int bit, k;
  for (; *name; ++name) {
    crc ^= (unsigned char)*name;
    for (bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320u : 0);
  }
  crc = ~crc;
  if (crc == 0) crc = 1; /* the id 00000000 names the drone's default configuration */
  for (k = 0; k < 8; ++k) id[k] = "0123456789abcdef"[crc >> (28 - 4 * k) & 15];
  id[8] = '\0';
}
