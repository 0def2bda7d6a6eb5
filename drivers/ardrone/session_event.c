/* A session's events, which all of its parts report. */
#include "session_impl.h"

void ardrone_tell(ardrone_session *session, ardrone_event event, const char *key) {
  if (session->options.on_event) session->options.on_event(session->options.user, event, key);
}
