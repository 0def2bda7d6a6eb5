#include "twoview_drivers/ardrone/at.h"

#include <string.h>

/* The bits of the command REF that are always set. */
static const int32_t REF_BASE = (1 << 18) | (1 << 20) | (1 << 22) | (1 << 24) | (1 << 28);
static const int32_t REF_TAKE_OFF = 1 << 9, REF_EMERGENCY = 1 << 8;

enum { MAX_KEY_BYTES = 64, MAX_VALUE_BYTES = 256, ID_BYTES = 8 };

/* A command is written after the text that the datagram already holds. at->size grows only when the
   whole command fits. */
typedef struct writer {
  ardrone_at *at;
  size_t size;
  int32_t sequence;
  int fits;
} writer;

static void put(writer *w, const char *bytes, size_t size) {
  if (!w->fits || size > ARDRONE_AT_MAX_BYTES - w->size) {
    w->fits = 0;
    return;
  }
  memcpy(w->at->text + w->size, bytes, size);
  w->size += size;
}

static void put_text(writer *w, const char *text) { put(w, text, strlen(text)); }

static void put_int(writer *w, int32_t value) {
  char digits[11];
  size_t at = sizeof digits;
  uint32_t left = value < 0 ? 0u - (uint32_t)value : (uint32_t)value;
  do {
    digits[--at] = (char)('0' + left % 10);
    left /= 10;
  } while (left > 0);
  if (value < 0) digits[--at] = '-';
  put(w, digits + at, sizeof digits - at);
}

static void put_argument(writer *w, int32_t value) {
  put_text(w, ",");
  put_int(w, value);
}

static void put_float(writer *w, float value) { put_argument(w, ardrone_float_bits(value)); }

static void put_quoted(writer *w, const char *text) {
  put_text(w, ",\"");
  put_text(w, text);
  put_text(w, "\"");
}

static writer begin(ardrone_at *at, const char *name) {
  writer w;
  w.at = at;
  w.size = at->size;
  w.sequence = at->sequence < 0 || at->sequence >= INT32_MAX - 1 ? 1 : at->sequence + 1;
  w.fits = at->size <= ARDRONE_AT_MAX_BYTES;
  put_text(&w, "AT*");
  put_text(&w, name);
  put_text(&w, "=");
  put_int(&w, w.sequence);
  return w;
}

static tvs_status finish(writer *w) {
  put_text(w, "\r");
  if (!w->fits) return TVS_ERR_CAPACITY;
  w->at->size = w->size;
  w->at->sequence = w->sequence;
  return TVS_OK;
}

static tvs_status plain(ardrone_at *at, const char *name) {
  writer w;
  if (!at) return TVS_ERR_NULL;
  w = begin(at, name);
  return finish(&w);
}

int32_t ardrone_float_bits(float value) {
  int32_t bits;
  if (value == 0) return 0;
  memcpy(&bits, &value, sizeof bits);
  return bits;
}

tvs_status ardrone_at_ref(ardrone_at *at, int take_off, int emergency) {
  writer w;
  if (!at) return TVS_ERR_NULL;
  w = begin(at, "REF");
  put_argument(&w, REF_BASE | (take_off ? REF_TAKE_OFF : 0) | (emergency ? REF_EMERGENCY : 0));
  return finish(&w);
}

static int in_range(float value, float low, float high) { return value >= low && value <= high; }

static int is_valid_move(const ardrone_move *move) {
  return in_range(move->roll, -1, 1) && in_range(move->pitch, -1, 1) &&
         in_range(move->climb, -1, 1) && in_range(move->turn, -1, 1);
}

static void put_move(writer *w, const ardrone_move *move, int flags) {
  static const ardrone_move still = {0, 0, 0, 0};
  put_argument(w, move ? flags | 1 : 0);
  if (!move) move = &still;
  put_float(w, move->roll);
  put_float(w, move->pitch);
  put_float(w, move->climb);
  put_float(w, move->turn);
}

static int is_valid_pcmd(const ardrone_move *move, int flags) {
  return (!move || is_valid_move(move)) &&
         (flags & ~(ARDRONE_PCMD_COMBINED_YAW | ARDRONE_PCMD_ABSOLUTE)) == 0;
}

tvs_status ardrone_at_pcmd(ardrone_at *at, const ardrone_move *move, int flags) {
  writer w;
  if (!at) return TVS_ERR_NULL;
  if (!is_valid_pcmd(move, flags)) return TVS_ERR_ARGUMENT;
  w = begin(at, "PCMD");
  put_move(&w, move, flags);
  return finish(&w);
}

tvs_status ardrone_at_pcmd_mag(ardrone_at *at, const ardrone_move *move, int flags, float heading,
                               float accuracy) {
  writer w;
  if (!at) return TVS_ERR_NULL;
  if (!is_valid_pcmd(move, flags) || !in_range(heading, -1, 1) || !in_range(accuracy, 0, 1)) {
    return TVS_ERR_ARGUMENT;
  }
  w = begin(at, "PCMD_MAG");
  put_move(&w, move, flags);
  put_float(&w, heading);
  put_float(&w, accuracy);
  return finish(&w);
}

