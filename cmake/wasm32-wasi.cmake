# Toolchain file for WebAssembly with the system interface WASI: clang, wasm-ld, Debian's wasi-libc
# and libclang-rt-14-dev-wasm32. For another clang or C library set -DCMAKE_C_COMPILER= and
# -DCMAKE_SYSROOT=.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR wasm32)
find_program(CMAKE_C_COMPILER NAMES clang-14 clang REQUIRED)
find_program(CMAKE_AR NAMES llvm-ar-14 llvm-ar REQUIRED)
find_program(CMAKE_RANLIB NAMES llvm-ranlib-14 llvm-ranlib REQUIRED)
set(CMAKE_C_COMPILER_TARGET wasm32-wasi)
# 128-bit SIMD; WASI has no processes, so getpid() is emulated
set(CMAKE_C_FLAGS_INIT "-msimd128 -D_WASI_EMULATED_GETPID")
