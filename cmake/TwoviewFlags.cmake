# Flags of every target of the project; those that only the library needs: lib/CMakeLists.txt.

add_library(twoview_flags INTERFACE)
target_compile_options(twoview_flags INTERFACE
  -Wall -Wextra -Wshadow
  $<$<COMPILE_LANGUAGE:C>:-Werror=implicit-function-declaration>
  $<$<BOOL:${TWOVIEW_WERROR}>:-Werror>
  # 32-bit ARM: no note that GCC 7 changed how Eigen's types are passed.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-psabi>
  # a * b + c stays two roundings on every CPU: results are the same bytes everywhere.
  -ffp-contract=off)

if(TWOVIEW_SANITIZE)
  string(REPLACE ";" "," sanitizers "${TWOVIEW_SANITIZE}")
  add_compile_options(-fsanitize=${sanitizers} -fno-sanitize-recover=all -fno-omit-frame-pointer -g)
  add_link_options(-fsanitize=${sanitizers})
endif()
