// SPDX-License-Identifier: MIT
#include "command_line.hpp"

int main(int argc, char** argv) { return uwbpos::host::run(argc, argv); }
