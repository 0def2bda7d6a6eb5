/* The handshake of ardrone/config.h. The drone sets its acknowledge bit when it has accepted a
   value, and keeps the bit set until CTRL 5 clears it. UDP may lose any message of the handshake,
   so each step is repeated until the exchange is done or ARDRONE_EXCHANGE_TIMEOUT_NS is over. */
#include <string.h>

#include "twoview_drivers/ardrone/config.h"
#include "twoview_drivers/ardrone/navdata.h"

static const int64_t ACKNOWLEDGE_PERIOD_NS = 50000000;

static void enter(ardrone_exchange *exchange, ardrone_exchange_state state, int64_t now_ns) {
  exchange->state = state;
  exchange->step_ns = now_ns;
  exchange->next_send_ns = now_ns;
}

static tvs_status check(ardrone_exchange_kind kind, const char *key, const char *value) {
  tvs_status status;
  if (kind == ARDRONE_EXCHANGE_READ_CONFIG || kind == ARDRONE_EXCHANGE_READ_IDS) return TVS_OK;
  if (kind != ARDRONE_EXCHANGE_SET) return TVS_ERR_ARGUMENT;
  if (!key || !value) return TVS_ERR_NULL;
  status = ardrone_config_check(key, value);
  return status == TVS_NONE ? TVS_OK : status;
}

tvs_status ardrone_exchange_begin(ardrone_exchange *exchange, ardrone_exchange_kind kind,
                                  const char *key, const char *value, const char *const ids[3],
                                  int64_t now_ns) {
  tvs_status status;
  if (!exchange) return TVS_ERR_NULL;
  if (exchange->state != ARDRONE_EXCHANGE_IDLE && exchange->state != ARDRONE_EXCHANGE_DONE &&
      exchange->state != ARDRONE_EXCHANGE_FAILED) {
    return TVS_ERR_STATE;
  }
  status = check(kind, key, value);
  if (status != TVS_OK) return status;
  if (ids) {
    ardrone_at scratch;
    scratch.size = 0;
    scratch.sequence = 0;
    status = ardrone_at_config_ids(&scratch, ids[0], ids[1], ids[2]);
    if (status != TVS_OK) return status;
  }
  memset(exchange, 0, sizeof *exchange);
  exchange->kind = kind;
  if (kind == ARDRONE_EXCHANGE_SET) {
    strcpy(exchange->key, key); /* check() has checked the lengths */
    strcpy(exchange->value, value);
  }
  if (ids) {
    exchange->has_ids = 1;
    strcpy(exchange->session, ids[0]);
    strcpy(exchange->user, ids[1]);
    strcpy(exchange->application, ids[2]);
  }
  exchange->deadline_ns = now_ns + ARDRONE_EXCHANGE_TIMEOUT_NS;
  enter(exchange, ARDRONE_EXCHANGE_CLEARING, now_ns);
  return TVS_OK;
}

void ardrone_exchange_navdata(ardrone_exchange *exchange, uint32_t state, int64_t now_ns) {
  const int acknowledged = (state & ARDRONE_STATE_ACKNOWLEDGE) != 0;
  if (!exchange) return;
  exchange->saw_bit = acknowledged;
  switch (exchange->state) {
    case ARDRONE_EXCHANGE_CLEARING:
      if (!acknowledged) enter(exchange, ARDRONE_EXCHANGE_SENDING, now_ns);
      break;
    case ARDRONE_EXCHANGE_WAITING:
      if (acknowledged && exchange->kind == ARDRONE_EXCHANGE_SET) {
        enter(exchange, ARDRONE_EXCHANGE_RELEASING, now_ns);
      }
      break;
    case ARDRONE_EXCHANGE_RELEASING:
      if (!acknowledged) enter(exchange, ARDRONE_EXCHANGE_DONE, now_ns);
      break;
    default: break;
  }
}

void ardrone_exchange_text(ardrone_exchange *exchange, int64_t now_ns) {
  if (exchange && exchange->state == ARDRONE_EXCHANGE_WAITING &&
      exchange->kind != ARDRONE_EXCHANGE_SET) {
    enter(exchange, ARDRONE_EXCHANGE_RELEASING, now_ns);
  }
}

/* Writes the ids and the command into the same datagram; when they do not fit, writes nothing. */
static tvs_status write_command(const ardrone_exchange *exchange, ardrone_at *at) {
  const size_t size = at->size;
  const int32_t sequence = at->sequence;
  tvs_status status = TVS_OK;
  if (exchange->kind == ARDRONE_EXCHANGE_READ_CONFIG) {
    return ardrone_at_ctrl(at, ARDRONE_CTRL_SEND_CONFIG);
  }
  if (exchange->kind == ARDRONE_EXCHANGE_READ_IDS) {
    return ardrone_at_ctrl(at, ARDRONE_CTRL_SEND_IDS);
  }
  if (exchange->has_ids) {
    status = ardrone_at_config_ids(at, exchange->session, exchange->user, exchange->application);
  }
  if (status == TVS_OK) status = ardrone_at_config(at, exchange->key, exchange->value);
  if (status != TVS_OK) {
    at->size = size;
    at->sequence = sequence;
  }
  return status;
}

static tvs_status send_acknowledge(ardrone_exchange *exchange, ardrone_at *at, int64_t now_ns) {
  tvs_status status;
  if (!exchange->saw_bit || now_ns < exchange->next_send_ns) return TVS_OK;
  status = ardrone_at_ctrl(at, ARDRONE_CTRL_ACKNOWLEDGE);
  if (status == TVS_OK) exchange->next_send_ns = now_ns + ACKNOWLEDGE_PERIOD_NS;
  return status;
}

tvs_status ardrone_exchange_tick(ardrone_exchange *exchange, ardrone_at *at, int64_t now_ns) {
  tvs_status status;
  if (!exchange || !at) return TVS_ERR_NULL;
  if (exchange->state == ARDRONE_EXCHANGE_IDLE || exchange->state == ARDRONE_EXCHANGE_DONE ||
      exchange->state == ARDRONE_EXCHANGE_FAILED) {
    return TVS_OK;
  }
  if (now_ns >= exchange->deadline_ns) {
    enter(exchange, ARDRONE_EXCHANGE_FAILED, now_ns);
    return TVS_OK;
  }
  if (exchange->state == ARDRONE_EXCHANGE_CLEARING ||
      exchange->state == ARDRONE_EXCHANGE_RELEASING) {
    return send_acknowledge(exchange, at, now_ns);
  }
  if (exchange->state == ARDRONE_EXCHANGE_WAITING &&
      now_ns - exchange->step_ns < ARDRONE_EXCHANGE_STEP_NS) {
    return TVS_OK;
  }
  status = write_command(exchange, at);
  if (status != TVS_OK) return status; /* no room: it goes into the next datagram */
  ++exchange->num_sent;
  enter(exchange, ARDRONE_EXCHANGE_WAITING, now_ns);
  return TVS_OK;
}
