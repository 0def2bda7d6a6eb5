/* twoview: the version of these headers. CMake reads the project's version from this file. */
#ifndef TWOVIEW_VERSION_H
#define TWOVIEW_VERSION_H

/* Increases when the ABI breaks. Before 1.0 a new minor version may break it, too: the soname is
   libtwoview.so.0.2 for 0.2.x, and libtwoview.so.N from N.0.0 on. */
#define TV_VERSION_MAJOR 0
/* Increases with new functions and with new fields at the ends of structs. */
#define TV_VERSION_MINOR 2
/* Increases with changes that neither add to the API nor break it. */
#define TV_VERSION_PATCH 0
/* The three numbers as a string. tv_version_string returns that of the library that is linked. */
#define TV_VERSION_STRING "0.2.0"

#endif
