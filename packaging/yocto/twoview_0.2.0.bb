SUMMARY = "FAST-SIFT matching and two-view geometry, without a heap"
LICENSE = "BSD-3-Clause"
LIC_FILES_CHKSUM = "file://LICENSE;md5=5791b4f4807ac0bdcbc199327bf6050e"

# The source archive of scripts/release, beside this recipe in a folder files/.
SRC_URI = "file://twoview-${PV}.tar.xz"

DEPENDS = "libeigen"
inherit cmake pkgconfig

PACKAGECONFIG ??= "dense odometry room"
PACKAGECONFIG[dense] = "-DTWOVIEW_DENSE=ON,-DTWOVIEW_DENSE=OFF"
PACKAGECONFIG[odometry] = "-DTWOVIEW_ODOMETRY=ON,-DTWOVIEW_ODOMETRY=OFF"
PACKAGECONFIG[room] = "-DTWOVIEW_ROOM=ON,-DTWOVIEW_ROOM=OFF"

EXTRA_OECMAKE = "-DTWOVIEW_TOOLS=OFF -DTWOVIEW_DRIVERS=OFF -DBUILD_TESTING=OFF"

# FILES:${PN}, -dev and -staticdev are Yocto's defaults: the image gets libtwoview.so.0.2 alone.
BBCLASSEXTEND = "native nativesdk"
