// SPDX-License-Identifier: MIT
// `windows.h` without the macros and the old sockets that clash with anybody's names. Only for Windows.
#pragma once

#ifndef NOMINMAX
#define NOMINMAX
#endif
#ifndef WIN32_LEAN_AND_MEAN
#define WIN32_LEAN_AND_MEAN
#endif
#include <windows.h>
