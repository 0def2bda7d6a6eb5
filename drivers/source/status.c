#include "twoview_drivers/status.h"

const char *tvs_status_string(tvs_status status) {
  switch (status) {
    case TVS_OK: return "ok";
    case TVS_NONE: return "nothing now";
    case TVS_END: return "end";
    case TVS_ERR_NULL: return "null pointer";
    case TVS_ERR_ARGUMENT: return "value out of range";
    case TVS_ERR_STRUCT_SIZE: return "struct_size is not set";
    case TVS_ERR_CAPACITY: return "does not fit";
    case TVS_ERR_DATA: return "malformed data";
    case TVS_ERR_CHECKSUM: return "wrong checksum";
    case TVS_ERR_IO: return "input or output failed";
    case TVS_ERR_STATE: return "not possible now";
    case TVS_ERR_TIMEOUT: return "no answer in time";
  }
  return "unknown status";
}
