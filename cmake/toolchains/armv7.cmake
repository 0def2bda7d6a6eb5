# 32-bit ARM, Linux, hard float, for the Cortex-A8 of an AR.Drone 2.0 and all later cores: Debian's
# g++-arm-linux-gnueabihf, or clang++ with the same sysroot (-DCMAKE_C_COMPILER=clang
# -DCMAKE_CXX_COMPILER=clang++). Tests run under qemu-user.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR armv7l)
set(tv_triplet arm-linux-gnueabihf)
# Sixteen double registers and no NEON, as in Debian's armhf: the kernels of the NEON set have their
# own flags (lib/CMakeLists.txt), and whether the CPU has NEON is found out at run time.
set(CMAKE_C_FLAGS_INIT "-mcpu=cortex-a8 -mfpu=vfpv3-d16 -mfloat-abi=hard")
set(CMAKE_CXX_FLAGS_INIT "${CMAKE_C_FLAGS_INIT}")
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-arm -L /usr/${tv_triplet})
include(${CMAKE_CURRENT_LIST_DIR}/debian_cross.cmake)
