# Adds the command line program if its libraries are found. With TWOVIEW_TOOLS=ON a missing library
# is an error.

find_package(yaml-cpp QUIET)
find_package(CLI11 QUIET)
find_package(nlohmann_json QUIET)
find_package(ZLIB QUIET)
find_package(PkgConfig QUIET)
if(PkgConfig_FOUND)
  pkg_check_modules(libexif QUIET IMPORTED_TARGET GLOBAL libexif)
  pkg_check_modules(libavformat QUIET IMPORTED_TARGET GLOBAL libavformat libavcodec libavutil)
  # Optional: the page of `twoview odometry --live`.
  pkg_check_modules(libmicrohttpd QUIET IMPORTED_TARGET GLOBAL libmicrohttpd)
endif()

set(missing "")
foreach(package OpenCV yaml-cpp CLI11 nlohmann_json ZLIB libexif libavformat)
  if(NOT ${package}_FOUND)
    list(APPEND missing ${package})
  endif()
endforeach()

if(NOT missing)
  # tools/room and tools/simulator are needed only by `drone simulate` and by the tests of flights.
  if(NOT TWOVIEW_SIMULATOR)
    message(STATUS "The drone's simulator is not built: TWOVIEW_SIMULATOR is OFF")
  elseif(TARGET ardrone_encode AND TARGET PkgConfig::LIBAV)
    add_subdirectory(${PROJECT_SOURCE_DIR}/tools/room ${PROJECT_BINARY_DIR}/tools/room)
    add_subdirectory(${PROJECT_SOURCE_DIR}/tools/simulator ${PROJECT_BINARY_DIR}/tools/simulator)
    add_subdirectory(${PROJECT_SOURCE_DIR}/tools/flights ${PROJECT_BINARY_DIR}/tools/flights)
  else()
    message(STATUS "The drone's simulator is not built; not found: libavcodec, libavutil")
  endif()
  add_subdirectory(${PROJECT_SOURCE_DIR}/tools/twoview ${PROJECT_BINARY_DIR}/tools/twoview)
elseif(TWOVIEW_TOOLS STREQUAL "AUTO")
  message(STATUS "The command line is not built; not found: ${missing}")
else()
  message(FATAL_ERROR "TWOVIEW_TOOLS is ON and these are not found: ${missing}")
endif()
