################################################################################
#
# twoview
#
################################################################################

TWOVIEW_VERSION = 0.2.0
TWOVIEW_SOURCE = twoview-$(TWOVIEW_VERSION).tar.xz
# The folder that holds the source archive of scripts/release.
TWOVIEW_SITE = $(TWOVIEW_PKGDIR)
TWOVIEW_SITE_METHOD = file
TWOVIEW_LICENSE = BSD-3-Clause
TWOVIEW_LICENSE_FILES = LICENSE
TWOVIEW_INSTALL_STAGING = YES
TWOVIEW_DEPENDENCIES = eigen
TWOVIEW_CONF_OPTS = \
	-DTWOVIEW_TOOLS=OFF \
	-DTWOVIEW_DRIVERS=OFF \
	-DTWOVIEW_DENSE=$(if $(BR2_PACKAGE_TWOVIEW_DENSE),ON,OFF) \
	-DTWOVIEW_ODOMETRY=$(if $(BR2_PACKAGE_TWOVIEW_ODOMETRY),ON,OFF) \
	-DTWOVIEW_ROOM=$(if $(BR2_PACKAGE_TWOVIEW_ROOM),ON,OFF) \
	-DBUILD_TESTING=OFF

$(eval $(cmake-package))
