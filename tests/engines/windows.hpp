// SPDX-License-Identifier: MIT
// What tests under Wine need of Windows, beside servers of Linux. Such a server cannot give its memory
// the name that the specification says for Windows: so who opens that name first gives it to the file.
#pragma once

#include "splatbus/io/sockets.hpp"

#include <algorithm>
#include <cstdio>
#include <string>

inline HANDLE open_named(DWORD access, BOOL is_inherited, const char* name) {
  const std::string path = "Z:\\dev\\shm\\" + std::string(name).substr(sizeof "Local\\" - 1);
  const HANDLE file = CreateFileA(path.c_str(), GENERIC_READ, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr, OPEN_EXISTING, 0, nullptr);
  const HANDLE named = file == INVALID_HANDLE_VALUE ? nullptr : CreateFileMappingA(file, nullptr, PAGE_READONLY, 0, 0, name);
  const HANDLE opened = OpenFileMappingA(access, is_inherited, name);
  if (named != nullptr) CloseHandle(named);
  if (file != INVALID_HANDLE_VALUE) CloseHandle(file);
  return opened;
}

/// As a server of Windows does: memory of this name, full of halves, until the input ends.
inline int hold(const std::string& name, DWORD bytes) {
  const HANDLE object = CreateFileMappingA(INVALID_HANDLE_VALUE, nullptr, PAGE_READWRITE, 0, bytes, ("Local\\" + name).c_str());
  auto* const numbers = static_cast<float*>(MapViewOfFile(object, FILE_MAP_WRITE, 0, 0, bytes));
  if (numbers == nullptr) return 1;
  std::fill_n(numbers, bytes / sizeof(float), 0.5F);
  std::puts("held"), std::fflush(stdout);
  return std::getchar() == EOF ? 0 : 1;
}

#define OpenFileMappingA open_named  // of all that is included after this
