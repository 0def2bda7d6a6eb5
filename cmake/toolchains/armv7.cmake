# Toolchain for 32-bit ARM Linux with hard float, for the Cortex-A8 of an AR.Drone 2.0 and all later
# cores: Debian's g++-arm-linux-gnueabihf, or clang++ with the same sysroot
# (-DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++). Tests run under qemu-user.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR armv7l)
set(tv_triplet arm-linux-gnueabihf)
# The base ISA has sixteen double registers and no NEON, as in Debian's armhf. The NEON set has its
# own flags (lib/CMakeLists.txt) and is selected at run time if the CPU has NEON.
set(CMAKE_C_FLAGS_INIT "-mcpu=cortex-a8 -mfpu=vfpv3-d16 -mfloat-abi=hard")
set(CMAKE_CXX_FLAGS_INIT "${CMAKE_C_FLAGS_INIT}")
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-arm -L /usr/${tv_triplet})
include(${CMAKE_CURRENT_LIST_DIR}/debian_cross.cmake)
