// SPDX-License-Identifier: MIT
// The programs of the C++ client in one, since most of what each takes to compile is the client: the
// first argument names one, and the others are its own.
#include <cstdio>
#include <cstdlib>
#include <string_view>

#ifdef _WIN32
#include "windows.hpp"
#endif

#define main tests
#include "tests/vectors.cpp"
#undef main
#define main viewer
#include "programs/viewer.cpp"
#undef main
#define main adapter
#include "programs/adapter.cpp"
#undef main

int main(int count, char** arguments) {
  const std::string_view name = count > 1 ? arguments[1] : "";
  if (name == "Tests") return tests(count - 1, arguments + 1);
  if (name == "Viewer") return viewer(count - 1, arguments + 1);
  if (name == "Adapter") return adapter(count - 1, arguments + 1);
#ifdef _WIN32
  if (name == "Hold" && count == 4) return hold(arguments[2], std::strtoul(arguments[3], nullptr, 10));
#endif
  return std::fputs("Tests, Viewer or Adapter, and its arguments\n", stderr), 2;
}
