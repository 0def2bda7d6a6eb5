# Compiler flags of every target of the project. Flags that only the library needs are in
# lib/CMakeLists.txt.

add_library(twoview_flags INTERFACE)
target_compile_options(twoview_flags INTERFACE
  -Wall -Wextra -Wshadow
  $<$<COMPILE_LANGUAGE:C>:-Werror=implicit-function-declaration>
  $<$<BOOL:${TWOVIEW_WERROR}>:-Werror>
  # On 32-bit ARM: suppresses the note that GCC 7 changed how Eigen's types are passed.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-psabi>
  # a * b + c is rounded twice on every CPU, so that results have the same bytes everywhere.
  -ffp-contract=off)

# A sanitizer's report names functions, files and lines, which -g1 gives; -g would take half as much
# time again to compile.
if(TWOVIEW_SANITIZE)
  string(REPLACE ";" "," sanitizers "${TWOVIEW_SANITIZE}")
  add_compile_options(-fsanitize=${sanitizers} -fno-sanitize-recover=all -fno-omit-frame-pointer -g1)
  # clang's check of calls through pointers needs its C++ runtime, to which tests in C do not link.
  add_compile_options($<$<CXX_COMPILER_ID:Clang>:-fno-sanitize=function>)
  add_link_options(-fsanitize=${sanitizers})
  add_compile_definitions(TWOVIEW_SANITIZED)
endif()

# tv_precompile(target header...) has the target's C++ sources begin with these headers, parsed once:
# in debug builds, such as those of the sanitizers and of the fuzz targets, and where
# TWOVIEW_PRECOMPILE asks for it. Other release builds do without, so that one of them finds a
# forgotten #include. A launcher turns this off, because ccache would not keep the objects. clang
# refuses the headers where a source has options of its own that change code.
# tv_precompile(target REUSE_FROM other) takes those of a target with the same flags;
# tv_precompile(target ALWAYS header...) does so in every build without a launcher; a build with one
# finds a forgotten #include.
option(TWOVIEW_PRECOMPILE "Parse the headers of Eigen once, in release builds too" OFF)
mark_as_advanced(TWOVIEW_PRECOMPILE)
function(tv_precompile target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "ALWAYS" "REUSE_FROM" "")
  if(CMAKE_CXX_COMPILER_LAUNCHER OR
     NOT (CMAKE_BUILD_TYPE STREQUAL "Debug" OR TWOVIEW_PRECOMPILE OR arg_ALWAYS))
    return()
  endif()
  if(arg_REUSE_FROM)
    target_precompile_headers(${target} REUSE_FROM ${arg_REUSE_FROM})
    return()
  endif()
  list(TRANSFORM arg_UNPARSED_ARGUMENTS REPLACE "^(.+)$" "$<$<COMPILE_LANGUAGE:CXX>:<\\1$<ANGLE-R>>"
    OUTPUT_VARIABLE headers)
  target_precompile_headers(${target} PRIVATE ${headers})
endfunction()
