/* Links against the installed drivers and writes the command by which a drone lands. */
#include <stdio.h>
#include <string.h>

#include "twoview_drivers/ardrone/session.h"

int main(void) {
  static const char expected[] = "AT*REF=1,290717696\r";
  ardrone_at at = {{0}, 0, 0};
  ardrone_session_options options;
  size_t size_bytes = 0;
  ardrone_session_options_init(&options);
  printf("drivers: a session of %s\n",
         tvs_status_string(ardrone_session_size(&options, &size_bytes)));
  return size_bytes == 0 || ardrone_at_ref(&at, 0, 0) != TVS_OK || at.size != sizeof expected - 1 ||
         memcmp(at.text, expected, at.size) != 0;
}
