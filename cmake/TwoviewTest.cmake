# Functions that build and register tests: tv_register_test for any command, tv_add_test for a Unity
# test.

# The exit status of a program in which a test could not run here; the program prints which test and
# why. ctest reports such a program as skipped, never as passed, even if its other tests passed.
set(TWOVIEW_SKIP_CODE 77)
# Runs a Python test file and returns this exit status where it applies.
set(TWOVIEW_RUN_PYTHON_TEST ${PROJECT_SOURCE_DIR}/test/support/run_python.py)
# The prefix of test names. scripts/test runs the tests of several builds in one ctest, so those of
# a sanitizer build need a prefix.
set(TWOVIEW_TEST_PREFIX "")
if(TWOVIEW_SANITIZE)
  set(TWOVIEW_TEST_PREFIX "asan/")
endif()

# These take more than ten seconds in a release build. `scripts/test --quick` leaves them out (label
# long), and the whole run begins with them.
set(TWOVIEW_LONG_TESTS
  api/odometry_api
  cli/bad_input cli/calibrate cli/camera_files cli/drone cli/drone_bad_input cli/evaluate cli/films
  cli/folders cli/mask cli/mavlink cli/odometry cli/own_matches cli/photographs cli/principal_point
  cli/reconstruct cli/recording cli/rerun cli/room_model
  examples/examples
  golden/determinism
  property/bundle_covariance property/principal_point
  python/accuracy_belief python/bad_input python/colmap_export python/colmap_import
  python/compare_bad_input python/compare_reference python/compare_report python/odometry_runs
  python/odometry_tour python/package_wheel python/paper
  rules/footprint_arm rules/packaging
  unit/bundle_ceres unit/triangulation_optimal unit/window_ceres)

# tv_register_test(name LABEL label COMMAND command... [DIRECTORY working_directory])
# Registers the command as the test label/name, with the time limit and the environment of all
# tests.
function(tv_register_test name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "LABEL;DIRECTORY" "COMMAND")
  if(NOT arg_DIRECTORY)
    set(arg_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR})
  endif()
  set(test ${TWOVIEW_TEST_PREFIX}${arg_LABEL}/${name})
  set(environment TWOVIEW_PROGRAM=${PROJECT_BINARY_DIR}/bin/twoview
    UBSAN_OPTIONS=print_stacktrace=1)
  add_test(NAME ${test} COMMAND ${arg_COMMAND} WORKING_DIRECTORY ${arg_DIRECTORY})
  set_tests_properties(${test} PROPERTIES
    LABELS ${arg_LABEL}
    SKIP_RETURN_CODE ${TWOVIEW_SKIP_CODE}
    TIMEOUT 600
    ENVIRONMENT "${environment}")
  if("${arg_LABEL}/${name}" IN_LIST TWOVIEW_LONG_TESTS)
    set_tests_properties(${test} PROPERTIES LABELS "${arg_LABEL};long" COST 10)
  endif()
endfunction()

# Replaces Unity's end of a program by one that returns TWOVIEW_SKIP_CODE as described above
# (test/support/unity_end.c). The folder of the benchmarks includes this file, too, without Unity.
if(TARGET twoview_unity AND NOT TARGET twoview_unity_end)
  add_library(twoview_unity_end STATIC ${PROJECT_SOURCE_DIR}/test/support/unity_end.c)
  target_link_libraries(twoview_unity_end PRIVATE twoview_flags twoview_unity)
  target_compile_definitions(twoview_unity_end
    PRIVATE TWOVIEW_SKIP_CODE=${TWOVIEW_SKIP_CODE}
    INTERFACE UnityEnd=tv_UnityEnd UnityDefaultTestRun=tv_UnityDefaultTestRun)
endif()

# tv_add_test(name LABEL label SOURCES file... [LIBS library...])
# Builds a Unity test and registers it as the test label/name.
function(tv_add_test name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "LABEL" "SOURCES;LIBS")
  set(target ${arg_LABEL}_${name})
  add_executable(${target} ${arg_SOURCES})
  target_link_libraries(${target} PRIVATE twoview_flags twoview_unity_end twoview_unity ${arg_LIBS} m)
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/test)
  target_compile_definitions(${target} PRIVATE
    TWOVIEW_SKIP_CODE=${TWOVIEW_SKIP_CODE}
    TWOVIEW_CACHE_DIR="${PROJECT_SOURCE_DIR}/.cache")
  # The public headers are C99, which rules/install checks. The tests themselves are C11 with
  # extensions.
  set_target_properties(${target} PROPERTIES
    C_STANDARD 11
    C_EXTENSIONS ON
    RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/test/bin)
  tv_register_test(${name} LABEL ${arg_LABEL} COMMAND ${target})
endfunction()
