# Toolchain for 64-bit ARM Linux: Debian's g++-aarch64-linux-gnu, or clang++ with the same sysroot
# (-DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++). Tests run under qemu-user.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(tv_triplet aarch64-linux-gnu)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64 -L /usr/${tv_triplet})
include(${CMAKE_CURRENT_LIST_DIR}/debian_cross.cmake)
