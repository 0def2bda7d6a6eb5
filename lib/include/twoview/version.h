/* twoview: the version, in this one place; CMake reads it from here. */
#ifndef TWOVIEW_VERSION_H
#define TWOVIEW_VERSION_H

#define TV_VERSION_MAJOR 0
#define TV_VERSION_MINOR 1
#define TV_VERSION_PATCH 0
#define TV_VERSION_STRING "0.1.0"

#endif
