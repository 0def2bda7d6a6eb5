# Provides the test framework Unity as the target twoview_unity. It is the first of these that is
# found: the folder named by TWOVIEW_UNITY_DIR, an installed Unity that has doubles, the copy that
# scripts/bootstrap took from the source package of Debian's cjson. Else it is upstream's release.

set(TWOVIEW_UNITY_DIR "" CACHE PATH "Folder with unity.c, unity.h and unity_internals.h")

add_library(twoview_unity INTERFACE)
# The macros are defined as empty, as the copy in cjson itself defines them. UNITY_SUPPORT_64 is
# needed because 64-bit numbers are off by default on a 32-bit CPU.
target_compile_definitions(twoview_unity INTERFACE UNITY_INCLUDE_DOUBLE= UNITY_SUPPORT_64=)

function(tv_build_unity folder)
  if(NOT EXISTS ${folder}/unity.c)
    message(FATAL_ERROR "No unity.c in ${folder}")
  endif()
  message(STATUS "Unity: ${folder}")
  add_library(twoview_unity_source STATIC ${folder}/unity.c)
  target_include_directories(twoview_unity_source SYSTEM PUBLIC ${folder})
  # Provides empty setUp and tearDown for tests that define none.
  target_compile_definitions(twoview_unity_source PRIVATE
    UNITY_INCLUDE_SETUP_STUBS= UNITY_INCLUDE_DOUBLE= UNITY_SUPPORT_64=)
  target_link_libraries(twoview_unity INTERFACE twoview_unity_source)
endfunction()

# Sets `result` to true if a Unity is installed and was built with doubles.
function(tv_check_installed_unity result)
  find_package(unity QUIET CONFIG)
  if(unity_FOUND)
    include(CheckCSourceCompiles)
    set(CMAKE_REQUIRED_LIBRARIES unity::framework)
    set(CMAKE_REQUIRED_DEFINITIONS -DUNITY_INCLUDE_DOUBLE)
    check_c_source_compiles("
      #include <unity.h>
      void setUp(void) {}
      void tearDown(void) {}
      int main(void) { TEST_ASSERT_EQUAL_DOUBLE(1, 1); return 0; }" TWOVIEW_UNITY_HAS_DOUBLES)
  endif()
  set(${result} ${TWOVIEW_UNITY_HAS_DOUBLES} PARENT_SCOPE)
endfunction()

set(cached_unity ${PROJECT_SOURCE_DIR}/.cache/unity/src)
if(TWOVIEW_UNITY_DIR)
  tv_build_unity(${TWOVIEW_UNITY_DIR})
else()
  tv_check_installed_unity(installed)
  if(installed)
    message(STATUS "Unity: installed, ${unity_DIR}")
    target_link_libraries(twoview_unity INTERFACE unity::framework)
  elseif(EXISTS ${cached_unity}/unity.c)
    tv_build_unity(${cached_unity})
  else()
    include(FetchContent)
    FetchContent_Declare(unity
      URL https://github.com/ThrowTheSwitch/Unity/archive/refs/tags/v2.6.1.tar.gz
      URL_HASH SHA256=b41a66d45a6b99758fb3202ace6178177014d52fc524bf1f72687d93e9867292
      DOWNLOAD_EXTRACT_TIMESTAMP OFF
      SOURCE_SUBDIR none) # Unity's own build is left out, because it exports and installs
    FetchContent_MakeAvailable(unity)
    tv_build_unity(${unity_SOURCE_DIR}/src)
  endif()
endif()
