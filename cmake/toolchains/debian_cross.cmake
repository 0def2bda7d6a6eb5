# Settings that Debian's cross compilers share. Set `tv_triplet` to the triplet of the target before
# including this file.
if(NOT CMAKE_C_COMPILER)
  set(CMAKE_C_COMPILER ${tv_triplet}-gcc)
endif()
if(NOT CMAKE_CXX_COMPILER)
  set(CMAKE_CXX_COMPILER ${tv_triplet}-g++)
endif()
# clang needs the target as an option. gcc does not, because each gcc is built for one target.
set(CMAKE_C_COMPILER_TARGET ${tv_triplet})
set(CMAKE_CXX_COMPILER_TARGET ${tv_triplet})

# Libraries are searched in the target's folders only. Eigen has only headers, so the host's are
# used.
set(CMAKE_FIND_ROOT_PATH /usr/${tv_triplet})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(Eigen3_DIR /usr/share/eigen3/cmake CACHE PATH "Eigen's CMake files")
set(ENV{PKG_CONFIG_LIBDIR} /usr/${tv_triplet}/lib/pkgconfig)
