# Language level, warnings, sanitizers: the same for every target of the project.
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE RelWithDebInfo CACHE STRING "" FORCE)
endif()
# Debug symbols of template-heavy ROS code triple build time and size: keep optimisation and asserts
# as in Release, with line tables only.
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O2 -g1 -DNDEBUG")

# A library on the line that a program does not use is not loaded when it starts.
add_link_options(-Wl,--as-needed)

# What tests and measures is linked by a linker that takes a third of the time of GNU ld. What is installed to drive is
# not: it is linked here as on every machine.
find_program(LLVM_LINKER ld.lld)
function(livemap_link_fast)
  if(LLVM_LINKER AND NOT LIVEMAP_SANITIZE)
    foreach(target IN LISTS ARGN)
      target_link_options(${target} PRIVATE -fuse-ld=lld)
    endforeach()
  endif()
endfunction()

# The sources of a target are compiled as a few, since their headers cost more than they do. Names in
# anonymous namespaces have to differ then within a module, and within a program of tests.
if(LIVEMAP_UNITY)
  set(CMAKE_UNITY_BUILD ON)
  set(CMAKE_UNITY_BUILD_BATCH_SIZE 18)
endif()

add_library(livemap_options INTERFACE)
target_compile_options(livemap_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror $<$<CXX_COMPILER_ID:Clang>:-Wthread-safety>)

if(LIVEMAP_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "LIVEMAP_FUZZ needs -DCMAKE_CXX_COMPILER=clang++, not ${CMAKE_CXX_COMPILER_ID}")
  endif()
  if(NOT LIVEMAP_SANITIZE)
    set(LIVEMAP_SANITIZE address,undefined)
  endif()
  add_compile_options(-fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/test/fuzz/third_party_findings.txt)
endif()
if(LIVEMAP_SANITIZE)
  # Eigen's and Ceres's templates with checks around each access take -O2 minutes to compile.
  set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O1 -g1 -DNDEBUG")
  add_compile_options(-fsanitize=${LIVEMAP_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${LIVEMAP_SANITIZE})
  # GNU ld takes seconds for a program with checks.
  if(LLVM_LINKER)
    add_link_options(-fuse-ld=lld)
  endif()
  if(LIVEMAP_SANITIZE MATCHES "undefined")
    # The vptr check wants the type information of SOCI's classes, which its library hides.
    add_compile_options(-fno-sanitize=vptr)
  endif()
  if(LIVEMAP_SANITIZE MATCHES "thread")
    # ThreadSanitizer knows no fences; Boost.Asio's queues are guarded by mutexes, which it does know.
    add_compile_definitions(BOOST_ASIO_DISABLE_FENCED_BLOCK)
  endif()
  # GCC 12 warns of std::function's own members when sanitizers keep it from inlining (std::regex).
  target_compile_options(livemap_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
endif()
