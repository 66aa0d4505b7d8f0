# SPDX-License-Identifier: MIT
# Toolchain file for bare Cortex-M programs with newlib, to be run under QEMU:
#   cmake -S tests/firmware -B build/firmware/m4f -DCMAKE_TOOLCHAIN_FILE=cmake/cortex-m.cmake -DBOARD=m4f
# BOARD is m0, m3, m4f, m7 or m33. Programs link tests/firmware/bare/startup.cpp.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(BOARD m4f CACHE STRING "m0, m3, m4f, m7 or m33")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES BOARD)

# Per board: processor, machine and processor of QEMU, flash and RAM (origin, length).
if(BOARD STREQUAL "m0")
  set(_processor -mcpu=cortex-m0 -mfloat-abi=soft)
  set(_machine microbit cortex-m0)
  set(_memory 0 256K 0x20000000 16K)
elseif(BOARD STREQUAL "m3")
  set(_processor -mcpu=cortex-m3 -mfloat-abi=soft)
  set(_machine mps2-an385 cortex-m3)
  set(_memory 0 4M 0x20000000 4M)
elseif(BOARD STREQUAL "m4f")
  set(_processor -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard)
  set(_machine mps2-an386 cortex-m4)
  set(_memory 0 4M 0x20000000 4M)
elseif(BOARD STREQUAL "m7")
  set(_processor -mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard)
  set(_machine mps2-an500 cortex-m7)
  set(_memory 0 4M 0x20000000 4M)
elseif(BOARD STREQUAL "m33")
  set(_processor -mcpu=cortex-m33 -mfpu=fpv5-sp-d16 -mfloat-abi=hard)
  set(_machine mps2-an505 cortex-m33)
  set(_memory 0x10000000 4M 0x38000000 2M)
else()
  message(FATAL_ERROR "no such BOARD: ${BOARD} (m0, m3, m4f, m7, m33)")
endif()
list(GET _machine 0 _qemu_machine)
list(GET _machine 1 _qemu_cpu)
list(GET _memory 0 _rom)
list(GET _memory 1 _rom_size)
list(GET _memory 2 _ram)
list(GET _memory 3 _ram_size)

list(JOIN _processor " " _flags)
string(CONCAT CMAKE_CXX_FLAGS_INIT "-mthumb ${_flags} -ffunction-sections -fdata-sections"
       " -fno-exceptions -fno-rtti -fno-math-errno -fno-threadsafe-statics -fno-use-cxa-atexit"
       " -ffp-contract=off -Wno-psabi")
# The M0's 256 KiB of flash hold all cases only when compiled for size.
if(BOARD STREQUAL "m0")
  set(CMAKE_CXX_FLAGS_RELEASE "-Os -DNDEBUG" CACHE STRING "")
else()
  set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG" CACHE STRING "")
endif()
# The linker script refuses heap and exceptions.
string(CONCAT CMAKE_EXE_LINKER_FLAGS_INIT "-nostartfiles -T ${CMAKE_CURRENT_LIST_DIR}/cortex-m.ld"
       " -Wl,--gc-sections --specs=nano.specs"
       " -Wl,--defsym=ROM=${_rom} -Wl,--defsym=ROM_SIZE=${_rom_size}"
       " -Wl,--defsym=RAM=${_ram} -Wl,--defsym=RAM_SIZE=${_ram_size}")
# With -icount an instruction takes a nanosecond of the machine's time, whatever the host does.
set(CMAKE_CROSSCOMPILING_EMULATOR
    qemu-system-arm -machine ${_qemu_machine} -cpu ${_qemu_cpu} -icount shift=0 -display none
    -serial stdio -monitor none -semihosting-config enable=on,target=native -kernel)
