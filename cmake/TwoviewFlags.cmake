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

if(TWOVIEW_SANITIZE)
  string(REPLACE ";" "," sanitizers "${TWOVIEW_SANITIZE}")
  add_compile_options(-fsanitize=${sanitizers} -fno-sanitize-recover=all -fno-omit-frame-pointer -g)
  add_link_options(-fsanitize=${sanitizers})
endif()