tvs_status ardrone_at_ftrim(ardrone_at *at) { return plain(at, "FTRIM"); }

tvs_status ardrone_at_comwdg(ardrone_at *at) { return plain(at, "COMWDG"); }

tvs_status ardrone_at_calib(ardrone_at *at, int device) {
  writer w;
  if (!at) return TVS_ERR_NULL;
  if (device != 0) return TVS_ERR_ARGUMENT;
  w = begin(at, "CALIB");
  put_argument(&w, device);
  return finish(&w);
}

/* Whether text can stand in a quoted argument. A quote or a control character in it would begin
   another command. */
static int is_quotable(const char *text, size_t max_bytes) {
  size_t k = 0;
  for (; text[k]; ++k) {
    const unsigned char c = (unsigned char)text[k];
    if (k == max_bytes || c < ' ' || c == '"' || c == 0x7f) return 0;
  }
  return 1;
}

static int is_key(const char *key) {
  const char *colon = strchr(key, ':');
  return is_quotable(key, MAX_KEY_BYTES) && colon && colon != key && colon[1] != '\0' &&
         !strpbrk(key, " ,");
}

static int is_id(const char *id) {
  return strlen(id) == ID_BYTES && strspn(id, "0123456789abcdefABCDEF") == ID_BYTES;
}

tvs_status ardrone_at_config(ardrone_at *at, const char *key, const char *value) {
  writer w;
  if (!at || !key || !value) return TVS_ERR_NULL;
  if (!is_key(key) || !is_quotable(value, MAX_VALUE_BYTES)) return TVS_ERR_ARGUMENT;
  w = begin(at, "CONFIG");
  put_quoted(&w, key);
  put_quoted(&w, value);
  return finish(&w);
}

tvs_status ardrone_at_config_ids(ardrone_at *at, const char *session, const char *user,
                                 const char *application) {
  writer w;
  if (!at || !session || !user || !application) return TVS_ERR_NULL;
  if (!is_id(session) || !is_id(user) || !is_id(application)) return TVS_ERR_ARGUMENT;
  w = begin(at, "CONFIG_IDS");
  put_quoted(&w, session);
  put_quoted(&w, user);
  put_quoted(&w, application);
  return finish(&w);
}

tvs_status ardrone_at_ctrl(ardrone_at *at, ardrone_control_mode mode) {
  writer w;
  if (!at) return TVS_ERR_NULL;
  if (mode != ARDRONE_CTRL_NONE && mode != ARDRONE_CTRL_SEND_CONFIG &&
      mode != ARDRONE_CTRL_ACKNOWLEDGE && mode != ARDRONE_CTRL_SEND_IDS) {
    return TVS_ERR_ARGUMENT;
  }
  w = begin(at, "CTRL");
  put_argument(&w, (int32_t)mode);
  put_argument(&w, 0);
  return finish(&w);
}

tvs_status ardrone_at_anim(ardrone_at *at, int animation, int milliseconds) {
  writer w;
  if (!at) return TVS_ERR_NULL;
  if (animation < 0 || animation >= ARDRONE_NUM_FLIGHT_ANIMATIONS || milliseconds < 0 ||
      milliseconds > 60000) {
    return TVS_ERR_ARGUMENT;
  }
  w = begin(at, "ANIM");
  put_argument(&w, animation);
  put_argument(&w, milliseconds);
  return finish(&w);
}

tvs_status ardrone_at_led(ardrone_at *at, int animation, float hertz, int seconds) {
  writer w;
  if (!at) return TVS_ERR_NULL;
  if (animation < 0 || animation >= ARDRONE_NUM_LED_ANIMATIONS || !(hertz > 0 && hertz <= 100) ||
      seconds < 0 || seconds > 3600) {
    return TVS_ERR_ARGUMENT;
  }
  w = begin(at, "LED");
  put_argument(&w, animation);
  put_float(&w, hertz);
  put_argument(&w, seconds);
  return finish(&w);
}

tvs_status ardrone_at_legacy(ardrone_at *at, ardrone_legacy command, const int32_t *arguments,
                             int num_arguments) {
  static const struct {
    const char *name;
    int num_arguments;
  } commands[ARDRONE_NUM_LEGACY] = {{"PMODE", 1}, {"MISC", 4}, {"GAIN", 13},   {"VISP", 9},
                                    {"VISO", 1},  {"CAP", 2},  {"ZAP", 1},     {"CAD", 2},
                                    {"MTRIM", 3}, {"POL", 5},  {"AFLIGHT", 1}, {"VICON", 22}};
  writer w;
  int k;
  if (!at || !arguments) return TVS_ERR_NULL;
  if ((int)command < 0 || command >= ARDRONE_NUM_LEGACY ||
      num_arguments != commands[command].num_arguments) {
    return TVS_ERR_ARGUMENT;
  }
  w = begin(at, commands[command].name);
  for (k = 0; k < num_arguments; ++k) put_argument(&w, arguments[k]);
  return finish(&w);
}
