# Sets MAVLINK_INCLUDE_DIR to the folder that holds mavlink.h of the dialect ardupilotmega, which
# includes common, or of common: MAVLink's C headers as they are installed, else those that the
# generator of pymavlink writes to the build tree. pymavlink is what `scripts/bootstrap mavlink`
# puts into .cache/mavlink, else what Python finds. Sets it to "" where neither is found.

find_path(TWOVIEW_MAVLINK_INCLUDE_DIR NAMES ardupilotmega/mavlink.h common/mavlink.h
  PATH_SUFFIXES mavlink/v2.0 mavlink/v2 mavlink
  DOC "Folder of MAVLink's C headers, protocol 2; empty: pymavlink generates them")
set(headers ${TWOVIEW_MAVLINK_INCLUDE_DIR})
set(MAVLINK_INCLUDE_DIR "")

if(NOT headers)
  find_package(Python3 3.9 QUIET COMPONENTS Interpreter)
  if(Python3_FOUND)
    set(headers ${PROJECT_BINARY_DIR}/mavlink)
    execute_process(COMMAND ${Python3_EXECUTABLE} -B
        ${PROJECT_SOURCE_DIR}/cmake/generate_mavlink.py ${PROJECT_SOURCE_DIR}/.cache/mavlink ${headers}
      RESULT_VARIABLE failed OUTPUT_VARIABLE words ERROR_VARIABLE words)
    if(failed)
      set(headers "")
    endif()
  endif()
endif()

foreach(dialect common ardupilotmega)
  if(headers AND EXISTS ${headers}/${dialect}/mavlink.h)
    set(MAVLINK_INCLUDE_DIR ${headers}/${dialect})
  endif()
endforeach()
if(NOT MAVLINK_INCLUDE_DIR)
  set(message "the driver of MAVLink vehicles is not built: no MAVLink C headers and no pymavlink \
(scripts/bootstrap mavlink fetches it)")
  if(TWOVIEW_MAVLINK STREQUAL "AUTO")
    message(STATUS "${message}")
  else()
    message(FATAL_ERROR "${message}")
  endif()
endif()
