/* twoview: the version, in this one place; CMake reads it from here. */
#ifndef TWOVIEW_VERSION_H
#define TWOVIEW_VERSION_H

/* Changes with the ABI, as the shared library's soname does. */
#define TV_VERSION_MAJOR 0
/* New functions, and new fields at the ends of structs. */
#define TV_VERSION_MINOR 1
/* Neither. */
#define TV_VERSION_PATCH 0
/* The three of them; tv_version_string has those of the library that is linked. */
#define TV_VERSION_STRING "0.1.0"

#endif
