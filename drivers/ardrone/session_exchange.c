/* The settings of a new link, and then the caller's requests, one exchange after the other. */
#include <string.h>

#include "session_impl.h"

static void add_setup(ardrone_session *session, const char *key, const char *value) {
  request *r = &session->setup[session->num_setup++];
  r->kind = ARDRONE_EXCHANGE_SET;
  strcpy(r->key, key); /* key and value are short texts of this file */
  strcpy(r->value, value);
}

static void add_number(ardrone_session *session, const char *key, double value) {
  char text[24];
  ardrone_format_number(value, 0, text, sizeof text);
  add_setup(session, key, text);
}

static int is_idle(const ardrone_exchange *exchange) {
  return exchange->state == ARDRONE_EXCHANGE_IDLE || exchange->state == ARDRONE_EXCHANGE_DONE ||
         exchange->state == ARDRONE_EXCHANGE_FAILED;
}

/* Begins the set-up of a new link. The key navdata_demo comes first, since it ends the bootstrap. A
   request that was under way begins again after the set-up. */
void ardrone_exchanges_new_link(ardrone_session *session) {
  const ardrone_session_options *o = &session->options;
  session->exchange.state = ARDRONE_EXCHANGE_IDLE;
  session->runs_setup = session->runs_request = 0;
  session->num_setup = session->idx_setup = 0;
  if (o->listen_only) return;
  add_setup(session, "general:navdata_demo", o->full_navdata ? "FALSE" : "TRUE");
  if (o->use_ids) {
    add_setup(session, "custom:session_id", session->ids[0]);
    add_setup(session, "custom:profile_id", session->ids[1]);
    add_setup(session, "custom:application_id", session->ids[2]);
  }
  if (o->navdata_options) add_number(session, "general:navdata_options", o->navdata_options);
  if (o->video_codec) add_number(session, "video:video_codec", o->video_codec);
}

static void begin(ardrone_session *session, const request *r) {
  const ardrone_transport *t = &session->transport;
  const char *ids[3];
  int k;
  for (k = 0; k < 3; ++k) ids[k] = session->ids[k];
  ardrone_exchange_begin(&session->exchange, r->kind, r->key, r->value,
                         session->options.use_ids ? ids : NULL, session->now_ns);
  if (r->kind == ARDRONE_EXCHANGE_SET) return;
  session->text_size = 0;
  session->has_text = 0;
  t->open(t->user, ARDRONE_CHANNEL_CONTROL, session->now_ns);
}

static void tell_result(ardrone_session *session, const request *r, int done) {
  switch (r->kind) {
    case ARDRONE_EXCHANGE_SET:
      ardrone_tell(session, done ? ARDRONE_EVENT_SET_DONE : ARDRONE_EVENT_SET_FAILED, r->key);
      break;
    case ARDRONE_EXCHANGE_READ_CONFIG:
    case ARDRONE_EXCHANGE_READ_IDS:
      session->transport.close(session->transport.user, ARDRONE_CHANNEL_CONTROL);
      session->has_text = done;
      ardrone_tell(session,
                   !done                                     ? ARDRONE_EVENT_READ_FAILED
                   : r->kind == ARDRONE_EXCHANGE_READ_CONFIG ? ARDRONE_EVENT_CONFIG
                                                             : ARDRONE_EVENT_IDS,
                   NULL);
      break;
  }
}

static void finish_exchange(ardrone_session *session) {
  const int done = session->exchange.state == ARDRONE_EXCHANGE_DONE;
  if (session->runs_setup) {
    const request *r = &session->setup[session->idx_setup++];
    session->runs_setup = 0;
    if (!done) tell_result(session, r, 0);
  } else if (session->runs_request) {
    const request r = session->requests[session->first_request];
    session->first_request = (session->first_request + 1) % QUEUE_REQUESTS;
    --session->num_requests;
    session->runs_request = 0;
    tell_result(session, &r, done);
  }
  session->exchange.state = ARDRONE_EXCHANGE_IDLE;
}

static void complete_setup(ardrone_session *session) {
  if (session->num_setup > 0 &&
      (session->navdata.state &
       ARDRONE_STATE_BOOTSTRAP)) { /* still in bootstrap: repeat the set-up */
    session->idx_setup = 0;
    return;
  }
  session->is_up = 1;
  ardrone_tell(session, ARDRONE_EVENT_LINK_UP, NULL);
}

void ardrone_exchanges_advance(ardrone_session *session) {
  if (!session->has_link || !is_idle(&session->exchange)) return;
  if (session->runs_setup || session->runs_request) finish_exchange(session);
  if (session->idx_setup == session->num_setup && !session->is_up) complete_setup(session);
  if (session->idx_setup < session->num_setup) {
    session->runs_setup = 1;
    begin(session, &session->setup[session->idx_setup]);
  } else if (session->num_requests > 0) {
    session->runs_request = 1;
    begin(session, &session->requests[session->first_request]);
  }
}

static int is_reading(const ardrone_session *session) {
  return session->runs_request && !is_idle(&session->exchange) &&
         session->exchange.kind != ARDRONE_EXCHANGE_SET;
}

/* Receives the text of a read, which the drone ends with a zero byte. An empty text is dropped, and
   so is one that does not fit in TEXT_BYTES; the exchange then requests it again. */
void ardrone_exchanges_receive(ardrone_session *session) {
  const ardrone_transport *t = &session->transport;
  while (is_reading(session) && session->exchange.state != ARDRONE_EXCHANGE_RELEASING) {
    size_t size = 0;
    char *to = session->text + session->text_size;
    const tvs_status status = t->receive(t->user, ARDRONE_CHANNEL_CONTROL, to,
                                         sizeof session->text - session->text_size, &size);
    const char *end;
    if (status == TVS_NONE) return;
    /* The exchange repeats its request, or ends when its time is over. */
    if (status != TVS_OK || size == 0) {
      session->text_size = 0;
      t->open(t->user, ARDRONE_CHANNEL_CONTROL, session->now_ns);
      return;
    }
    end = memchr(to, '\0', size);
    session->text_size += size;
    if (end && end != session->text) {
      session->text_size = (size_t)(end - session->text);
      ardrone_exchange_text(&session->exchange, session->now_ns);
    } else if (end || session->text_size == sizeof session->text) {
      session->text_size = 0;
    }
  }
}
